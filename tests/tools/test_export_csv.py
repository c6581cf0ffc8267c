"""The CSV export, run as a person at a bench runs it."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from haptics.recording import load
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "run.h5"
    run_scene("posture", "synthetic", Configuration(), RunOptions(out=path))
    return path


@pytest.mark.slow
def test_a_recording_becomes_tables_with_units(recording, script, tmp_path):
    code, _, err = script("export_csv", recording, tmp_path / "csv")
    assert code == 0, err
    streams = load(recording)
    with (tmp_path / "csv" / "ticks.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[0] == "time_ns (ns)"
    column = head.index("force_n[0] (N)")
    assert [float(row[column]) for row in rows] == [float(v) for v in streams.stream("ticks")["force_n"][:, 0]]


def test_a_folder_with_something_in_it_is_left_alone(recording, script, tmp_path):
    (tmp_path / "csv").mkdir()
    (tmp_path / "csv" / "mine.txt").write_text("mine")
    code, _, err = script("export_csv", recording, tmp_path / "csv")
    assert code != 0
    assert "not empty" in err
    assert [path.name for path in (tmp_path / "csv").iterdir()] == ["mine.txt"]
