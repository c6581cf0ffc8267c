"""Level ``table``: as close to the equation of motion as it claims, whatever the drive; stepped where it has no answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.physics.latch import flow_map as latch_flow, kernel as latch_kernel
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.flow_map import flow_table
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.pulse import min_pulse_s
from haptics.physics.latch.reference import ReferenceLatch
from haptics.physics.latch.table import TableLatch


def play(make, strokes, latched="off", rise_k=0.0, p=LATCH, **options):
    plant = make(p, latched, **options)
    plant.rise_k = rise_k
    at_s, events = 0.0, []
    for volts, length_s in strokes:
        plant.drive(at_s, volts)
        events += plant.take_events()
        at_s += length_s
    plant.drive(at_s, 0.0)
    plant.advance(at_s + 0.3)
    return events + plant.take_events(), plant


@pytest.mark.slow
@pytest.mark.parametrize("ohms", [1.28, 1.48])
@pytest.mark.parametrize("rise_k", [0.0, 50.0])
@pytest.mark.parametrize("volts", [4.8, 5.0, 6.5, 9.0])  # the last is past the table, and stepped
def test_arrivals_are_the_references_within_a_microsecond(volts, rise_k, ohms):
    p = LATCH.with_values(resistance_ohm=ohms)
    for latched, sign in (("off", 1.0), ("on", -1.0)):
        table, plant = play(TableLatch, [(sign * volts, 10e-3)], latched, rise_k, p)
        true, reference = play(ReferenceLatch, [(sign * volts, 10e-3)], latched, rise_k, p)
        assert [e.kind for e in table] == [e.kind for e in true]
        # The braking by induced voltage of another resistance is put in to first order: up to 1.3 us at these corners.
        assert [e.time_s for e in table] == pytest.approx([e.time_s for e in true], abs=2e-6)
        assert [e.speed_m_s for e in table] == pytest.approx([e.speed_m_s for e in true], rel=2e-3)
        assert plant.energy_j == pytest.approx(reference.energy_j, rel=1e-3)


def test_a_train_of_reversals_keeps_in_step():
    strokes = [(5.0, 2e-3), (-5.0, 3e-3)] * 10
    table, _ = play(TableLatch, strokes)
    true, _ = play(ReferenceLatch, strokes)
    assert len(table) == len(true) == 10
    assert [e.time_s for e in table] == pytest.approx([e.time_s for e in true], abs=1e-6)


def test_a_pin_driven_away_while_it_bounces_starts_from_its_bounce():
    # Back at 3 ms with 5 V, it meets the foam at 3.96 ms and bounces; away again 1 ms later, a pin at rest would be 0.3 ms off.
    strokes = [(5.0, 3e-3), (-5.0, 2e-3), (5.0, 10e-3)]
    (table, _), (true, _) = play(TableLatch, strokes), play(ReferenceLatch, strokes)
    assert [e.kind for e in table] == [e.kind for e in true]
    assert [e.time_s for e in table] == pytest.approx([e.time_s for e in true], abs=3e-6)
    rested, _ = play(ReferenceLatch, [(5.0, 10e-3)])
    assert abs(true[-1].time_s - 5e-3 - rested[0].time_s) > 50e-6


def test_the_watershed_lies_where_it_does_for_the_equation_of_motion():
    for volts, direction in ((5.0, "off-on"), (4.5, "off-on"), (5.0, "on-off"), (4.5, "on-off")):
        assert min_pulse_s(volts, direction, level="table") == pytest.approx(
            min_pulse_s(volts, direction), abs=2e-7
        )  # searched to 0.1 us


strokes = st.lists(
    st.tuples(st.sampled_from([-5.0, -4.5, 0.0, 4.5, 5.0]), st.floats(0.5e-3, 12e-3)), min_size=1, max_size=6
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(strokes=strokes, latched=st.sampled_from(["on", "off"]), rise_k=st.floats(0.0, 60.0))
def test_any_sequence_ends_where_the_equation_of_motion_does(strokes, latched, rise_k):
    _, dynamic = play(DynamicLatch, strokes, latched, rise_k, step_s=5e-6)
    _, other = play(DynamicLatch, strokes, latched, rise_k, step_s=20e-6)
    _, plant = play(TableLatch, strokes, latched, rise_k)
    if dynamic.latched != other.latched:
        return  # on the watershed itself even the step decides
    _, near = play(DynamicLatch, [(v * 1.005, t) for v, t in strokes], latched, rise_k)
    if near.latched != dynamic.latched:
        return  # within half a per cent of the threshold
    assert plant.latched == dynamic.latched


@pytest.mark.parametrize(
    "change",
    [{"mass_kg": 2e-3}, {"stroke_m": 4e-3}, {"drag_n_s_m": 0.1}, {"inductance_h": 2e-3}, {"hold_on_n": 1.0}, {"mass_kg": 1e-5}],
)
def test_other_parameters_get_a_table_of_their_own_or_none(change):
    p = LATCH.with_values(**change)
    (table, plant), (true, other) = play(TableLatch, [(5.0, 10e-3)], p=p), play(DynamicLatch, [(5.0, 10e-3)], p=p, step_s=2e-6)
    assert plant.latched == other.latched
    assert [e.kind for e in table][:1] == [e.kind for e in true][:1]
    assert [e.time_s for e in table][:1] == pytest.approx([e.time_s for e in true][:1], abs=2e-6)


def test_a_coil_too_slow_for_a_span_has_no_table():
    assert flow_table(LATCH.with_values(inductance_h=2e-3)) is None
    assert flow_table(LATCH) is not None


def test_a_skin_under_the_pin_is_felt():
    p = LATCH.with_values(skin_stiffness_n_m=300.0)
    (table, _), (true, _) = play(TableLatch, [(5.0, 10e-3)], p=p), play(ReferenceLatch, [(5.0, 10e-3)], p=p)
    assert table[0].time_s == pytest.approx(true[0].time_s, abs=1e-6)


def test_compiled_and_plain_agree():
    table = flow_table(LATCH)
    packed = latch_kernel.kernel_parameters(LATCH)
    rng = np.random.default_rng(3)
    for _ in range(300):
        x, v, u = rng.uniform(0, 2e-3), rng.uniform(-1, 1), rng.uniform(-6, 6)
        start = (
            x,
            v,
            u / 1.4,
            0.0,
            float(rng.uniform(0, 4e-3)),
            bool(rng.integers(2)),
            u,
            1.4,
            float(rng.choice([-1, 1e-4, 1.9e-3])),
            0.0,
        )
        fast, plain = (fly(*start, packed, table.grid, table.nodes) for fly in (latch_flow.flight(True), latch_flow.fly))
        assert fast == pytest.approx(plain, rel=1e-12, abs=1e-15)


def test_without_numba_the_same_lines_run_in_python(monkeypatch):
    import builtins

    real = builtins.__import__

    def missing(name, *rest, **options):
        if name == "numba":
            raise ImportError(name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", missing)
    assert latch_kernel.maybe_compiled(latch_kernel.integrate) is latch_kernel.integrate
