"""Nothing damaged is used: a file is as it was written, or it is refused with the place."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from recorded_session import record_session

from haptics.errors import InputError
from haptics.recording import Journal, JournalContents, Recording, finalise, load, read_journal, recover
from haptics.recording.condition import condition_of
from haptics.recording.leftovers import refuse_leftover
from haptics.recording.seal import check_seal, seal
from haptics.recording.segments import HEAD_BYTES, MAGIC, Kind, pack
from haptics.recording.views import view_data


def everything(recording: Recording) -> dict[str, Any]:
    parts: dict[str, Any] = {name: recording.stream(name).tobytes() for name in recording.streams}
    parts |= {name: recording.blob(name) for name in recording.blobs}
    return parts | {"header": recording.header, "footer": recording.footer, "complete": recording.complete}


def flipped(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def unsealed(path: Path, out: Path) -> Path:
    """The recording as the first layout had it: no seal, and ``haptics_schema`` 1."""
    out.write_bytes(path.read_bytes())
    with h5py.File(out, "r+") as file:  # HDF5 cuts off what it does not know
        file.attrs["haptics_schema"] = 1
    assert check_seal(out) is None
    return out


def forged(path: Path, out: Path, change: Any) -> Path:
    """The recording with a change in it, and a seal that states it is whole."""
    out.write_bytes(path.read_bytes())
    with h5py.File(out, "r+") as file:
        change(file)
    seal(out)
    return out


def every_flip_is_refused(recording: Recording, folder: Path, flips: int, seed: int) -> None:
    rng, whole = random.Random(seed), recording.path.read_bytes()
    path = folder / "flipped.h5"
    for _ in range(flips):
        path.write_bytes(flipped(whole, rng.randrange(8 * len(whole))))
        with pytest.raises(InputError, match=r"flipped\.h5"):
            load(path)
        try:
            assert condition_of(path).damaged
        except InputError as error:  # the seal itself was hit
            assert "seal" in str(error)  # noqa: PT017


def test_a_flipped_bit_anywhere_is_seen(recording: Recording, tmp_path: Path):
    every_flip_is_refused(recording, tmp_path, flips=60, seed=1)


@pytest.mark.soak
def test_two_thousand_flipped_bits_are_seen(recording: Recording, tmp_path: Path):
    every_flip_is_refused(recording, tmp_path, flips=2000, seed=2)


def of_the_first_layout(recording: Recording, folder: Path, flips: int, seed: int) -> None:
    rng, old = random.Random(seed), unsealed(recording.path, folder / "old.h5")
    whole, path = old.read_bytes(), folder / "flipped.h5"
    for _ in range(flips):
        path.write_bytes(flipped(whole, rng.randrange(8 * len(whole))))
        try:
            found = load(path)
            everything(found)
        except InputError as error:
            assert "flipped.h5" in str(error)  # noqa: PT017
        else:
            assert not found.verified


def test_a_recording_of_the_first_layout_opens_with_a_word_about_it_and_is_never_more_than_refused(recording, tmp_path):
    old = load(unsealed(recording.path, tmp_path / "old.h5"))
    assert old.schema == 1
    assert not old.verified
    assert any("unverified: written without checksums" in note for note in old.notes)
    assert everything(old) == everything(recording)
    assert recording.verified
    assert recording.notes == ()
    of_the_first_layout(recording, tmp_path, flips=25, seed=3)


@pytest.mark.soak
def test_two_hundred_flipped_bits_of_the_first_layout(recording: Recording, tmp_path: Path):
    of_the_first_layout(recording, tmp_path, flips=200, seed=4)


def place_of(path: Path, name: str) -> int:
    """A byte of a dataset's values."""
    with h5py.File(path) as file:
        dataset = file[name]
        return dataset.id.get_offset() if dataset.chunks is None else dataset.id.get_chunk_info(0).byte_offset


@pytest.mark.parametrize("name", ["entry/ticks/volts", "entry/events/kind", "entry/attachments/glove.toml", "entry/title"])
def test_the_damaged_part_is_named(recording: Recording, tmp_path: Path, name: str):
    path = tmp_path / "r.h5"
    path.write_bytes(flipped(recording.path.read_bytes(), 8 * place_of(recording.path, name) + 3))
    with pytest.raises(InputError, match=f"r.h5 is damaged.*{name}"):
        load(path)
    found = condition_of(path)
    assert (found.damaged, found.complete, found.verified) == ([name], False, False)


def test_a_file_cut_or_grown_is_not_what_was_written(recording: Recording, tmp_path: Path):
    path, whole = tmp_path / "r.h5", recording.path.read_bytes()
    for changed in (whole[:-1], whole[:-100], whole[:-5000], whole + b"\n", whole + whole[-200:]):
        path.write_bytes(changed)
        with pytest.raises(InputError, match=r"r\.h5"):
            load(path)


def test_what_changes_after_it_was_opened_is_not_read_on(recording: Recording, tmp_path: Path):
    path = tmp_path / "r.h5"
    path.write_bytes(recording.path.read_bytes())
    opened = load(path)
    other = record_session(tmp_path / "j", {"seed": 8})
    finalise(other, path, force=True)
    with pytest.raises(InputError, match="was changed after it was opened"):
        opened.stream("ticks")
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        opened.blob("glove.toml")


def cut_column(file: Any) -> None:
    file["entry/ticks/volts"].resize(7, axis=0)


def external_link(file: Any) -> None:
    del file["entry/ticks"]
    file["entry/ticks"] = h5py.ExternalLink("/etc/hostname", "/entry/ticks")


def soft_link(file: Any) -> None:
    file["entry/more"] = h5py.SoftLink("/entry/ticks")


def linked_column(file: Any) -> None:
    del file["entry/ticks/volts"]
    file["entry/ticks/volts"] = h5py.ExternalLink("other.h5", "/x")


def raw_data_elsewhere(file: Any) -> None:
    rows = file["entry/events/time_ns"].shape[0]
    del file["entry/events/time_ns"]
    file["entry/events"].create_dataset("time_ns", (rows,), "<i8", external=[("/etc/passwd", 0, rows * 8)])


def attachment_elsewhere(file: Any) -> None:
    file["entry/attachments"].create_dataset("secret", (10,), "u1", external=[("/etc/passwd", 0, 10)])


def virtual_column(file: Any) -> None:
    rows = file["entry/events/time_ns"].shape[0]
    del file["entry/events/time_ns"]
    layout = h5py.VirtualLayout((rows,), "<i8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (rows,))
    file["entry/events"].create_virtual_dataset("time_ns", layout)


def foreign_filter(file: Any) -> None:
    file["entry/attachments"].create_dataset("packed", data=np.zeros(100, "u1"), compression="lzf")


def absurd_size(file: Any) -> None:
    for column in file["entry/ticks"].values():
        column.resize(1 << 40, axis=0)


def header_is(text: Any) -> Any:
    def change(file: Any) -> None:
        del file["entry/provenance/header"]
        file["entry/provenance/header"] = text

    return change


def attribute_is(place: str, name: str, value: Any) -> Any:
    return lambda file: file[place].attrs.__setitem__(name, value)


def compound_column(file: Any) -> None:
    file["entry/ticks/x"] = np.zeros(300, [("a", "i4"), ("b", "f4")])


def unwritten_chunks(file: Any) -> None:
    file["entry/ticks"].create_dataset("x", (300,), "f4", chunks=(100,))[:100] = 1.0


def text_elsewhere(file: Any) -> None:
    file["entry/attachments/words"] = ["a", "b"]  # kept as pointers


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (compound_column, "/entry/ticks is not a stream: x has type"),
        (unwritten_chunks, "/entry/ticks/x: some of its values were never written"),
        (text_elsewhere, "/entry/attachments/words has type object"),
        (cut_column, "/entry/ticks: its columns differ in length: .*volts 7"),
        (external_link, "/entry/ticks is a link to /etc/hostname"),
        (soft_link, "/entry/more is a link"),
        (linked_column, "/entry/ticks/volts is a link to other.h5"),
        (raw_data_elsewhere, "/entry/events/time_ns keeps its values in another file"),
        (attachment_elsewhere, "/entry/attachments/secret keeps its values in another file"),
        (virtual_column, "/entry/events/time_ns keeps its values in another file"),
        (foreign_filter, "/entry/attachments/packed is packed by filter 32000; only gzip"),
        (absurd_size, "/entry/ticks/.* claims to hold .* bytes"),
        (header_is("[1, 2]"), "/entry/provenance/header is not a JSON object"),
        (header_is("{"), "/entry/provenance/header is not JSON"),
        (header_is("[" * 100_000), "/entry/provenance/header is not JSON"),
        (header_is(7), "/entry/provenance/header is not text"),
        (header_is(b"\xff\xfe"), "/entry/provenance/header cannot be read"),
        (lambda file: file.__delitem__("entry/provenance/header"), "/entry/provenance/header is missing"),
        (lambda file: file.__delitem__("entry/ticks/time_ns"), None),
        (lambda file: file.__delitem__("entry/attachments"), "/entry/attachments is missing"),
        (lambda file: file.__delitem__("entry"), "/entry is missing"),
        (attribute_is("entry", "complete", "yes"), "/entry: attribute complete = 'yes' is of the wrong type"),
        (attribute_is("entry", "lost_bytes", 0.5), "attribute lost_bytes = .*0.5.* is of the wrong type"),
        (attribute_is("entry", "damage", 3), "attribute damage"),
        (attribute_is("entry/ticks/volts", "units", 3), "attribute units"),
        (attribute_is("entry/ticks", "description", 3), "attribute description"),
        (lambda file: file["entry/ticks"].create_dataset("X", data=np.zeros(300)), "/entry/ticks is not a stream"),
        (lambda file: file["entry/ticks"].create_dataset("x", data=["a"] * 300), "/entry/ticks is not a stream"),
        (lambda file: file["entry/ticks"].create_group("x"), "/entry/ticks/x is not a dataset"),
    ],
)
def test_what_is_not_laid_out_as_it_should_be_is_refused_with_the_place(recording, tmp_path, change, words):
    path = forged(recording.path, tmp_path / "r.h5", change)
    if words is None:  # a group without times is not a stream, and is left alone
        assert "ticks" not in load(path).streams
        return
    with pytest.raises(InputError, match=words) as refused:
        everything(load(path))
    assert "r.h5" in str(refused.value)


@pytest.mark.parametrize(
    ("place", "values"),
    [
        ("ticks/rise_k", np.full((300, 15), b"abc")),
        ("ticks/volts", np.zeros((300, 2, 2))),
    ],
)
def test_a_view_refuses_a_field_of_another_type(recording, tmp_path, place, values):
    def change(file: Any) -> None:
        del file[f"entry/{place}"]
        file[f"entry/{place}"] = values

    name = place.rpartition("/")[2]
    with pytest.raises(InputError, match=rf"r\.h5: field {name} of stream ticks has type .*; expected "):
        view_data.rows(load(forged(recording.path, tmp_path / "r.h5", change)), "ticks", ())


@pytest.mark.parametrize(
    "wrong",
    [
        {"names": 5},
        {"names": [1]},
        {"weights": [[1.0]]},
        {"weights": "x"},
        {"offset_joint": [99]},
        {"offset_joint": [0.5]},
        {"offset_m": [[1e300, 0, 0]]},
    ],
)
def test_a_view_refuses_sites_that_are_none(recording, tmp_path, wrong):
    sites = {"names": ["a"], "weights": [[0.0] * 26], "offset_joint": [3], "offset_m": [[0.0] * 3]}
    path = forged(recording.path, tmp_path / "r.h5", header_is(json.dumps({"sites": {**sites, **wrong}})))
    with pytest.raises(InputError, match=r"r\.h5: the header's sites cannot be drawn"):
        view_data.sites_of(load(path))


def journal_of(segments: list[tuple[Kind, bytes]]) -> bytes:
    return MAGIC + b"".join(bytes(part) for index, (kind, data) in enumerate(segments) for part in pack(kind, 0, index, data))


STREAM = {"name": "ticks", "fields": [["time_ns", "<i8", []]], "units": {}, "description": ""}


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        *((Kind.STREAM, {**STREAM, "units": {"time_ns": unit}}) for unit in (5, None, [], "\ud800", "a\0b", "x" * 70_000)),
        *((Kind.STREAM, {**STREAM, "description": words}) for words in (5, None, {}, "\ud800", "a\0b", "x" * 70_000)),
        (Kind.STREAM, {**STREAM, "fields": [*STREAM["fields"], ["v", "<f4", [1] * 40]]}),
        *((Kind.BLOB, name) for name in (b"", b".", b"..", b"a/b", b"/entry", b"\0", b"a", b"x" * 300)),
    ],
)
def test_a_forged_segment_ends_what_is_used_of_a_journal(tmp_path, kind, data):
    payload = json.dumps(data).encode() if isinstance(data, dict) else len(data).to_bytes(2, "little") + data + b"forged"
    header, attached = (Kind.HEADER, b"{}"), (Kind.BLOB, b"\1\0agood")
    path = tmp_path / "r.journal"
    path.write_bytes(journal_of([header, attached, (kind, payload), (Kind.FOOTER, b"{}")]))
    made = recover(path, tmp_path / "r.h5")
    assert made.journal_kept
    assert "makes no sense" in made.damage
    assert load(made.path).blob("a") == b"good"


@pytest.mark.parametrize(
    "header",
    [
        {"default_plot": {"stream": []}},
        {"default_plot": 5},
        {"hand": "\udcff.json", "title": "\udcff"},
        {"\ud800": 1},
        {"k" * 70_000: 1},
        {f"k{index}": "x" * 900 for index in range(100)},
    ],
)
def test_whatever_a_header_holds_is_recorded(tmp_path, header):
    with Journal.create(tmp_path / "r.journal", header) as journal:
        journal.close()
    finalise(journal.path, tmp_path / "r.h5")
    assert load(tmp_path / "r.h5").header == header


def test_a_journal_whose_start_is_damaged_is_not_overwritten(tmp_path):
    path = record_session(tmp_path / "r.journal")
    whole = path.read_bytes()
    for at in (len(MAGIC) + 12, len(MAGIC) + 15, len(MAGIC) + HEAD_BYTES + 5):  # the header's length, and its text
        path.write_bytes(flipped(whole, 8 * at))
        with pytest.raises(InputError, match="is not overwritten, not even with --force"):
            refuse_leftover(path, force=True)
        with pytest.raises(InputError, match="its start is damaged"):
            recover(path, tmp_path / "r.h5")
    path.write_bytes(whole[: len(MAGIC) + 20])  # its writer died over it
    refuse_leftover(path, force=True)


def rows_of(contents: JournalContents) -> dict[str, bytes]:
    return {name: contents.stream(name).tobytes() for name in contents.streams}


def journals_hold_no_wrong_row(folder: Path, flips: int, seed: int) -> None:
    rng, path = random.Random(seed), record_session(folder / "whole.journal")
    whole, kept = path.read_bytes(), rows_of(read_journal(path))
    damaged = folder / "damaged.journal"
    for turn in range(flips):
        changed = flipped(whole, rng.randrange(8 * len(whole))) if turn % 2 else whole[: rng.randrange(len(whole))]
        damaged.write_bytes(changed)
        try:
            contents = read_journal(damaged)
            assert not contents.complete
            for name, rows in rows_of(contents).items():
                assert kept[name].startswith(rows)
            assert contents.header is None or contents.header == read_journal(path).header
            found = condition_of(damaged)
            assert found.damaged
            assert found.lost_bytes == contents.dropped_bytes
            recover(damaged, folder / "recovered.h5", force=True)
            assert not load(folder / "recovered.h5").complete
        except InputError as error:  # the first line was hit, or nothing is left
            assert "damaged.journal" in str(error)  # noqa: PT017


def test_a_damaged_journal_gives_no_wrong_row(tmp_path: Path):
    journals_hold_no_wrong_row(tmp_path, flips=30, seed=5)


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_four_hundred_damaged_journals(tmp_path: Path):
    journals_hold_no_wrong_row(tmp_path, flips=400, seed=6)


def test_the_condition_of_a_recording_and_of_a_journal(recording: Recording, tmp_path: Path):
    whole = condition_of(recording.path)
    assert (whole.kind, whole.complete, whole.verified, whole.damaged, whole.lost_bytes) == ("recording", True, True, [], 0)
    assert whole.rows == {name: len(recording.stream(name)) for name in recording.streams}
    path = record_session(tmp_path / "s.journal")
    left = condition_of(path)
    assert (left.kind, left.complete, left.damaged) == ("journal", True, [])
    assert f"haptics recording recover {path}" in left.notes[0]
    path.write_bytes(path.read_bytes()[:-3])
    cut = condition_of(path)
    assert (cut.complete, cut.ended) == (False, "the session did not end well")
    assert cut.lost_bytes > 0
    assert "the file ends inside" in cut.damaged[0]
    recover(path, tmp_path / "s.h5")
    found = condition_of(tmp_path / "s.h5")
    assert (found.complete, found.damaged, found.lost_bytes) == (False, [], cut.lost_bytes)
    assert "the file ends inside" in found.ended
