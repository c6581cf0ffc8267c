"""Volts swept on a simulated brake controller, as a person at a bench does it."""

from __future__ import annotations

import csv

import pytest

from haptics.physics.brake.parameters import BRAKE, capacitance_f


def test_each_setting_reaches_its_volts_on_the_capacitance_of_the_brake(script, tmp_path):
    board = ("--port", "sim://brake?spread=0", "--hold-s", 4)
    code, _, err = script("sweep_volts", tmp_path / "out.csv", *board, "--volts", "500,1500", "--frequencies", "10,20")
    assert code == 0, err
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(float(row["volts asked (V)"]), float(row["frequency (Hz)"])) for row in rows] == [
        (500.0, 10.0),
        (1500.0, 10.0),
        (500.0, 20.0),
        (1500.0, 20.0),
    ]
    farads = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
    for row in rows:
        asked_v = float(row["volts asked (V)"])
        assert float(row["volts reached (V)"]) == pytest.approx(asked_v, abs=1.0)  # telemetry's step
        assert float(row["capacitance (pF)"]) == pytest.approx(1e12 * farads, rel=0.01)
        assert row["taken"] == "yes"


def test_a_setting_that_the_board_refuses_ends_the_sweep_and_leaves_no_file(script, tmp_path):
    code, _, err = script("sweep_volts", tmp_path / "out.csv", "--volts", "1500", "--frequencies", "200")
    assert code == 1
    assert "bad_value" in err
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("words", [("--volts", "1600"), ("--volts", "x"), ("--frequencies", "0"), ("--hold-s", "0")])
def test_bad_arguments_are_refused_by_name(script, tmp_path, words):
    code, _, err = script("sweep_volts", tmp_path / "out.csv", *words)
    assert code == 1
    assert words[0].strip("-").split("-")[0].rstrip("s")[:5] in err
