"""The archive: what went in comes out, other programs can read it, and no file looks whole that is not."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from recorded_session import record_session

from haptics.errors import HapticsError, InputError
from haptics.recording import Journal, Recording, finalise, hdf5, load, read_journal, recover
from haptics.recording.condition import condition_of
from haptics.recording.seal import seal
from haptics.recording.segments import MAGIC

KINDS = st.sampled_from(["<i8", "<u2", "i1", "u1", "<f4", "<f8", "?", "S5", "V6"])
FIELDS = st.lists(st.tuples(KINDS, st.sampled_from([(), (3,), (2, 4)])), max_size=4)


@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(fields=FIELDS, blob=st.binary(max_size=40), data=st.data())
def test_any_rows_come_back_bit_for_bit(tmp_path_factory, fields, blob, data):
    dtype = np.dtype([("time_ns", "<i8"), *((f"f{place}", kind, shape) for place, (kind, shape) in enumerate(fields))])
    count = data.draw(st.integers(0, 7))
    rows = np.zeros(count, dtype)
    for name in dtype.names or ():
        base = dtype[name].base
        size = rows[name].size * base.itemsize
        raw = data.draw(st.binary(min_size=size, max_size=size))
        # a boolean has two values only; any other bits are a number's or a text's
        values = np.frombuffer(raw, np.uint8) % 2 if base.kind == "b" else np.frombuffer(raw, base)
        rows[name] = values.astype(base).reshape(rows[name].shape)
    folder = tmp_path_factory.mktemp("any")
    journal = Journal.create(folder / "j", {"text": "Prüfung\n"}, rows_per_segment=3)
    journal.stream("s", dtype, {"time_ns": "ns"}, "anything").extend(rows)
    journal.blob("blob", blob)
    journal.close({"end": [1, 2.5, None]})
    finalise(folder / "j", folder / "r.h5")
    recording = load(folder / "r.h5")
    assert recording.stream("s").dtype == dtype
    assert recording.stream("s").tobytes() == rows.tobytes()
    assert recording.blob("blob") == blob
    assert recording.header == {"text": "Prüfung\n"}
    assert recording.footer == {"end": [1, 2.5, None]}
    assert recording.streams["s"].description == "anything"


def test_a_recording_lists_what_it_holds(recording: Recording):
    assert recording.complete
    assert recording.schema == hdf5.SCHEMA
    assert list(recording.streams) == ["poses", "ticks", "requests", "events"]
    assert recording.streams["ticks"].units == {"time_ns": "ns", "rise_k": "K", "volts": "V", "force_n": "N"}
    assert recording.blobs == ("glove.toml",)
    assert recording.footer == {"contacts": 6}
    assert "ticks" in recording
    assert "bytes" not in recording
    with pytest.raises(InputError, match="no stream 'bytes'; it has poses, ticks"):
        recording.stream("bytes")
    with pytest.raises(InputError, match=r"no attachment 'x'; it has glove.toml"):
        recording.blob("x")
    with pytest.raises(ValueError, match="read-only"):
        recording.stream("ticks")["volts"][0] = 1.0


def test_the_default_chain_leads_to_a_signal_with_axes(recording: Recording):
    with h5py.File(recording.path) as file:
        assert file.attrs["NX_class"] == "NXroot"
        entry = file[file.attrs["default"]]
        assert entry.attrs["NX_class"] == "NXentry"
        data = entry[entry.attrs["default"]]
        assert data.attrs["NX_class"] == "NXdata"
        assert data.name == "/entry/ticks"
        signal = data[data.attrs["signal"]]
        assert signal.name == "/entry/ticks/rise_k"
        assert signal.dtype.kind == "f"
        axes = list(data.attrs["axes"])
        assert axes == ["time_ns", "."]
        assert len(axes) == signal.ndim
        assert data["time_ns"].shape == signal.shape[:1]
        assert data.attrs["time_ns_indices"] == 0
        assert data["time_ns"].attrs["units"] == "ns"
        assert signal.attrs["units"] == "K"


def test_every_group_is_a_nexus_class_and_every_column_is_compressed_and_of_fixed_length(recording: Recording):
    with h5py.File(recording.path) as file:
        entry = file["entry"]
        classes = {name: group.attrs["NX_class"] for name, group in entry.items() if isinstance(group, h5py.Group)}
        assert classes == {
            "provenance": "NXcollection",
            "attachments": "NXcollection",
            "poses": "NXdata",
            "ticks": "NXdata",
            "requests": "NXcollection",
            "events": "NXcollection",
        }
        for stream in recording.streams:
            assert next(iter(entry[stream])) == "time_ns"
            for column in entry[stream].values():
                assert (column.compression, column.compression_opts, column.shuffle) == ("gzip", 1, True)
                assert column.dtype.kind != "O"
                assert h5py.h5g.get_objinfo(column.id).mtime == 0  # or the bytes would depend on the clock
        assert tuple(h5py.check_string_dtype(entry["events/kind"].dtype)) == ("utf-8", 20)
        assert entry["provenance"].attrs["seed"] == 7
        assert entry["title"].asstr()[()] == "hand on a ball"


@pytest.mark.parametrize("wanted", [None, {"stream": "gone", "signal": "x"}, {"stream": "events", "signal": "kind"}, "ticks"])
def test_without_a_usable_default_the_first_float_is_plotted(tmp_path: Path, wanted):
    finalise(record_session(tmp_path / "j", {"default_plot": wanted}), tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["entry"].attrs["default"] == "poses"
        assert file["entry/poses"].attrs["signal"] == "position_m"


def test_an_integer_can_be_the_default_plot(tmp_path: Path):
    finalise(record_session(tmp_path / "j", {"default_plot": {"stream": "requests", "signal": "played"}}), tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["entry"].attrs["default"] == "requests"
        assert file["entry/requests"].attrs["signal"] == "played"


def test_an_empty_session_is_a_recording_too(tmp_path: Path):
    journal = Journal.create(tmp_path / "j", {})
    journal.stream("ticks", np.dtype([("time_ns", "<i8"), ("volts", "<f4", (5,))]))
    journal.close()
    finalise(tmp_path / "j", tmp_path / "r.h5")
    assert load(tmp_path / "r.h5").stream("ticks").shape == (0,)


def test_same_journal_same_bytes(tmp_path: Path):
    # the clock is moved by another process's start, not by waiting
    code = "import sys; from haptics.recording import finalise; finalise(sys.argv[1], sys.argv[2], keep_journal=True)"
    record_session(tmp_path / "j")
    for name in ("one", "two"):
        subprocess.run([sys.executable, "-c", code, tmp_path / "j", tmp_path / name], check=True)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_commits_leave_no_trace_in_the_recording(tmp_path: Path):
    for name, rows in (("one", 3), ("two", 100)):
        journal = Journal.create(tmp_path / f"{name}.journal", {}, rows_per_segment=rows)
        stream = journal.stream("a", np.dtype([("time_ns", "<i8")]))
        for step in range(250):
            stream.append((step,))
        journal.close()
        finalise(tmp_path / f"{name}.journal", tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_the_journal_goes_when_the_recording_is_there(tmp_path: Path):
    result = finalise(record_session(tmp_path / "j"), tmp_path / "r.h5")
    assert result.complete
    assert result.rows == {"poses": 300, "ticks": 300, "requests": 13, "events": 14 - 1}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.h5"]
    record_session(tmp_path / "j")
    assert finalise(tmp_path / "j", tmp_path / "s.h5", keep_journal=True).journal_kept
    assert (tmp_path / "j").exists()


def test_nothing_is_overwritten_unasked(tmp_path: Path):
    record_session(tmp_path / "j")
    (tmp_path / "r.h5").write_text("mine")
    with pytest.raises(InputError, match="--force"):
        finalise(tmp_path / "j", tmp_path / "r.h5")
    assert (tmp_path / "r.h5").read_text() == "mine"
    assert (tmp_path / "j").exists()
    with pytest.raises(InputError, match="journal itself"):
        finalise(tmp_path / "j", tmp_path / "j", force=True)
    with pytest.raises(InputError, match="no folder"):
        finalise(tmp_path / "j", tmp_path / "missing" / "r.h5")
    finalise(tmp_path / "j", tmp_path / "r.h5", force=True)
    assert load(tmp_path / "r.h5").complete


def test_a_failure_half_way_leaves_the_journal_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    record_session(tmp_path / "j")
    original = hdf5._write_stream

    def fail_at_events(entry, contents, spec, signal):
        if spec.name == "events":
            raise OSError("no space left on device")
        original(entry, contents, spec, signal)

    monkeypatch.setattr(hdf5, "_write_stream", fail_at_events)
    with pytest.raises(HapticsError, match="no space left"):
        finalise(tmp_path / "j", tmp_path / "r.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["j"]
    assert read_journal(tmp_path / "j").complete


def test_a_damaged_journal_is_recovered_up_to_the_damage_and_kept(tmp_path: Path):
    path = record_session(tmp_path / "j")
    with path.open("r+b") as file:
        file.seek(-3, 2)
        file.truncate()
    result = recover(path, tmp_path / "r.h5")
    recording = load(tmp_path / "r.h5")
    assert not result.complete
    assert result.lost_bytes == recording.lost_bytes > 0
    assert recording.damage == result.damage
    assert "payload" in recording.damage
    assert len(recording.stream("ticks")) == 300
    assert path.exists()


def test_a_journal_that_was_closed_recovers_as_complete(tmp_path: Path):
    result = recover(record_session(tmp_path / "j"), tmp_path / "r.h5")
    assert result.complete
    assert not result.journal_kept
    assert load(tmp_path / "r.h5").complete


def test_there_must_be_something_to_recover(tmp_path: Path):
    (tmp_path / "empty").write_bytes(MAGIC + b"torn")
    with pytest.raises(InputError, match="nothing to recover"):
        recover(tmp_path / "empty", tmp_path / "r.h5")
    (tmp_path / "other").write_bytes(b"{}")
    with pytest.raises(InputError, match="byte 0 differs"):
        recover(tmp_path / "other", tmp_path / "r.h5")


def test_a_journal_being_written_is_not_recovered(tmp_path: Path):
    pytest.importorskip("fcntl", reason="file locks are POSIX")
    with Journal.create(tmp_path / "j", {}), pytest.raises(InputError, match="still writing"):
        recover(tmp_path / "j", tmp_path / "r.h5")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda file: file.attrs.__setitem__("haptics_schema", 99), "reads layouts 1 to 2: open it with a later one"),
        (lambda file: file.attrs.__setitem__("haptics_schema", 0), "haptics_schema = .*0.*; expected a layout"),
        (lambda file: file.attrs.__delitem__("haptics_schema"), "not a finished haptics recording"),
        (lambda file: file.__delitem__("entry/provenance"), "/entry/provenance is missing"),
    ],
)
def test_what_is_no_recording_of_this_version_says_what_to_do(tmp_path: Path, change, message: str):
    finalise(record_session(tmp_path / "j"), tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        change(file)
    seal(tmp_path / "r.h5")
    with pytest.raises(InputError, match=message):
        load(tmp_path / "r.h5")


def test_what_is_no_hdf5_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        load(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(InputError, match=r"text\.h5 is not an HDF5 file"):
        load(tmp_path / "text.h5")
    with pytest.raises(InputError, match="haptics recording recover"):
        load(record_session(tmp_path / "j"))


@pytest.mark.parametrize(
    ("opened", "expected"),
    [
        (condition_of, "a recording (.h5 or .journal)"),
        (load, "a recording (.h5)"),
        (read_journal, "a journal (.journal)"),
        (lambda path: recover(path, path / "r.h5"), "a journal (.journal)"),
    ],
)
def test_a_folder_is_called_a_folder(tmp_path: Path, opened: Callable[[Path], object], expected: str):
    with pytest.raises(InputError) as refused:
        opened(tmp_path)
    assert str(refused.value) == f"{tmp_path} is a folder; expected {expected}"


def test_a_recording_needs_no_recovery(recording: Recording, tmp_path: Path):
    with pytest.raises(InputError, match=r"session\.h5 is an HDF5 file; expected a journal \(\.journal\)"):
        recover(recording.path, tmp_path / "r.h5")


def test_a_recording_cut_anywhere_does_not_look_whole(tmp_path: Path, recording: Recording):
    whole = recording.path.read_bytes()
    for share in range(20):
        (tmp_path / "cut.h5").write_bytes(whole[: len(whole) * share // 20])
        with pytest.raises(InputError):
            load(tmp_path / "cut.h5")
