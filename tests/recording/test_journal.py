"""A journal gives back what was committed, whatever happens to the file's end."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from haptics.errors import HapticsError, InputError
from haptics.recording import Journal, StreamSpec, read_journal
from haptics.recording.segments import HEAD_BYTES, MAGIC

ROW = np.dtype([("time_ns", "<i8"), ("value", "<f4", (2,)), ("name", "S8"), ("raw", "V4")])
KINDS = st.sampled_from(["<i8", "<u2", "i1", "u1", "<f4", "<f8", "?", "S5", "V6"])
FIELDS = st.lists(st.tuples(KINDS, st.sampled_from([(), (1,), (3,), (2, 4)])), max_size=5)


def small_journal(path: Path) -> list[int]:
    """Two commits and a footer; returns the file's length after each acknowledged step."""
    lengths = []
    journal = Journal.create(path, {"seed": 1})
    lengths.append(path.stat().st_size)
    stream = journal.stream("a", ROW, {"value": "K"})
    lengths.append(path.stat().st_size)
    for commit in range(2):
        for step in range(3):
            stream.append((10 * commit + step, (step, 2.5), "tip", b"\0\1"))
        assert journal.commit() == 3
        lengths.append(path.stat().st_size)
    journal.blob("plan.json", b"{}")
    lengths.append(path.stat().st_size)
    journal.close({"contacts": 2})
    lengths.append(path.stat().st_size)
    return lengths


def test_rows_header_blobs_and_footer_come_back(tmp_path: Path):
    small_journal(tmp_path / "j")
    contents = read_journal(tmp_path / "j")
    assert contents.header == {"seed": 1}
    assert contents.footer == {"contacts": 2}
    assert contents.complete
    assert contents.damage is None
    assert contents.dropped_bytes == 0
    assert contents.blob("plan.json") == b"{}"
    assert contents.streams["a"].units == {"time_ns": "ns", "value": "K"}
    rows = contents.stream("a")
    assert rows["time_ns"].tolist() == [0, 1, 2, 10, 11, 12]
    assert rows["value"][1].tolist() == [1.0, 2.5]
    assert rows["name"][0] == b"tip"
    assert rows["raw"][0].tobytes() == b"\0\1\0\0"


@given(fields=FIELDS, data=st.data())
def test_any_rows_of_any_type_come_back_bit_for_bit(tmp_path_factory, fields, data):
    dtype = np.dtype([("time_ns", "<i8"), *((f"f{place}", kind, shape) for place, (kind, shape) in enumerate(fields))])
    count = data.draw(st.integers(0, 9))
    raw = data.draw(st.binary(min_size=count * dtype.itemsize, max_size=count * dtype.itemsize))
    rows = np.frombuffer(raw, dtype)
    path = tmp_path_factory.mktemp("any") / "j"
    with Journal.create(path, {}, rows_per_segment=4) as journal:
        stream = journal.stream("s", dtype)
        stream.extend(rows[: count // 2])
        for row in rows[count // 2 :]:
            stream.append(row)
    assert read_journal(path).stream("s").tobytes() == raw


@settings(max_examples=30, deadline=None)
@given(spec=hnp.array_dtypes(max_size=4))
def test_a_row_type_is_taken_or_refused_never_misread(spec):
    fields = [spec[name] for name in spec.names]
    row = np.dtype([("time_ns", "<i8"), *((f"f{index}", field) for index, field in enumerate(fields))])
    if all(field.base.kind in "biufSV" and not field.base.names and field.itemsize for field in fields):
        taken = StreamSpec("s", row)
        assert StreamSpec.from_json(taken.as_json()) == taken
    else:
        with pytest.raises(InputError, match="has type"):
            StreamSpec("s", row)


def test_cut_at_any_byte_keeps_every_commit_before_the_cut(tmp_path: Path):
    lengths = small_journal(tmp_path / "j")
    whole = (tmp_path / "j").read_bytes()
    for cut in range(len(whole)):
        (tmp_path / "cut").write_bytes(whole[:cut])
        contents = read_journal(tmp_path / "cut")
        assert (contents.header is not None) == (cut >= lengths[0])
        assert len(contents.stream("a") if "a" in contents.streams else ()) == 3 * sum(cut >= length for length in lengths[2:4])
        assert not contents.complete
        good = 0 if cut < len(MAGIC) else max(length for length in [len(MAGIC), *lengths] if length <= cut)
        assert contents.dropped_bytes == cut - good
        assert (contents.damage is None) == (cut in lengths)
        assert contents.damage is None or contents.damage.offset == good


def test_a_wrong_byte_anywhere_is_found_and_all_before_it_kept(tmp_path: Path):
    lengths = small_journal(tmp_path / "j")
    whole = (tmp_path / "j").read_bytes()
    starts = [len(MAGIC), *lengths[:-1]]
    for place in range(len(whole)):
        wrong = bytearray(whole)
        wrong[place] ^= 1 << (place % 8)
        (tmp_path / "wrong").write_bytes(wrong)
        if place < len(MAGIC):
            with pytest.raises(InputError, match=f"byte {place} differs"):
                read_journal(tmp_path / "wrong")
            continue
        contents = read_journal(tmp_path / "wrong")
        good = max(start for start in starts if start <= place)
        assert contents.damage is not None
        assert contents.damage.offset == good
        assert contents.dropped_bytes == len(whole) - good
        assert len(contents.stream("a") if "a" in contents.streams else ()) == 3 * sum(good >= length for length in lengths[2:4])


@given(junk=st.binary(max_size=300))
def test_junk_after_the_magic_line_never_raises(tmp_path_factory, junk):
    path = tmp_path_factory.getbasetemp() / "junk"
    path.write_bytes(MAGIC + junk)
    contents = read_journal(path)
    assert contents.header is None
    assert contents.dropped_bytes == len(junk)


def test_a_repeated_segment_is_found(tmp_path: Path):
    lengths = small_journal(tmp_path / "j")
    whole = (tmp_path / "j").read_bytes()
    (tmp_path / "j").write_bytes(whole[: lengths[2]] + whole[lengths[1] : lengths[2]] + whole[lengths[2] :])
    contents = read_journal(tmp_path / "j")
    assert len(contents.stream("a")) == 3
    assert contents.damage is not None
    assert "segment 2 where 3 was due" in contents.damage.why


def test_same_rows_give_same_bytes(tmp_path: Path):
    small_journal(tmp_path / "one")
    small_journal(tmp_path / "two")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_rows_are_copied_when_appended(tmp_path: Path):
    with Journal.create(tmp_path / "j", {}) as journal:
        stream = journal.stream("a", ROW)
        value = np.array([1.0, 2.0])
        stream.append((0, value, "", b""))
        value[:] = 9.0
    assert read_journal(tmp_path / "j").stream("a")["value"].tolist() == [[1.0, 2.0]]


def test_a_full_buffer_commits_by_itself(tmp_path: Path):
    journal = Journal.create(tmp_path / "j", {}, rows_per_segment=10)
    stream = journal.stream("a", ROW)
    for step in range(25):
        stream.append((step, 0.0, "", b""))
    assert stream.buffered == 5
    assert read_journal(tmp_path / "j").stream("a")["time_ns"].tolist() == list(range(20))
    journal.close()


def test_rows_that_do_not_fit_are_refused_and_leave_no_trace(tmp_path: Path):
    with Journal.create(tmp_path / "j", {}) as journal:
        stream = journal.stream("a", ROW)
        for row in [
            (1, 2.0, "x"),
            (1, (1, 2, 3), "x", b""),
            (2**63, 0.0, "", b""),
            ("soon", 0.0, "", b""),
            (1, "é"),
            5,
            [1, 0.0, "", b""],
        ]:
            with pytest.raises(InputError, match="stream a: row"):
                stream.append(row)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="expected one dimension"):
            stream.extend(np.zeros(3))
        stream.append((7, 0.0, "x", b""))
    assert read_journal(tmp_path / "j").stream("a")["time_ns"].tolist() == [7]


def test_text_beyond_ascii_is_utf8_and_cut_at_a_whole_character(tmp_path: Path):
    with Journal.create(tmp_path / "j", {}) as journal:
        stream = journal.stream("a", ROW)
        stream.append((0, 0.0, "Prüfling", b""))
    assert read_journal(tmp_path / "j").stream("a")["name"][0].decode() == "Prüflin"


def test_fields_are_matched_by_name_when_extending(tmp_path: Path):
    rows = np.zeros(2, [("b", "<i4"), ("time_ns", "<i8")])
    rows["b"], rows["time_ns"] = [1, 2], [10, 20]
    with Journal.create(tmp_path / "j", {}) as journal:
        journal.stream("s", np.dtype([("time_ns", "<i8"), ("b", "<i4")])).extend(rows)
    read = read_journal(tmp_path / "j").stream("s")
    assert read["time_ns"].tolist() == [10, 20]
    assert read["b"].tolist() == [1, 2]


def test_nothing_is_overwritten_unasked(tmp_path: Path):
    small_journal(tmp_path / "j")
    before = (tmp_path / "j").read_bytes()
    for force in (False, True):
        with pytest.raises(InputError, match="not overwritten, not even with --force; save it first: haptics recording recover"):
            Journal.create(tmp_path / "j", {}, force=force)
        assert (tmp_path / "j").read_bytes() == before
    (tmp_path / "j").write_bytes(before[:20])  # its writer died before there was anything in it
    with pytest.raises(InputError, match="--force"):
        Journal.create(tmp_path / "j", {})
    Journal.create(tmp_path / "j", {"new": True}, force=True).close()
    assert read_journal(tmp_path / "j").header == {"new": True}


def test_a_journal_being_written_is_not_overwritten_even_by_force(tmp_path: Path):
    pytest.importorskip("fcntl", reason="file locks are POSIX")
    journal = Journal.create(tmp_path / "j", {})
    journal.stream("a", ROW).append((0, 0.0, "", b""))
    with pytest.raises(InputError, match="still writing"):
        Journal.create(tmp_path / "j", {}, force=True)
    journal.close()
    assert len(read_journal(tmp_path / "j").stream("a")) == 1


def test_who_goes_off_is_not_broken_off_by_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    journal = Journal.create(tmp_path / "j", {}, rows_per_segment=4)
    stream = journal.stream("a", ROW)
    stream.append((0, 0.0, "", b""))
    journal.commit()
    with monkeypatch.context() as full:
        full.setattr(journal, "_file", FullDisk(journal._file))
        for step in range(1, 5):
            stream.append((step, 0.0, "", b""))
        with pytest.raises(HapticsError, match="no space left"):
            stream.append((5, 0.0, "", b""))
        journal.raises = False
        stream.append((5, 0.0, "", b""))
        stream.extend(np.zeros(3, ROW))
        assert journal.commit() == 0
        assert "no space left" in str(journal.error)
        journal.abandon()
    assert read_journal(tmp_path / "j").stream("a")["time_ns"].tolist() == [0]


class FullDisk:
    """A file on a disk that takes nothing more."""

    def __init__(self, file: Any):
        self._file = file

    def write(self, data: Any) -> int:
        raise OSError(errno.ENOSPC, "no space left on device")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def test_a_write_that_is_broken_off_by_a_signal_leaves_no_torn_segment(tmp_path: Path):
    class Interrupted(FullDisk):
        def write(self, data: Any) -> int:
            self._file.write(bytes(data)[:7])
            raise KeyboardInterrupt

    journal = Journal.create(tmp_path / "j", {})
    stream = journal.stream("a", ROW)
    stream.append((1, 0.0, "", b""))
    whole = journal._file
    journal._file = Interrupted(whole)  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        journal.commit()
    journal._file = whole
    stream.append((2, 0.0, "", b""))
    journal.close()
    contents = read_journal(tmp_path / "j")
    assert contents.complete
    assert contents.stream("a")["time_ns"].tolist() == [1, 2]


def test_a_journal_that_cannot_even_be_begun_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    opened = os.fdopen
    monkeypatch.setattr("haptics.recording.journal.os.fdopen", lambda *args, **kwargs: FullDisk(opened(*args, **kwargs)))
    with pytest.raises(HapticsError, match="no space left"):
        Journal.create(tmp_path / "j", {})
    assert not list(tmp_path.iterdir())


def test_bad_declarations_are_refused(tmp_path: Path):
    with Journal.create(tmp_path / "j", {}) as journal:
        journal.stream("a", ROW)
        with pytest.raises(InputError, match="twice"):
            journal.stream("a", ROW)
        for name in ("A", "a/b", "", "provenance"):
            with pytest.raises(InputError, match="stream name"):
                journal.stream(name, ROW)
        for dtype in (
            [("value", "<f4")],
            [("time_ns", "<i4")],
            [("time_ns", "<i8"), ("x", "O")],
            [("time_ns", "<i8"), ("x", "U4")],
        ):
            with pytest.raises(InputError, match="stream b"):
                journal.stream("b", np.dtype(dtype))
        with pytest.raises(InputError, match="units for speed"):
            journal.stream("b", ROW, {"speed": "m/s"})
        with pytest.raises(InputError, match="attachment name"):
            journal.blob("../plan", b"")
        journal.blob("plan", b"")
        with pytest.raises(InputError, match="twice"):
            journal.blob("plan", b"")
    with pytest.raises(InputError, match="plain JSON"):
        Journal.create(tmp_path / "k", {"limit": float("inf")})
    assert not (tmp_path / "k").exists()
    with pytest.raises(InputError, match="no folder"):
        Journal.create(tmp_path / "missing" / "j", {})


def test_a_full_disk_loses_no_buffered_row_and_leaves_the_file_whole(tmp_path: Path):
    class Full:
        """A file that takes a few bytes and then has no room, once."""

        def __init__(self, file):
            self.file, self.calls = file, 0

        def write(self, data):
            self.calls += 1
            if self.calls == 2:
                raise OSError(errno.ENOSPC, "no space left on device")
            return self.file.write(data[:7] if self.calls == 1 else data)

        def __getattr__(self, name):
            return getattr(self.file, name)

    journal = Journal.create(tmp_path / "j", {})
    stream = journal.stream("a", ROW)
    journal._file = Full(journal._file)  # type: ignore[assignment]
    stream.append((4, 0.0, "", b""))
    with pytest.raises(HapticsError, match="no space left"):
        journal.commit()
    assert read_journal(tmp_path / "j").damage is None
    assert journal.commit() == 1
    journal.close()
    assert read_journal(tmp_path / "j").stream("a")["time_ns"].tolist() == [4]


def test_a_closed_journal_takes_nothing(tmp_path: Path):
    journal = Journal.create(tmp_path / "j", {})
    journal.close()
    journal.close()
    with pytest.raises(HapticsError, match="closed"):
        journal.blob("late", b"")


def test_leaving_by_an_error_keeps_the_rows_but_is_not_complete(tmp_path: Path):
    def run():
        with Journal.create(tmp_path / "j", {}) as journal:
            journal.stream("a", ROW).append((1, 0.0, "", b""))
            raise RuntimeError("port lost")

    with pytest.raises(RuntimeError, match="port lost"):
        run()
    contents = read_journal(tmp_path / "j")
    assert len(contents.stream("a")) == 1
    assert not contents.complete
    assert contents.damage is None


def test_a_segment_costs_its_head_and_its_rows(tmp_path: Path):
    journal = Journal.create(tmp_path / "j", {})
    stream = journal.stream("a", ROW)
    before = (tmp_path / "j").stat().st_size
    for step in range(100):
        stream.append((step, 0.0, "", b""))
    journal.commit()
    assert (tmp_path / "j").stat().st_size - before == HEAD_BYTES + 100 * ROW.itemsize
    assert journal.commit(fsync=True) == 0
    journal.close()


def test_what_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_journal(tmp_path / "none")
    small_journal(tmp_path / "j")
    with pytest.raises(InputError, match="no stream 'b'; it has a"):
        read_journal(tmp_path / "j").stream("b")
    with pytest.raises(InputError, match=r"no attachment 'b'; it has plan.json"):
        read_journal(tmp_path / "j").blob("b")
