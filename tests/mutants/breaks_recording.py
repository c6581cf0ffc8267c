"""Breaks of the journal: nothing acknowledged is lost, nothing damaged is used."""

from __future__ import annotations

from mutant import in_file

_JOURNAL = "tests/recording/test_journal.py"

RECORDING = [
    *in_file(
        "haptics/recording/segments.py",
        _JOURNAL,
        (
            "believes any checksum",
            "flipped bits are read as measurements",
            "if zlib.crc32(payload, zlib.crc32(head)) != crc:",
            "if False:",
        ),
        (
            "does not count its segments",
            "rows that were lost or written twice pass for whole",
            "if found != index:",
            "if False:",
        ),
        (
            "a checksum leaves out the head",
            "rows are read as another stream's",
            "return head, _CRC.pack(zlib.crc32(payload, zlib.crc32(head))), payload",
            "return head, _CRC.pack(zlib.crc32(payload)), payload",
        ),
        (
            "stumbles over a head that is cut",
            "what a killed session left cannot be opened at all",
            "if size - offset < HEAD_BYTES:",
            "if size - offset < 0:",
        ),
    ),
    *in_file(
        "haptics/recording/journal.py",
        _JOURNAL,
        (
            "a torn write stays in the file",
            "all that is written after a full disk is lost",
            "        file.seek(self._length)\n        file.truncate(self._length)",
            "        file.seek(self._length)",
        ),
        (
            "acknowledges rows that were not written",
            "a full disk loses what was promised",
            '                    self._write(b"".join(parts), len(full))',
            "                    for stream in full:\n                        stream.acknowledge()\n"
            '                    self._write(b"".join(parts), len(full))',
        ),
        (
            "closing loses the last rows",
            "the end of every session is missing",
            '        payload = _json("footer", footer or {})\n        self.commit()',
            '        payload = _json("footer", footer or {})',
        ),
        (
            "abandoning loses the last rows",
            "a session that broke off loses how",
            "            try:\n                self.commit()\n            finally:\n                self._release()",
            "            self._release()",
        ),
        (
            "a session that broke off is called complete",
            "nobody looks for what is missing",
            "            try:\n                self.commit()\n            finally:\n                self._release()",
            "            self.close()",
        ),
        (
            "a full buffer drops its oldest row",
            "rows are missing, and nothing shows it",
            "            self._journal.commit()\n            count = self._count",
            "            count = 0",
        ),
        (
            "a write that was short is not gone on with",
            "a nearly full disk cuts a segment in two",
            "            while left:\n                left = left[file.write(left) :]",
            "            file.write(left)",
        ),
    ),
    *in_file(
        "haptics/recording/journal_reader.py",
        _JOURNAL,
        (
            "a damaged journal is called complete",
            "nobody looks for what is missing",
            "return self.footer is not None and self.damage is None",
            "return self.damage is None or self.footer is not None",
        ),
    ),
    *in_file(
        "haptics/recording/lock.py",
        _JOURNAL,
        (
            "takes a journal that is being written for a leftover",
            "a second run destroys the first",
            "    except BlockingIOError:\n        return False",
            "    except BlockingIOError:\n        return True",
        ),
    ),
    *in_file(
        "haptics/recording/leftovers.py",
        "tests/recording/test_output.py tests/recording/test_journal.py",
        (
            "overwrites the journal of a session that broke off",
            "the only copy of what happened is gone",
            "    if not _begun_and_no_more(path):\n        raise",
            "    if not force and not _begun_and_no_more(path):\n        raise",
        ),
    ),
    *in_file(
        "haptics/recording/seal.py",
        "tests/recording/test_damage.py",
        (
            "believes any seal",
            "flipped bits are read as measurements",
            "if _digest(file, hdf5 + directory) == found[3].decode():",
            "if _digest(file, hdf5 + directory):",
        ),
        (
            "believes a file that was cut or grew",
            "half a recording is read as one",
            "if hdf5 + directory + _LINE_BYTES != size:",
            "if hdf5 + directory + _LINE_BYTES > 2 * size:",
        ),
        (
            "seals less than the whole file",
            "flipped bits in names and sizes go unseen",
            "line = _LINE.format(size, len(directory), _digest(file, size + len(directory)))",
            "line = _LINE.format(size, len(directory), _digest(file, size // 2))",
            "tests/recording/test_damage.py tests/recording/test_hdf5.py",
        ),
    ),
]
