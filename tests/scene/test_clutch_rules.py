"""Clutch rules over grasps, touches and body signals, and the signals themselves."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.scene.clutch_rules import BodyState, ByGrasp, ClutchRules, HeldPosture, OnContact, SelectiveResistance
from haptics.scene.signals import BodySignals, Signal
from haptics.time import NS_PER_MS, NS_PER_S

ALL = ("upper_back", "lower_left", "lower_right")


def state(time_s: float, signals: BodySignals | None = None, held: str | None = None, touched=()) -> BodyState:
    return BodyState(round(time_s * NS_PER_S), signals or BodySignals(), held, touched)


def bend(*points: tuple[float, float]) -> BodySignals:
    times, angles = zip(*points, strict=True)
    return BodySignals({"bend": Signal("bend", times, angles)})


def test_all_clutches_hold_while_the_box_is_grasped():
    rules = ClutchRules([ByGrasp("box", ALL)])
    assert rules.update(state(0.0)) == frozenset()
    assert rules.update(state(0.1, held="box")) == set(ALL)
    assert rules.update(state(0.2, held="cup")) == frozenset()


def test_posture_is_held_from_upright_then_released_then_held_again():
    rules = ClutchRules([HeldPosture("bend", ALL, upright_rad=0.1, hold_s=2.0, release_s=1.0)])
    slouch_then_upright = bend((0.0, 0.5), (1.0, 0.0))
    engaged = [bool(rules.update(state(t / 10, slouch_then_upright))) for t in range(80)]
    begins = [t / 10 for t in range(1, 80) if engaged[t] and not engaged[t - 1]]
    ends = [t / 10 for t in range(1, 80) if not engaged[t] and engaged[t - 1]]
    assert begins[0] > 0.5  # not while slouching
    assert [round(e - b, 9) for b, e in zip(begins, ends, strict=False)] == [2.0, 2.0]
    assert round(begins[1] - ends[0], 9) == 1.0


def test_nobody_is_held_in_a_slouch():
    rules = ClutchRules([HeldPosture("bend", ALL, upright_rad=0.1, hold_s=1.0, release_s=0.5)])
    signals = bend((0.0, 0.0), (1.0, 0.0), (1.4, 0.6), (5.0, 0.6))
    assert rules.update(state(0.0, signals))
    assert not any(rules.update(state(1.0 + t / 10, signals)) for t in range(40))


def test_the_direction_of_motion_chooses_which_clutch_resists_and_the_other_is_free():
    rules = ClutchRules([SelectiveResistance("bend", rising=("lower",), falling=("upper",))])
    signals = bend((0.0, 0.3), (1.0, 2.0), (2.0, 0.3))
    assert rules.update(state(0.5, signals)) == {"lower"}
    assert rules.update(state(1.0, signals)) == {"lower"}  # stopped: the last choice stays
    assert rules.update(state(1.5, signals)) == {"upper"}


@given(rates=st.lists(st.floats(-10, 10), max_size=30))
def test_selective_resistance_never_locks_a_limb(rates):
    rules = ClutchRules([SelectiveResistance("bend", rising=("lower",), falling=("upper",))])
    signals, angle = BodySignals(), 0.0
    for n, rate in enumerate(rates):
        angle = max(-6.0, min(6.0, angle + rate * 0.01))
        signals.supply("bend", n * 10 * NS_PER_MS, angle)
        assert len(rules.update(state(n * 0.01, signals))) <= 1


def test_a_ball_engages_the_upper_back_for_a_while_and_a_longer_contact_for_as_long():
    rules = ClutchRules([OnContact("ball", ("upper_back",), hold_s=0.2)])
    assert rules.update(state(0.0)) == frozenset()
    assert rules.update(state(0.1, touched={"ball"})) == {"upper_back"}
    assert rules.update(state(0.15)) == {"upper_back"}
    assert rules.update(state(0.31)) == frozenset()
    assert rules.update(state(0.4, touched={"ball"})) == {"upper_back"}
    assert rules.update(state(0.9, touched={"ball"})) == {"upper_back"}
    assert rules.update(state(0.91)) == frozenset()


def test_clutches_let_go_when_their_signal_is_lost():
    rules = ClutchRules(
        [SelectiveResistance("bend", rising=("lower",), falling=("upper",)), HeldPosture("bend", ("back",), 1.0, 9.0, 0.0)]
    )
    signals = BodySignals()
    signals.supply("bend", 0, 0.1)
    signals.supply("bend", 10 * NS_PER_MS, 0.2)
    assert rules.update(state(0.01, signals)) == {"lower", "back"}
    assert rules.update(state(0.2, signals)) == frozenset()


def test_two_rules_hold_what_either_wants():
    rules = ClutchRules([ByGrasp("box", ("a", "b")), OnContact("box", ("b", "c"), hold_s=0.0)])
    assert rules.update(state(0.0, held="box", touched={"box"})) == {"a", "b", "c"}
    assert rules.update(state(0.1, touched={"box"})) == {"b", "c"}


def test_a_profile_moves_with_minimum_jerk_between_its_keyframes():
    signal = Signal("bend", (1.0, 3.0), (0.2, 1.2))
    assert signal.at(0.0) == (0.2, 0.0)
    assert signal.at(9.0) == (1.2, 0.0)
    assert signal.at(2.0) == (pytest.approx(0.7), pytest.approx(1.875 / 2.0))  # peak speed is 15/8 of the mean
    for time in (1.2, 1.9, 2.6):
        numeric = (signal.at(time + 1e-6)[0] - signal.at(time - 1e-6)[0]) / 2e-6
        assert signal.at(time)[1] == pytest.approx(numeric, rel=1e-6)


def test_a_repeated_profile_starts_over():
    signal = Signal("bend", (0.0, 1.0, 2.0), (0.0, 1.0, 0.0), repeat=True)
    assert signal.at(6.5) == pytest.approx(signal.at(0.5))


def test_supplied_values_replace_the_profile_and_carry_a_rate():
    signals = bend((0.0, 0.0), (1.0, 1.0))
    assert signals.read("bend", NS_PER_S) == (1.0, 0.0)
    signals.supply("bend", 0, 0.3)
    assert signals.read("bend", 0) == (0.3, 0.0)
    signals.supply("bend", 50 * NS_PER_MS, 0.4)
    assert signals.read("bend", 60 * NS_PER_MS) == (0.4, pytest.approx(2.0))
    assert signals.read("bend", NS_PER_S) is None
    assert signals.read("knee", 0) is None


@pytest.mark.parametrize(
    "make",
    [
        lambda: Signal("bend", (0.0, 0.0), (0.0, 1.0)),
        lambda: Signal("bend", (0.0, 1.0), (0.0,)),
        lambda: Signal("bend", (0.0,), (math.nan,)),
        lambda: ByGrasp("box", ()),
        lambda: ByGrasp("box", ("a", "a")),
        lambda: SelectiveResistance("bend", ("a",), ("a", "b")),
        lambda: HeldPosture("bend", ("a",), 0.1, 0.0, 1.0),
        lambda: OnContact("ball", ("a",), hold_s=-1.0),
        lambda: BodySignals().supply("bend", 0, math.inf),
    ],
)
def test_what_makes_no_sense_is_refused(make):
    with pytest.raises(InputError, match=r"allowed|expected|lock the limb"):
        make()


def test_a_supplied_value_must_be_newer():
    signals = BodySignals()
    signals.supply("bend", 5, 0.0)
    with pytest.raises(InputError, match="newer"):
        signals.supply("bend", 5, 0.1)
