"""What levels cost, against real time and against the solver that a user would pick instead; side by side in one run."""

from __future__ import annotations

import math
import statistics
from pathlib import Path

import numpy as np
import pytest
from ledger import Job, Ledger, cpu_s, side_by_side

from haptics.fidelity import plan_scene
from haptics.physics.brake.bank import BrakeBank
from haptics.physics.latch.bank import LatchBank
from haptics.physics.latch.parameters import LATCH as P, NOMINAL_VOLTS
from haptics.physics.latch.pulse import latch_plant, switch
from haptics.physics.latch.reference import ReferenceLatch
from haptics.scene import load_scene

pytestmark = pytest.mark.bench

TWO_TIPS = """summary = "a ball that two fingertips can touch"
[[objects]]
name = "ball"
placement = "palm"
shape = { kind = "sphere", radius_m = 0.03 }
effects = [{ kind = "contact", sites = ["index_tip", "thumb_tip"] }]
"""


def switching(level: str, seconds: int) -> Job:
    """Fifteen actuators that all switch twice a second."""

    def job() -> None:
        plants = [latch_plant(level) for _ in range(15)]
        for k in range(2 * seconds):
            for plant in plants:
                plant.drive(0.5 * k, NOMINAL_VOLTS if k % 2 == 0 else -NOMINAL_VOLTS)
                plant.drive(0.5 * k + 0.010, 0.0)
                plant.take_events()
        for plant in plants:
            plant.advance(float(seconds))

    job()
    return job


@pytest.mark.parametrize(
    ("level", "over", "at_least", "seconds"),
    [("event", "table", 2, 20), ("table", "dynamic", 4, 20), ("dynamic", "reference", 100, 1)],
)
def test_each_level_of_the_tactor_is_cheaper_than_the_next(
    bench: Ledger, level: str, over: str, at_least: float, seconds: int
) -> None:
    _, quick_s, ratio = side_by_side(switching(over, seconds), switching(level, seconds), 3)
    bench.note(f"15 actuators at 2 Hz, level {level}, times faster than real time, one core", f"{seconds / quick_s:.0f}")
    bench.ratio(f"latch.{level}", f"15 actuators at 2 Hz, level {over} over level {level}", ratio, at_least=at_least)


@pytest.mark.parametrize("level", ["table", "dynamic"])
def test_a_thousand_gloves_in_a_batch_cost_no_more_than_one_by_one(bench: Ledger, level: str) -> None:
    def batch() -> None:
        bank = LatchBank(15_000, level)
        for k in range(2):
            bank.drive(0.5 * k, NOMINAL_VOLTS if k % 2 == 0 else -NOMINAL_VOLTS)
            bank.drive(0.5 * k + 0.010, 0.0)
        bank.advance(1.0)

    LatchBank(1, level).drive(0.0, 5.0)
    batch_s, _, ratio = side_by_side(batch, switching(level, 20), 3)
    bench.note(f"1000 gloves of 15 actuators at 2 Hz, level {level}, CPU of a simulated second", f"{batch_s:.2f} s")
    bench.ratio(f"bank.{level}", f"the same, level {level}, over a thousand times one glove", ratio / 50, at_most=1.1)


@pytest.mark.parametrize("level", ["lagged", "dynamic"])
def test_a_step_of_sixty_four_clutches(bench: Ledger, level: str) -> None:
    def bank() -> BrakeBank:
        made = BrakeBank(64, level)
        made.drive(np.linspace(300.0, 1500.0, 64), 10.0)
        made.move(0.0, 5e-3)
        made.step(100)
        return made

    steps = 5_000
    together, alone = bank(), bank()

    def one_by_one() -> None:
        for _ in range(steps):
            alone.step()

    alone_s, together_s, ratio = side_by_side(one_by_one, lambda: together.step(steps))
    bench.note(f"64 clutches, level {level}, a step of 1 ms, many in a call", f"{together_s / steps * 1e6:.2f} us")
    bench.note("one step a call", f"{alone_s / steps * 1e6:.2f} us")
    bench.ratio(f"clutches.{level}", f"64 clutches, level {level}: one step a call, over many in a call", ratio, at_least=1.3)


@pytest.mark.parametrize("level", ["table", "dynamic"])
def test_a_pulse_against_a_general_solver_at_equal_accuracy(bench: Ledger, level: str) -> None:
    """The same equation handed to scipy as a user would: the fastest method and tolerance that are as exact as the level."""
    from scipy.integrate import solve_ivp

    def motion(_: float, state: np.ndarray) -> list[float]:
        x, v, i = state
        thrust = P.thrust_n_a * (math.exp(-x / P.thrust_length_m) + math.exp((x - P.stroke_m) / P.thrust_length_m))
        thrust /= 1 + math.exp(-P.stroke_m / P.thrust_length_m)
        force = thrust * i - P.drag_n_s_m * v
        force += P.hold_on_n * (1 + (P.stroke_m - x) / P.plate_length_m) ** -P.plate_power
        force -= P.hold_off_n * (1 + x / P.plate_length_m) ** -P.plate_power
        if x < 0:
            force -= P.off_stiffness_n_m * x * max(0.0, 1 - P.off_loss_s_m * v)
        elif x > P.stroke_m:
            force -= P.on_stiffness_n_m * (x - P.stroke_m) * max(0.0, 1 + P.on_loss_s_m * v)
        return [v, force / P.mass_kg, (NOMINAL_VOLTS - P.resistance_ohm * i - thrust * v) / P.inductance_h]

    def arrival(_: float, state: np.ndarray) -> float:
        return state[0] - P.stroke_m

    def ours() -> float:
        plant = latch_plant(level)
        plant.drive(0.0, NOMINAL_VOLTS)
        plant.advance(0.010)
        return next(event.time_s for event in plant.take_events() if event.kind == "reached_skin")

    start = [latch_plant(level).position_m, 0.0, 0.0]

    def theirs(method: str, rtol: float) -> float:
        solved = solve_ivp(motion, (0.0, 0.010), start, method, events=arrival, rtol=rtol, atol=1e-3 * rtol)
        return float(solved.t_events[0][0])

    reference = ReferenceLatch()
    reference.drive(0.0, NOMINAL_VOLTS)
    reference.advance(0.010)
    true_s = reference.take_events()[0].time_s
    our_error_s = abs(ours() - true_s)
    as_exact = max(our_error_s, 1e-9)  # below a nanosecond nobody asks
    tried = [(method, rtol) for method in ("LSODA", "RK45", "DOP853") for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)]
    good = [how for how in tried if abs(theirs(*how) - true_s) <= as_exact]
    method, rtol = min(good, key=lambda how: min(cpu_s(lambda: theirs(*how)) for _ in range(2)))
    pairs = [(cpu_s(ours), cpu_s(lambda: theirs(method, rtol))) for _ in range(21)]
    ratio = statistics.median(b / a for a, b in pairs)
    bench.note(f"a pulse of 10 ms, level {level}, median of 21", f"{statistics.median(a for a, _ in pairs) * 1e3:.3f} ms")
    bench.note(f"solve_ivp as exact: {method}, rtol {rtol:g}", f"{statistics.median(b for _, b in pairs) * 1e3:.2f} ms")
    what = f"a pulse of 10 ms by solve_ivp, over level {level} (arrival off by {our_error_s * 1e9:.2f} ns)"
    bench.ratio(f"latch.solver.{level}", what, ratio, at_least=80)


def test_the_search_for_the_shortest_pulse(bench: Ledger) -> None:
    def search(level: str) -> float:
        return statistics.median(cpu_s(lambda n=n: switch(0.010, 5.0 - 1e-3 * n, level=level)) for n in range(1, 10))

    for level in ("table", "dynamic"):
        bench.note(f"predict latch at level {level}, with its search, median of 9", f"{search(level) * 1e3:.2f} ms")
    bench.ratio(
        "latch.search", "predict latch with its search, level dynamic over table", search("dynamic") / search("table"), at_least=3
    )


def test_a_scene_of_two_fingertips_costs_what_two_actuators_cost(bench: Ledger, tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(TWO_TIPS)
    two, desk = (sum(r.cost_s_per_s for r in plan_scene(load_scene(scene)).rows) for scene in (path, "desk"))
    bench.note("models of two fingertips, of the desk: planned CPU a second", f"{two * 1e6:.0f}, {desk * 1e6:.0f} us")
    bench.ratio("plan.two_fingertips", "planned cost of two fingertips, over the desk", two / desk, at_most=0.2)
