"""The CSV export, run as a person at a bench runs it."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

from haptics.recording import load
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene

TOOL = Path(__file__).resolve().parents[2] / "tools" / "export_csv.py"


def test_a_recording_becomes_tables_with_units(tmp_path):
    run_scene("posture", "synthetic", Configuration(), RunOptions(out=tmp_path / "run.h5"))
    done = subprocess.run(
        [sys.executable, TOOL, tmp_path / "run.h5", tmp_path / "csv"], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    recording = load(tmp_path / "run.h5")
    with (tmp_path / "csv" / "ticks.csv").open() as file:
        head, *rows = csv.reader(file)
    assert head[0] == "time_ns (ns)"
    column = head.index("force_n[0] (N)")
    assert [float(row[column]) for row in rows] == [float(v) for v in recording.stream("ticks")["force_n"][:, 0]]


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "csv").mkdir()
    (tmp_path / "csv" / "mine.txt").write_text("mine")
    run_scene("posture", "synthetic", Configuration(), RunOptions(out=tmp_path / "run.h5"))
    done = subprocess.run(
        [sys.executable, TOOL, tmp_path / "run.h5", tmp_path / "csv"], capture_output=True, text=True, timeout=120
    )
    assert done.returncode != 0
    assert "not empty" in done.stderr
    assert [path.name for path in (tmp_path / "csv").iterdir()] == ["mine.txt"]
