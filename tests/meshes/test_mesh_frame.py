"""Units and axes: each way to be wrong is named with its cure, and the cure gives the drawn size back."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.meshes import UNITS, Kind, best_fit, in_frame, size_fault

CUP = Kind("a cup", 0.002, 3.0, 0.1, "say {unit} or {scale}")
BOX = np.array([[x, y, z] for x in (0.0, 0.06) for y in (0.0, 0.1) for z in (0.0, 0.08)])


@pytest.mark.parametrize(("unit", "word"), [("mm", "millimetres"), ("cm", "centimetres"), ("in", "inches")])
def test_a_cup_in_another_unit_is_named_with_the_unit(unit, word):
    fault = size_fault(BOX / UNITS[unit], CUP)
    assert fault is not None
    assert f"is it in {word}?" in fault.cure
    assert "Then it is 0.1 m across" in fault.cure
    assert f"say {unit} or {UNITS[unit]:g}" in fault.cure
    assert size_fault(BOX / UNITS[unit], CUP, UNITS[unit]) is None


@pytest.mark.parametrize(
    ("size", "first", "second"),
    [(80, "millimetres", None), (30, "centimetres", "millimetres"), (5, "centimetres", "inches"), (6.5, "centimetres", None)],
)
def test_a_unit_that_is_nearly_as_likely_is_named_too(size, first, second):
    fault = size_fault(BOX * size / 0.1, CUP)
    assert fault is not None
    assert fault.cure.startswith(f"is it in {first}?")
    assert ("; or in " in fault.cure) == (second is not None)
    assert second is None or f"; or in {second}, " in fault.cure


def test_a_decimetre_shirt_and_one_beyond_numbers():
    shirt = Kind("a shirt", 0.01, 2.5, 0.6, "say {unit} or {scale}")
    assert "is it in decimetres? Then it is 0.65 m" in str(size_fault(BOX * 65, shirt))
    with np.errstate(all="raise"):
        assert "it is inf m across" in str(size_fault(np.array([[-1e308] * 3, [1e308] * 3]), shirt))


def test_what_no_unit_explains_has_no_cure():
    fault = size_fault(BOX * 1e-3, CUP)
    assert fault is not None
    assert str(fault) == "it is 0.0001 m across; must be 0.002 to 3 m, as a cup is"
    assert size_fault(BOX, CUP) is None


@pytest.mark.parametrize("to", ["y", "z"])
@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_frames_are_rotations_that_bring_up_to_up(to, up, quarters):
    turn = in_frame(np.eye(3), 1.0, up, to, quarters).T
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert turn @ np.eye(3)["xyz".index(up)] == pytest.approx(np.eye(3)["xyz".index(to)])


def test_quarters_turn_anticlockwise_seen_from_above():
    assert in_frame(np.array([[1.0, 0.0, 0.0]]), quarter_turns=1).tolist() == [[0.0, 1.0, 0.0]]
    assert in_frame(np.array([[0.0, 0.0, 1.0]]), to="y", up="y", quarter_turns=1).tolist() == [[1.0, 0.0, 0.0]]


@pytest.mark.slow
@pytest.mark.parametrize("unit", list(UNITS))
@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_frame_in_which_points_were_drawn_is_found(unit, up):
    rng = np.random.default_rng(4)
    statue = rng.uniform((-0.2, -0.1, 0.0), (0.5, 0.1, 1.7), (4000, 3))
    part = statue[statue[:, 2] > 1.0]
    undo = {"z": (0, 1, 2), "y": (0, 2, 1), "x": (2, 1, 0)}[up]
    sign = {"z": (1, 1, 1), "y": (1, 1, -1), "x": (1, 1, -1)}[up]
    drawn = part[:, undo] * sign / UNITS[unit]
    found = best_fit(drawn, statue)
    assert (found.unit, found.up, found.quarter_turns) == (unit, up, 0)
    assert found.distance_m < 1e-12
    assert in_frame(drawn, UNITS[unit], up) == pytest.approx(part)
