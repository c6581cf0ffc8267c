"""``haptics run`` killed at any moment: what it had acknowledged comes back, and is what the whole run would have recorded."""

from __future__ import annotations

import json
import random
import signal
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Sequence
from pathlib import Path

import pytest

from haptics.recording import Recording, load
from haptics.session.configuration import Configuration
from haptics.session.recorder import COMMIT_NS
from haptics.session.run import RunOptions, run_scene
from haptics.session.sampler import SAMPLE_NS

pytestmark = [pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kills as POSIX does"), pytest.mark.slow]
SCENE = "tennis"  # drives both boards


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """The run that nobody kills; being in virtual time, every killed one is its beginning."""
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    run_scene(SCENE, "synthetic", Configuration(), RunOptions(out=out))
    return load(out)


def kill_a_run(out: Path, at_bytes: int) -> bytes:
    """As ``kill`` does, a run that would end in ``out``."""
    return kill(("run", SCENE, "--out", str(out), "--json"), out, at_bytes)


def kill(words: Sequence[str], out: Path, at_bytes: int) -> bytes:
    """Start a command, kill it when the journal of ``out`` has so many bytes; returns what the system had been given before."""
    journal = out.with_suffix(".journal")
    command = [sys.executable, "-m", "haptics.cli.main", *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=out.parent) as run:
        deadline = time.monotonic() + 60
        while not journal.exists() or journal.stat().st_size < at_bytes:
            assert run.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.001)
        acknowledged = journal.read_bytes()
        run.kill()
    assert run.returncode == -signal.SIGKILL
    return acknowledged


def commits(journal: bytes) -> dict[str, list[int]]:
    """Bytes of rows in each whole segment of a journal, by stream, read by its documented table and no other code."""
    names: list[str] = []
    rows: dict[str, list[int]] = {}
    place = journal.index(b"\n") + 1
    while len(journal) >= place + 20:
        marker, kind, stream, _, length, crc = struct.unpack_from("<4sBxHIII", journal, place)
        payload = journal[place + 20 : place + 20 + length]
        if len(payload) < length:
            break
        assert marker == b"SEG\n"
        assert zlib.crc32(journal[place : place + 16] + payload) == crc
        if kind == 2:
            names.append(json.loads(payload)["name"])
            rows[names[-1]] = []
        elif kind == 3:
            rows[names[stream]].append(length)
        place += 20 + length
    return rows


def all_acknowledged_comes_back(haptics, folder: Path, whole: Recording, kills: int, seed: int) -> None:
    rng = random.Random(seed)
    total = sum(whole.stream(name).nbytes for name in whole.streams)
    for turn in range(kills):
        out = folder / f"{turn}.h5"
        acknowledged = commits(kill_a_run(out, round(rng.uniform(0.02, 0.8) * total)))
        done = haptics("recording", "recover", out.with_suffix(".journal"), "--json")
        assert done.code == 0, done.err
        recovered = load(out)
        assert done.json["path"] == str(out)
        assert done.json["complete"] is recovered.complete is False
        assert set(recovered.streams) == set(whole.streams) == set(acknowledged)
        for name in whole.streams:
            rows = recovered.stream(name)
            assert done.json["rows"][name] == len(rows)
            assert rows.nbytes >= sum(acknowledged[name])
            assert rows.tobytes() == whole.stream(name)[: len(rows)].tobytes(), name
        assert acknowledged["wire"]
        longest = max(acknowledged["ticks"]) // whole.stream("ticks").itemsize
        assert longest * SAMPLE_NS <= COMMIT_NS + SAMPLE_NS  # what came since the last commit is all that a kill can take


def test_what_a_killed_run_had_acknowledged_is_recovered_and_begins_the_whole_one(haptics, tmp_path, whole):
    all_acknowledged_comes_back(haptics, tmp_path, whole, kills=3, seed=1)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_a_hundred_killed_runs(haptics, tmp_path, whole):
    all_acknowledged_comes_back(haptics, tmp_path, whole, kills=100, seed=2)


def killed_rigs(haptics, folder: Path, rigs: Sequence[str], kills: int, seed: int) -> None:
    """Each rig on its bench, whole once and then killed; what was acknowledged comes back and begins the whole one."""
    rng = random.Random(seed)
    for rig in rigs:
        how = ("--surface", "bare") if rig == "pendulum" else ()  # one recording, not one a surface
        assert haptics("characterize", rig, *how, "--out", folder / rig).code == 0
        whole = load(folder / rig / f"{rig}.h5")
        total = sum(whole.stream(name).nbytes for name in whole.streams)
        for turn in range(kills):
            out = folder / f"{rig}-{turn}" / f"{rig}.h5"
            out.parent.mkdir()
            words = ("characterize", rig, *how, "--out", str(out.parent))
            acknowledged = commits(kill(words, out, round(rng.uniform(0.02, 0.8) * total)))
            assert haptics("characterize", rig, *how, "--out", out.parent, "--force").code == 2
            done = haptics("recording", "recover", out.with_suffix(".journal"), "--json")
            assert done.code == 0, done.err
            recovered = load(out)
            assert not recovered.complete
            for name in whole.streams:
                rows = recovered.stream(name).tobytes()
                assert len(rows) >= sum(acknowledged[name])
                assert whole.stream(name).tobytes().startswith(rows), name


def test_what_a_killed_rig_had_acknowledged_is_recovered(haptics, tmp_path):
    killed_rigs(haptics, tmp_path, ["pull"], kills=2, seed=3)


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_a_hundred_killed_rigs(haptics, tmp_path):
    killed_rigs(haptics, tmp_path, ["thermal", "pendulum", "frequency", "pull", "response", "supply"], kills=17, seed=4)


def test_what_a_killed_run_left_is_never_overwritten_and_is_named_with_what_saves_it(haptics, tmp_path, whole):
    out = tmp_path / "again.h5"
    kill_a_run(out, 50_000)
    left = out.with_suffix(".journal").read_bytes()
    for force in ((), ("--force",)):
        done = haptics("run", SCENE, "--out", out, *force)
        assert done.code == 2
        assert f"haptics recording recover {out.with_suffix('.journal')}" in done.err
        assert out.with_suffix(".journal").read_bytes() == left
    done = haptics("run", SCENE, "--out", tmp_path / "other.h5", "--json")
    assert done.code == 0, done.err
    assert "again.journal was left by a session that did not end" in done.err
    assert load(tmp_path / "other.h5").stream("wire").tobytes() == whole.stream("wire").tobytes()
    assert haptics("recording", "info", out.with_suffix(".journal"), "--json").json["kind"] == "journal"
    assert haptics("recording", "recover", out.with_suffix(".journal")).code == 0
    out.with_suffix(".journal").unlink(missing_ok=True)  # kept if its last segment was torn
    assert haptics("run", SCENE, "--out", out, "--force", "--json").code == 0
    assert load(out).stream("wire").tobytes() == whole.stream("wire").tobytes()
