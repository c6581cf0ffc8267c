"""Nothing acknowledged is lost when the process is killed."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from kill_soak import kill_once

from haptics.errors import InputError
from haptics.recording import finalise, load, recover

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kills as POSIX does")


def all_recovered(folder: Path, kills: int) -> None:
    total = 0
    for seed in range(kills):
        acknowledged, recovered = kill_once(folder / f"{seed}.journal", seed)
        assert recovered >= acknowledged > 0
        total += acknowledged
    assert total > 0


@pytest.mark.slow
def test_every_acknowledged_row_survives_a_few_kills(tmp_path: Path):
    all_recovered(tmp_path, 3)


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_every_acknowledged_row_survives_a_hundred_kills(tmp_path: Path):
    all_recovered(tmp_path, 100)


def test_what_a_kill_left_becomes_a_recording_that_says_so(tmp_path: Path):
    acknowledged, _ = kill_once(tmp_path / "j", 5)
    with pytest.raises(InputError, match=r"never closed|file ends"):
        finalise(tmp_path / "j", tmp_path / "r.h5")
    assert not (tmp_path / "r.h5").exists()
    result = recover(tmp_path / "j", tmp_path / "r.h5")
    recording = load(tmp_path / "r.h5")
    assert len(recording.stream("a")) == result.rows["a"] >= acknowledged
    assert not recording.complete
    assert recording.damage
    assert recording.footer == {}
    assert (tmp_path / "j").exists() == result.journal_kept == (result.lost_bytes > 0)
