"""The plan: which devices, sites and models a scene needs at all, and the cheapest level of each whose error nobody would feel.

What a scene cannot ask for does not exist: no brake, no model, no link for a scene without grasps or clutches; no tactor at a
site that no effect drives. Of what exists, every level's measured error (``measure``, worst of the typical cases) is held
against what a person would notice (``notice``); the cheapest level that stays below in every observable is taken. Where even
that costs more than the time there is, accuracy is given up where it is felt least, and the row gives the reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from haptics.errors import InputError
from haptics.fidelity.measured import Measured, MeasuredRow, shipped
from haptics.fidelity.notice import DEFAULT_TOLERANCE_JND, NOTICES, Notice, force_notice, rate_notice
from haptics.physics.brake import levels as brake
from haptics.physics.latch import pulse as latch
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES
from haptics.units import in_range, one_of

DEFAULT_BUDGET = 0.5
"""CPU seconds that the models may take of each second (assumed: half a core, the rest for loop, links and recording)."""
LADDERS = {"latch": latch.LEVELS, "brake": brake.LEVELS}
"""Levels from cheap to exact, of the models that have a choice."""
BOARDS = {"latch": "tactiles", "brake": "brake"}
"""The board whose simulation runs a model."""


@dataclass(frozen=True, slots=True)
class PlanRow:
    """One device that exists, its model, the level, and why in a sentence.

    :param device: tactiles, heat, brake or piezo.
    :param model: that runs it.
    :param level: of the model.
    :param error: worst typical error, in ``unit``, of ``observable``; None where a model has no choice of level.
    :param limit: error that is allowed.
    :param observable: the one that comes nearest to being noticed.
    :param unit: of both.
    :param count: devices of this kind.
    :param cost_s_per_s: CPU seconds that all of them take each second.
    :param why: in a sentence.
    """

    device: str
    model: str
    level: str
    error: float | None
    limit: float | None
    observable: str
    unit: str
    count: int
    cost_s_per_s: float
    why: str


@dataclass(frozen=True, slots=True)
class Absence:
    """One device or object that does not exist in this run, and why.

    :param device: name of it.
    :param why: in a sentence.
    """

    device: str
    why: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What exists in a run of one scene.

    :param scene: name of it.
    :param tolerance: fraction of what is just noticed that a model may be off by.
    :param rows: of the devices that exist.
    :param absent: what does not exist.
    :param sites: that have a tactor.
    :param outputs: brakes or piezos, whichever are more.
    :param over_budget: empty, or why no plan keeps within the time.
    """

    scene: str
    tolerance: float
    rows: tuple[PlanRow, ...]
    absent: tuple[Absence, ...]
    sites: tuple[str, ...] = ()
    outputs: int = 0
    over_budget: str = ""

    def builds(self, device: str) -> bool:
        """Whether a device exists in this plan.

        :param device: tactiles, heat, brake or piezo.
        :return: True if it does.
        """
        return any(row.device == device for row in self.rows)

    @property
    def levels(self) -> dict[str, str]:
        """Level of each simulated board, by its name."""
        return {BOARDS[row.model]: row.level for row in self.rows if row.model in BOARDS}


def plan_scene(
    scene: Scene,
    tolerance_jnd: float = DEFAULT_TOLERANCE_JND,
    budget_s_per_s: float = DEFAULT_BUDGET,
    levels: dict[str, str] | None = None,
    amplitude_v: float | None = None,
    measured: Measured | None = None,
) -> Plan:
    """The plan for a scene, from what it can ask for (``Scene.needs``).

    :param scene: what is to be run.
    :param tolerance_jnd: fraction of what is just noticed that a model may be off by, 0.001 to 10; a third by default.
    :param budget_s_per_s: CPU seconds a second for all models, more than 0. The plan is the same for the same numbers: asked
        again with more, accuracy comes back.
    :param levels: a level for ``latch`` or ``brake`` that is taken whatever it costs or errs.
    :param amplitude_v: of the brakes (V), 0 to 1500; the scene's own by default.
    :param measured: errors and costs; the shipped ones by default.
    :return: the plan.
    :raises InputError: a number outside its range, an unknown model or level, or a level that was not measured.
    """
    in_range("tolerance_jnd", tolerance_jnd, 1e-3, 10.0)
    in_range("budget", budget_s_per_s, 1e-9, 1e3, "s/s")
    for model, level in (levels or {}).items():
        one_of(f"level of {one_of('model', model, tuple(LADDERS))}", level, LADDERS[model])
    needs, measured = scene.needs, shipped() if measured is None else measured
    absent = [Absence(name, why) for name, why in scene.absent]
    choices: list[_Choice] = []
    rows: list[PlanRow] = []
    sites = tuple(site for site in SITES if site in {*needs.pins, *needs.pulses})
    outputs = [*needs.brakes, *needs.clutches]
    if needs.tactiles:
        what = f"{_count(sites, 'site')} driven: {_modes(needs.pins, needs.pulses)}"
        notices = _latch_notices(needs.patterns, needs.refresh_hz)
        choices.append(_choose("tactiles", "latch", len(sites), what, notices, tolerance_jnd, levels, measured))
        if len(sites) < len(SITES):
            idle = [site for site in SITES if site not in sites]
            absent.append(Absence("actuators", f"{_count(idle, 'site')} not built: no effect drives {', '.join(idle)}"))
    else:
        absent.append(Absence("tactiles", "nothing in the scene touches, fills a set of sites, or plays a pattern"))
    if outputs:
        volts = needs.brake_v if amplitude_v is None else amplitude_v
        notices = [NOTICES[name] for name in ("response time", "release time", "ripple")]
        notices += [force_notice(finger, volts) for finger in needs.brakes]
        if needs.clutches:
            notices.append(Notice("plateau", "%", 10.0, 10.0 / 3.0, "assumed", "joint torque of a garment"))
        what = f"{_count(outputs, 'output')}: {', '.join(outputs)}"
        choices.append(_choose("brake", "brake", len(outputs), what, notices, tolerance_jnd, levels, measured))
    else:
        absent.append(Absence("brake", "nothing in the scene is grasped with brakes, and no rule engages a clutch"))
    choices, over_budget = _within(choices, budget_s_per_s)
    for choice in choices:
        rows.append(choice.row())
        if choice.model == "latch":
            rows.append(_heat(len(sites), tolerance_jnd, measured))
    if needs.piezos:
        why = "one 240 Hz burst of fixed length when a grasp begins: an envelope is all there is to it"
        rows.append(PlanRow("piezo", "burst", "envelope", None, None, "", "", len(needs.piezos), 0.0, why))
    else:
        absent.append(Absence("piezo", "no grasp in the scene shakes a fingertip"))
    count = max(len(outputs), len(needs.piezos))
    return Plan(scene.name, tolerance_jnd, tuple(rows), tuple(absent), sites, count, over_budget)


@dataclass(frozen=True, slots=True)
class _Tried:
    """One observable of one level: its error and what is allowed."""

    notice: Notice
    error: float
    limit: float

    @property
    def ratio(self) -> float:
        """Error in terms of the limit; infinite for any error where none is allowed."""
        return self.error / self.limit if self.limit else (float("inf") if self.error else 0.0)

    def __str__(self) -> str:
        return f"{self.notice.observable} {_number(self.error)} {self.notice.unit} of {_number(self.limit)}"


@dataclass(frozen=True, slots=True)
class _Choice:
    """A device with its ladder judged; ``at`` is the rung taken."""

    device: str
    model: str
    count: int
    what: str
    ladder: tuple[tuple[str, tuple[_Tried, ...], float], ...]
    at: int
    due: int
    forced: bool

    @property
    def cost_s_per_s(self) -> float:
        return self.ladder[self.at][2]

    @property
    def worst(self) -> _Tried:
        return max(self.ladder[self.at][1], key=lambda tried: tried.ratio)

    def row(self) -> PlanRow:
        level, tried, cost = self.ladder[self.at]
        near = self.worst
        if self.forced:
            why = f"level {level} was asked for"
        elif self.at < self.due:
            over = [str(t) for t in tried if t.ratio > 1.0]
            due = self.ladder[self.due][0]
            why = f"level {level} for want of time, though {', '.join(over)} would be noticed; level {due} is due"
        elif self.at == 0:
            why = f"the cheapest level is unnoticed: {near}"
        else:
            cheaper, of_cheaper, _ = self.ladder[self.at - 1]
            refused = max(of_cheaper, key=lambda t: t.ratio)
            why = f"level {level} is unnoticed ({near}); {cheaper} would be off by {refused}"
        observable, unit = near.notice.observable, near.notice.unit
        return PlanRow(
            self.device, self.model, level, near.error, near.limit, observable, unit, self.count, cost, f"{self.what}; {why}"
        )  # fmt: skip


def _choose(
    device: str, model: str, count: int, what: str, notices: Sequence[Notice], tolerance_jnd: float,
    levels: dict[str, str] | None, measured: Measured,
) -> _Choice:  # fmt: skip
    """Judge a model's ladder; take the level asked for, or the first that stays below every limit (the last, if none does)."""
    names, ladder = LADDERS[model], []
    for level in names:
        rows = [(notice, measured.row(model, level, notice.observable)) for notice in notices]
        tried = tuple(_Tried(notice, _error(notice, row), notice.limit(tolerance_jnd)) for notice, row in rows)
        ladder.append((level, tried, _cost(rows[0][1], count)))
    due = next((k for k, (_, tried, _) in enumerate(ladder) if all(t.ratio <= 1.0 for t in tried)), len(ladder) - 1)
    asked = (levels or {}).get(model)
    at = due if asked is None else names.index(asked)
    return _Choice(device, model, count, what, tuple(ladder), at, due, asked is not None)


def _within(choices: list[_Choice], budget_s_per_s: float) -> tuple[list[_Choice], str]:
    """Step down where it is felt least until the cost is within the budget; and a sentence if it never is."""
    while sum(choice.cost_s_per_s for choice in choices) > budget_s_per_s:
        # A lower rung of the ladder is worth taking only if it is cheaper.
        lower = {
            k: replace(choice, at=rung)
            for k, choice in enumerate(choices)
            if not choice.forced
            for rung in [next((r for r in range(choice.at - 1, -1, -1) if choice.ladder[r][2] < choice.cost_s_per_s), None)]
            if rung is not None
        }
        if not lower:
            cost = sum(choice.cost_s_per_s for choice in choices)
            return choices, f"the models take {cost:.2g} CPU seconds a second, more than the {budget_s_per_s:.2g} there are"
        k = min(lower, key=lambda k: lower[k].worst.ratio)
        choices = [*choices[:k], lower[k], *choices[k + 1 :]]
    return choices, ""


def _heat(count: int, tolerance_jnd: float, measured: Measured) -> PlanRow:
    row = measured.row("thermal", "exact", "temperature")
    stuck = measured.row("thermal", "exact", "coil temperature", "edge")
    limit = NOTICES["temperature"].limit(tolerance_jnd)
    why = (
        "exact at any step, so nothing is cheaper; two nodes differ only in a coil that stays on "
        f"(by up to {_number(stuck.worst)} K inside it), which a limit on time prevents"
    )
    return PlanRow("heat", "thermal", "exact", row.worst, limit, "temperature", "K", count, _cost(row, count), why)


def _latch_notices(patterns: Iterable[str], refresh_hz: float) -> list[Notice]:
    notices = [NOTICES[name] for name in ("wrong final state", "arrival time", "impact speed", "energy", "temperature")]
    for pattern in patterns:
        # The rate of a pattern is felt from arrival to arrival: an error of arrival is one of the refresh period, in per cent.
        of_rate = rate_notice(pattern)
        as_ms = 10.0 / refresh_hz
        notices.append(
            replace(
                of_rate,
                observable="arrival time",
                unit="ms",
                threshold=of_rate.threshold * as_ms,
                tolerance=of_rate.tolerance * as_ms,
            )
        )
    return notices


def _error(notice: Notice, row: MeasuredRow) -> float:
    """What is held against a limit: the worst of the typical cases."""
    if notice.unit != row.unit:
        raise InputError(f"{row.model}, {row.observable}: measured in {row.unit}, judged in {notice.unit}")
    return row.worst


def _cost(row: MeasuredRow, count: int) -> float:
    """Boards carry their devices one by one."""
    return row.cost_s_per_sim_s["1"] * count


def _count(names: Sequence[str], what: str) -> str:
    return f"{len(names)} {what}{'' if len(names) == 1 else 's'}"


def _modes(pins: Sequence[str], pulses: Sequence[str]) -> str:
    modes = [(pins, "contact"), (pulses, "pulse")]
    return " and ".join(f"{len(sites)} in {mode} mode" for sites, mode in modes if sites)


def _number(value: float) -> str:
    return f"{value:.2g}"
