"""A full disk, a pipe that nobody reads, a folder that is gone: the glove goes off, one line says so, the journal is named."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from haptics.errors import HapticsError
from haptics.recording import Journal, finalise, load, read_journal
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene

pytestmark = [pytest.mark.skipif(sys.platform == "win32", reason="limits and pipes as POSIX has them"), pytest.mark.slow]

CHILD = Path(__file__).with_name("ended_command.py")
LIMITED = """
import resource, runpy, sys
size, sys.argv = int(sys.argv[1]), sys.argv[2:]
resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
runpy.run_path(sys.argv[0], run_name="__main__")
"""
HAPTICS = [sys.executable, "-m", "haptics.cli.main"]


def limited(size: int, *words: object) -> subprocess.CompletedProcess[str]:
    """A command none of whose files can grow beyond ``size`` bytes."""
    command = [sys.executable, "-c", LIMITED, str(size), str(CHILD), *map(str, words), "--", "never"]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "TICKS": "-1"})
    assert "Traceback" not in done.stderr, done.stderr
    assert not {"PINS ARE OUT", "VOLTS ARE UP", "IT IS ARMED"} & set(done.stdout.splitlines())
    return done


@pytest.mark.parametrize(("command", "size"), [("run", 30_000), ("run", 150_000), ("characterize", 30_000)])
def test_a_disk_that_fills_up_ends_the_session_off_and_names_the_journal(tmp_path: Path, command: str, size: int):
    if command == "run":
        out = tmp_path / "r.h5"
        done = limited(size, "run", "playground", "--out", out)
    else:
        out = tmp_path / "pull.h5"
        done = limited(size, "characterize", "pull", "--out", tmp_path)
    journal = out.with_suffix(".journal")
    assert done.returncode == 2
    assert "is off" in done.stdout
    assert f"{journal}: cannot write the journal: File too large" in done.stderr
    assert f"what was recorded is in the journal {journal}, incomplete" in done.stderr
    assert f"haptics recording recover {journal}" in done.stderr
    assert not out.exists()
    contents = read_journal(journal)
    assert contents.damage is None
    assert contents.count("wire") > 0
    saved = subprocess.run([*HAPTICS, "recording", "recover", journal], capture_output=True, text=True)
    assert saved.returncode == 0, saved.stderr
    assert len(load(out).stream("wire")) == contents.count("wire")


@pytest.mark.parametrize("end", ["asked", "by itself"])
def test_what_was_recorded_into_a_folder_that_was_removed_is_saved_elsewhere(tmp_path: Path, end: str, monkeypatch):
    folder, elsewhere = tmp_path / "stick", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    monkeypatch.setenv("TMPDIR", str(elsewhere))
    command = [sys.executable, str(CHILD), "run", "desk", "--out", str(folder / "r.h5"), "--", "never"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == "armed\n"
        shutil.rmtree(folder)
        if end == "asked":
            run.send_signal(signal.SIGTERM)
        out, words = run.communicate("\n", timeout=100)
    assert run.returncode == (143 if end == "asked" else 2)
    assert "is off" in out
    assert "Traceback" not in words
    (journal,) = elsewhere.rglob("r.journal")
    assert f"haptics recording recover {journal}" in words
    contents = read_journal(journal)
    assert contents.complete == (end != "asked")
    assert contents.count("wire") > 100


VIEW = """
import resource, sys
from haptics.errors import HapticsError
from haptics.recording import load, write_picture, write_rrd
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, resource.RLIM_INFINITY))
try:
    (write_picture if sys.argv[2].endswith("png") else write_rrd)(load(sys.argv[1]), sys.argv[2])
except HapticsError as error:
    sys.exit(str(error))
"""


@pytest.mark.parametrize(("library", "name"), [("matplotlib", "p.png"), ("rerun", "p.rrd")])
def test_a_view_that_finds_no_room_is_an_error(tmp_path: Path, library: str, name: str):
    pytest.importorskip(library)
    with Journal.create(tmp_path / "j", {"title": "nothing"}) as journal:
        journal.close()
    finalise(tmp_path / "j", tmp_path / "r.h5")
    command = [sys.executable, "-c", VIEW, str(tmp_path / "r.h5"), str(tmp_path / name)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (1, f"{tmp_path / name} cannot be written: File too large\n")
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


def test_a_run_whose_picture_finds_no_room_says_that_its_recording_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*args: object, **kwargs: object) -> None:
        raise HapticsError("p.png cannot be written: No space left on device")

    monkeypatch.setattr("haptics.session.run.write_picture", full)
    out = tmp_path / "r.h5"
    with pytest.raises(HapticsError, match="No space left") as error:
        run_scene("desk", "synthetic", Configuration(), RunOptions(out=out, picture=tmp_path / "p.png"))
    assert error.value.__notes__ == [f"the recording {out} is complete"]
    assert load(out).complete


@pytest.mark.parametrize("words", [("scenes",), ("scenes", "--json"), ("predict", "latch"), ("config", "schema")])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_standard_output_that_takes_nothing_is_one_line_and_exit_2(words):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*HAPTICS, *words], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "haptics: standard output cannot be written: No space left on device\n"


@pytest.mark.parametrize("words", [("scenes",), ("scenes", "--json"), ("predict", "latch")])
def test_a_pipe_that_nobody_reads_is_one_line_and_exit_2(words):
    reads, writes = os.pipe()
    os.close(reads)
    done = subprocess.run([*HAPTICS, *words], stdout=writes, stderr=subprocess.PIPE, text=True)
    os.close(writes)
    assert done.returncode == 2
    assert done.stderr == "haptics: standard output cannot be written: it was closed\n"


def test_standard_streams_that_are_closed_from_the_start_break_nothing():
    for closed in (">&-", "2>&-", ">&- 2>&-"):
        command = ["/bin/sh", "-c", f'"$0" -m haptics.cli.main scenes {closed}', sys.executable]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")


def test_a_run_whose_report_nobody_reads_says_where_its_recording_is(tmp_path: Path):
    reads, writes = os.pipe()
    os.close(reads)
    command = [*HAPTICS, "run", "desk", "--out", str(tmp_path / "r.h5"), "--json"]
    done = subprocess.run(command, stdout=writes, stderr=subprocess.PIPE, text=True)
    os.close(writes)
    assert done.returncode == 2
    assert f"the recording {tmp_path / 'r.h5'} is complete" in done.stderr
    assert "Traceback" not in done.stderr
    assert load(tmp_path / "r.h5").complete
