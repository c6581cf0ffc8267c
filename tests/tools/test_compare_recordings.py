"""Two recordings held against each other, as a person at a bench does it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from haptics.recording import Journal, finalise

ROW = np.dtype([("time_ns", "i8"), ("force_n", "f8"), ("volts", "f8", (2,))])


def record(path: Path, times_s, force_n, extra: bool = False) -> Path:
    with Journal.create(path.with_suffix(".journal"), {"title": "test"}) as journal:
        stream = journal.stream("pull", ROW, {"force_n": "N", "volts": "V"})
        if extra:
            journal.stream("notes", np.dtype([("time_ns", "i8"), ("code", "i4")])).append((0, 1))
        for t, f in zip(times_s, force_n, strict=True):
            stream.append((round(t * 1e9), f, (100.0, 200.0)))
        journal.close({})
    finalise(path.with_suffix(".journal"), path)
    return path


@pytest.fixture
def compared(script) -> Callable[..., tuple[int, dict]]:
    def run(*words: object) -> tuple[int, dict]:
        code, out, _ = script("compare_recordings", *words, "--json")
        return code, json.loads(out)

    return run


@pytest.fixture
def first(tmp_path) -> Path:
    times = np.arange(0.0, 10.0, 0.01)
    return record(tmp_path / "a.h5", times, 2.0 * times)


def test_the_same_signal_sampled_at_other_times_is_the_same(first, compared, tmp_path):
    times = 5.0 + np.arange(0.0, 10.0, 0.007)  # another clock, another rate
    second = record(tmp_path / "b.h5", times, 2.0 * (times - 5.0))
    code, found = compared(first, second, "--tolerance", 1e-9)
    assert code == 0
    assert found["same"]
    assert [(row["field"], row["unit"]) for row in found["differences"]] == [("force_n", "N"), ("volts", "V")]


def test_a_known_difference_is_reported_with_its_size(first, compared, tmp_path):
    times = np.arange(0.0, 10.0, 0.01)
    second = record(tmp_path / "b.h5", times, 2.0 * times + np.where(times == 5.0, 0.3, 0.1))
    code, found = compared(first, second, "--stream", "pull")
    assert code == 1
    (force, volts) = found["differences"]
    assert force["greatest"] == pytest.approx(0.3)
    assert force["rms"] == pytest.approx(np.sqrt((999 * 0.01 + 0.09) / 1000))
    assert force["share"] == pytest.approx(0.3 / 20.08)  # over the span of both: 0 to 19.98 + 0.1
    assert volts["greatest"] == 0.0


def test_a_stream_in_one_recording_only_makes_them_different(first, compared, tmp_path):
    times = np.arange(0.0, 10.0, 0.01)
    code, found = compared(first, record(tmp_path / "b.h5", times, 2.0 * times, extra=True))
    assert code == 1
    assert found["only_in_one"] == ["notes"]


def test_what_is_no_recording_is_refused(first, script, tmp_path):
    (tmp_path / "x.h5").write_text("no")
    code, _, err = script("compare_recordings", first, tmp_path / "x.h5")
    assert code == 1
    assert "compare_recordings:" in err
