"""What a worn garment costs: an equilibrium by mesh and by solver, a whole design, and L-BFGS on the same problem."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from ledger import gathered

from haptics.garments.bodies import open_body
from haptics.garments.bodies.motions import MOTIONS
from haptics.garments.design.topology import optimise
from haptics.garments.equilibrium.cholesky import installed_solvers
from haptics.garments.equilibrium.wearing import WornMotion, evaluate_motion, wear
from haptics.garments.garment import LEVELS, cut_garment

pytestmark = pytest.mark.bench

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "images" / "garment_cost.png"
STEPS = 12
"""BESO steps that a median is taken over."""


@cache
def worn(level: str, solver: str | None = None) -> WornMotion:
    body = open_body("capsule")
    return wear(body, cut_garment(body, "sleeve", level), MOTIONS["elbow_flexion"], solver=solver)


def seconds(job: Callable[[], object]) -> float:
    begun = time.perf_counter()
    job()
    return time.perf_counter() - begun


class Enough(Exception):
    """Stops an optimisation."""


def step_seconds(simulation, steps: int) -> tuple[list[float], int]:
    """Time of each warm BESO step, the first (cold) left out, and the most force left over."""
    times = [time.perf_counter()]
    residuals = []

    def told(number, step):
        times.append(time.perf_counter())
        residuals.append(step.residual_n)
        if number == steps:
            raise Enough

    with pytest.raises(Enough):
        optimise(simulation, 0.15, progress=told)
    return list(np.diff(times)[1:]), max(residuals)


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Compilation is paid once a machine; it is not what is measured."""
    simulation = worn("coarse").simulation
    simulation.solve(simulation.designable)


def factor_s(simulation, times: int = 5) -> float:
    """Seconds of one factorisation of the stiffness by the solver in use: what every cost here is counted in."""
    values = simulation.state(simulation.solve(simulation.designable).positions_m).stiffness(0.0)
    return min(seconds(lambda: simulation._solver.factorise(values)) for _ in range(times))


@pytest.mark.parametrize("solver", installed_solvers())
def test_a_warm_step_at_7k_vertices(bench, solver):
    simulation = worn("standard", solver).simulation
    taken, residual = step_seconds(simulation, STEPS)
    factor = factor_s(simulation)
    what = f"BESO step, {len(simulation.rest.vertices_m)} vertices, {solver}"
    bench.note(f"{what}: median, 95th percentile s", f"{np.median(taken):.3f}, {np.quantile(taken, 0.95):.3f}")
    bench.ratio(f"garment.step.{solver}", f"{what}: in factorisations", float(np.median(taken)) / factor, at_most=35)
    assert residual <= 1e-7


def test_a_whole_elbow_design_at_1_8k_vertices(bench):
    simulation = worn("draft").simulation
    designs = []
    taken = seconds(lambda: designs.append(optimise(simulation, 0.15)))
    steps = designs[0].steps
    what = f"elbow design, {len(simulation.rest.vertices_m)} vertices, {len(steps)} steps"
    bench.note(f"{what}: s", f"{taken:.1f}")
    bench.ratio("garment.design", f"{what}: factorisations a step", taken / len(steps) / factor_s(simulation), at_most=45)
    assert all(step.residual_n <= 1e-7 for step in steps)


def test_a_cold_equilibrium_at_28k_vertices(bench):
    simulation = worn("reference").simulation
    found = []
    taken = seconds(lambda: found.append(simulation.solve(simulation.designable)))
    factor = factor_s(simulation, 3)
    bench.note(f"cold equilibrium, {len(simulation.rest.vertices_m)} vertices: s", f"{taken:.1f}")
    bench.note("its steps, and the force left over in N (at most 1e-07)", f"{found[0].iterations}, {found[0].residual_n:.0e}")
    bench.ratio("garment.cold", "cold equilibrium, 28k vertices: in factorisations", taken / factor, at_most=250)
    assert found[0].converged
    assert found[0].residual_n <= 1e-7


def test_newton_and_l_bfgs_on_the_same_problem(bench):
    """L-BFGS with what a user would take: scipy's, and torch's where it is installed, on the same energy and gradient.

    Given thirty times Newton's time each; what is compared is the force that they have left over then.
    """
    simulation = worn("draft").simulation
    found = []
    taken = seconds(lambda: found.append(simulation.solve(simulation.designable)))
    bench.note("cold equilibrium at 1.8k, Newton: s, and the force left over in N", f"{taken:.2f}, {found[0].residual_n:.0e}")
    rivals = {"scipy": l_bfgs_scipy}
    if find_spec("torch"):
        rivals["torch"] = l_bfgs_torch
    for name, rival in rivals.items():
        used, residual, energy = rival(simulation, 30 * taken)
        above = 1e6 * (energy / total_j(simulation, found[0]) - 1)
        bench.note(f"L-BFGS of {name}: s, force left over in N, energy above in 1e-6", f"{used:.2f}, {residual:.0e}, {above:.1f}")
        what = f"force left over by L-BFGS of {name} in thirty times Newton's time, over Newton's"
        bench.ratio(f"garment.l_bfgs.{name}", what, residual / found[0].residual_n, at_least=10)


def total_j(simulation, found) -> float:
    return simulation.state(found.positions_m).energy_j


class OutOfTime(Exception):
    """The time allowed is used up."""


class Watched:
    """Energy and gradient of the worn garment as a function of a flat vector, noting the least force seen, until time is up."""

    def __init__(self, simulation, allowed_s: float):
        simulation.solve(simulation.designable)  # the same homes as Newton's solution
        self.simulation, self.shape = simulation, simulation.rest.vertices_m.shape
        self.start = simulation._skin.copy_m
        self.end = time.perf_counter() + allowed_s
        self.residual, self.energy = np.inf, np.inf

    def __call__(self, flat: np.ndarray) -> tuple[float, np.ndarray]:
        if time.perf_counter() > self.end:
            raise OutOfTime
        state = self.simulation.state(flat.reshape(self.shape))
        residual = float(np.linalg.norm(state.force_n))
        if residual < self.residual:
            self.residual, self.energy = residual, state.energy_j
        return state.energy_j, state.force_n.ravel()


def l_bfgs_scipy(simulation, allowed_s: float) -> tuple[float, float, float]:
    from scipy.optimize import minimize

    watched = Watched(simulation, allowed_s)
    options = {"maxiter": 10**6, "maxfun": 10**6, "ftol": 0.0, "gtol": 0.0, "maxcor": 20}

    def run():
        with contextlib.suppress(OutOfTime):
            minimize(watched, watched.start.ravel(), jac=True, method="L-BFGS-B", options=options)

    return seconds(run), watched.residual, watched.energy


def l_bfgs_torch(simulation, allowed_s: float) -> tuple[float, float, float]:
    import torch

    watched = Watched(simulation, allowed_s)
    x = torch.tensor(watched.start.ravel(), requires_grad=True)
    options = {"max_iter": 10**6, "max_eval": 10**6, "tolerance_grad": 0.0, "tolerance_change": 0.0, "history_size": 20}
    optimiser = torch.optim.LBFGS([x], line_search_fn="strong_wolfe", **options)

    def closure():
        energy, gradient = watched(x.detach().numpy())
        x.grad = torch.from_numpy(gradient.copy())
        return torch.tensor(energy)

    def run():
        with contextlib.suppress(OutOfTime):
            optimiser.step(closure)

    return seconds(run), watched.residual, watched.energy


def test_cost_grows_with_the_mesh_as_memory_lets_it(bench):
    """From 467 to 28,712 vertices: what is done element by element, beside a sweep of the same size; and the factorisation."""
    vertices, element, sweep, factor, whole, energy = [], [], [], [], [], []
    for level in LEVELS:
        simulation = worn(level).simulation
        found = []
        whole.append(seconds(lambda s=simulation, f=found: f.append(s.solve(s.designable))))
        x = found[0].positions_m
        energy.append(found[0].energy_j)
        values = simulation.state(x).stiffness(0.0)

        def by_element(s=simulation, x=x):
            state = s.state(x)
            state.stiffness(0.0)

        beside = gathered(len(x))
        pairs = [(seconds(by_element), seconds(beside)) for _ in range(7)]
        vertices.append(len(x))
        element.append(min(one for one, _ in pairs))
        sweep.append(min(other for _, other in pairs))
        factor.append(min(seconds(lambda s=simulation, v=values: s._solver.factorise(v)) for _ in range(5)))
        parts = f"{1e3 * element[-1]:.1f}, {1e3 * factor[-1]:.1f}, {1e3 * whole[-1]:.0f}"
        bench.note(f"{vertices[-1]} vertices: by element, factor ({simulation.solver_name}), cold equilibrium: ms", parts)
    for count, stored in zip(vertices, energy, strict=True):
        bench.note(f"{count} vertices: energy against the finest mesh, %", f"{100 * (stored / energy[-1] - 1):+.2f}")
    growth = np.polyfit(np.log(vertices[1:]), np.log(element[1:]), 1)[0]
    bench.note("power of the vertices by which the part by element grows, 1.8k to 28k", f"{growth:.2f}")
    grown = (element[-1] / element[1]) / (sweep[-1] / sweep[1])
    bench.ratio("garment.growth", "growth of the part by element, 1.8k to 28k, over a memory sweep's", grown, at_most=2)
    draw(vertices, element, factor, whole)


def test_following_a_motion_at_the_coarsest_level(bench):
    motion = worn("coarse")
    angles = motion.motion.path(motion.angle_deg, 30)
    taken = seconds(lambda: evaluate_motion(motion, motion.simulation.designable, angles))
    bench.note("following an elbow at 467 vertices: ms a step of 2 degrees, torque and all", f"{1e3 * taken / len(angles):.0f}")
    a_step = taken / len(angles) / factor_s(motion.simulation, 9)
    bench.ratio("garment.follow", "following an elbow at 467 vertices: a step, in factorisations", a_step, at_most=200)


def draw(vertices, element, factor, whole) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
    for times, label in ((whole, "cold equilibrium"), (factor, "factor of the stiffness"), (element, "energy, force, stiffness")):
        axes.loglog(vertices, times, "o-", label=label)
    linear = element[-1] * np.array(vertices) / vertices[-1]
    axes.loglog(vertices, linear, "k:", lw=1, label="in proportion to the vertices")
    axes.set_xlabel("vertices of the sleeve")
    axes.set_ylabel("time, s")
    axes.grid(True, which="both", alpha=0.25)
    axes.legend()
    figure.savefig(PICTURE, dpi=110)
    plt.close(figure)
