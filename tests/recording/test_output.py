"""Outputs are looked at before anything is opened: each its own file, in a place that can be written, over nothing unasked."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from recorded_session import record_session

from haptics.errors import HapticsError, InputError
from haptics.recording import finalise, load
from haptics.recording.leftovers import journal_of, leftovers, refuse_leftover
from haptics.recording.output import check_outputs, make_folder, replacing


def test_outputs_that_are_free_leave_nothing_behind(tmp_path: Path):
    check_outputs({"out": tmp_path / "r.h5", "picture": tmp_path / "r.png", "rrd": None}, force=False)
    assert not list(tmp_path.iterdir())


def test_one_file_by_two_names_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    out, folder = tmp_path / "r.h5", tmp_path / "here"
    folder.symlink_to(tmp_path, target_is_directory=True)
    out.write_text("mine")
    (tmp_path / "soft.h5").symlink_to(out)
    os.link(out, tmp_path / "hard.h5")
    (tmp_path / "dangling.h5").symlink_to(tmp_path / "later.h5")
    monkeypatch.chdir(tmp_path)
    names = [out, Path("r.h5"), Path("./here/r.h5"), folder / "r.h5", tmp_path / "soft.h5", tmp_path / "hard.h5"]
    pairs = [(out, name) for name in names] + [(tmp_path / "later.h5", tmp_path / "dangling.h5")]
    for one, other in pairs:
        with pytest.raises(InputError, match=r"out = .* and picture = .* are the same file"):
            check_outputs({"out": one, "picture": other}, force=True)
        with pytest.raises(InputError, match=r"out = .* is the file read as hand"):
            check_outputs({"out": one}, True, {"hand": other})
    assert out.read_text() == "mine"


def test_what_cannot_be_written_is_refused(tmp_path: Path):
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for path, words in (
        (tmp_path / "missing" / "r.h5", "there is no folder"),
        (taken / "r.h5", "there is no folder"),
        (tmp_path, "is a folder"),
        (taken, "exists and is not overwritten"),
        (tmp_path / ("x" * 300), "too long"),
    ):
        with pytest.raises(InputError, match=words):
            check_outputs({"out": path}, force=False)
    pipe = tmp_path / "pipe"
    if hasattr(os, "mkfifo"):
        os.mkfifo(pipe)
        with pytest.raises(InputError, match="is a device or a pipe"):
            check_outputs({"out": pipe}, force=True)


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder in which even root can make no file")
def test_a_place_where_no_file_can_be_made_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"/proc/self/r\.h5 cannot be written"):
        check_outputs({"out": Path("/proc/self/r.h5")}, force=False)
    with pytest.raises(HapticsError, match=r"/proc/self/r\.h5 cannot be written"), replacing(Path("/proc/self/r.h5"), False):
        pass


def test_a_folder_that_vanishes_while_a_file_is_written_is_an_error(tmp_path: Path):
    folder = tmp_path / "stick"
    folder.mkdir()
    with pytest.raises(HapticsError, match=r"r\.h5 cannot be written"), replacing(folder / "r.h5", False) as partial:  # noqa: PT012
        partial.unlink()
        folder.rmdir()


def test_a_journal_that_holds_anything_is_named_with_what_saves_it_and_never_overwritten(tmp_path: Path):
    journal = record_session(journal_of(tmp_path / "r.h5"))
    before = journal.read_bytes()
    for force in (False, True):
        with pytest.raises(InputError, match=f"not overwritten, not even with --force.*haptics recording recover {journal}"):
            refuse_leftover(journal, force)
    assert leftovers(tmp_path) == [journal]
    assert journal.read_bytes() == before
    finalise(journal, tmp_path / "r.h5")
    refuse_leftover(journal, force=False)
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize(
    ("content", "forced"), [(b"", True), (b"haptics jour", True), (b"haptics journal 1\nSEG", True), (b"x", False)]
)
def test_what_holds_nothing_may_go_by_force_and_what_is_another_program_s_may_not(tmp_path: Path, content: bytes, forced: bool):
    path = tmp_path / "r.journal"
    path.write_bytes(content)
    with pytest.raises(InputError, match="exists"):
        refuse_leftover(path, force=False)
    if forced:
        refuse_leftover(path, force=True)
    else:
        with pytest.raises(InputError, match="is not a journal"):
            refuse_leftover(path, force=True)


LIMITED = """
import resource, sys
from haptics.errors import HapticsError
from haptics.recording import finalise
for size in range(0, int(sys.argv[3]), int(sys.argv[4])):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    try:
        finalise(sys.argv[1], sys.argv[2], keep_journal=True)
    except HapticsError as error:
        assert "r.h5 cannot be written" in str(error) and "the journal" in str(error), error
    else:
        raise SystemExit(f"written in {size} bytes")
"""


@pytest.mark.slow
def test_a_disk_that_is_full_at_any_byte_is_an_error_and_leaves_the_journal(tmp_path: Path):
    pytest.importorskip("resource", reason="limits are POSIX")
    journal = record_session(tmp_path / "j")
    size = finalise(journal, tmp_path / "whole.h5", keep_journal=True).path.stat().st_size
    command = [sys.executable, "-c", LIMITED, str(journal), str(tmp_path / "r.h5"), str(size), str(size // 30)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")  # no crash at the end of the process either
    assert sorted(path.name for path in tmp_path.iterdir()) == ["j", "whole.h5"]
    assert load(finalise(journal, tmp_path / "r.h5").path).complete


@pytest.mark.parametrize("name", ["", ".", "/"])
def test_a_recording_without_a_name_is_refused(name):
    with pytest.raises(InputError, match="is a folder; expected a file name"):
        journal_of(Path(name))


def test_a_file_that_came_up_while_another_was_written_in_its_place_is_kept(tmp_path: Path):
    out = tmp_path / "r.h5"
    writing = replacing(out, force=False)
    writing.__enter__().write_text("ours")
    out.write_text("theirs")
    with pytest.raises(InputError, match="exists and is not overwritten"):
        writing.__exit__(None, None, None)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["theirs"]


def test_what_takes_a_file_s_place_is_on_the_disk_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    steps: list[str] = []
    monkeypatch.setattr(os, "fsync", lambda _: steps.append("fsync"))
    monkeypatch.setattr(Path, "replace", lambda *_: steps.append("replace"))
    with replacing(tmp_path / "r.h5", force=False) as partial:
        partial.write_text("ours")
    assert steps == ["fsync", "replace"]


def test_a_folder_is_made_and_those_above_it_are_not(tmp_path: Path):
    make_folder(tmp_path / "new")
    make_folder(tmp_path / "new")
    assert (tmp_path / "new").is_dir()
    with pytest.raises(InputError, match=r"out = .*a/b: there is no folder .*a; make it"):
        make_folder(tmp_path / "a" / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    for option in ("picture", "rrd"):
        with pytest.raises(InputError, match=rf"{option} = .*: there is no folder"):
            check_outputs({option: tmp_path / "a" / "x.png"}, force=True)
