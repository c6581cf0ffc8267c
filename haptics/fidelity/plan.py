"""The plan: which devices, sites and models a scene needs at all, and at which level each model runs.

What a scene cannot ask for does not exist: no brake, no model, no link for a scene without grasps or clutches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from haptics.physics.latch import LEVELS as LATCH_LEVELS
from haptics.scene.scene import Scene

LATCH_LEVEL = "dynamic"
BRAKE_LEVEL = "lagged"
assert LATCH_LEVEL in LATCH_LEVELS


@dataclass(frozen=True, slots=True)
class PlanRow:
    """One device that exists, its model, the level, and why in a sentence."""

    device: str
    model: str
    level: str
    why: str


@dataclass(frozen=True, slots=True)
class Absence:
    """One device or object that does not exist in this run, and why."""

    device: str
    why: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What exists in a run of one scene."""

    scene: str
    rows: tuple[PlanRow, ...]
    absent: tuple[Absence, ...]

    def builds(self, device: str) -> bool:
        """Whether a device exists in this plan."""
        return any(row.device == device for row in self.rows)

    @property
    def levels(self) -> dict[str, str]:
        """Level of each simulated board, by its name."""
        return {row.device: row.level for row in self.rows if row.device == "tactiles"}


def plan_scene(scene: Scene) -> Plan:
    """The plan for a scene, from what it can ask for (``Scene.needs``)."""
    needs = scene.needs
    rows: list[PlanRow] = []
    absent: list[Absence] = [Absence(name, why) for name, why in scene.absent]
    if needs.tactiles:
        driven = sorted(set(needs.pins) | set(needs.pulses))
        why = f"{_count(driven, 'site')} driven: {_modes(needs.pins, needs.pulses)}; its flight decides when a touch is felt"
        rows.append(PlanRow("tactiles", "latch", LATCH_LEVEL, why))
        rows.append(PlanRow("heat", "thermal", "exact", "first-order heat has a closed form: nothing is cheaper"))
    else:
        absent.append(Absence("tactiles", "nothing in the scene touches, fills a set of sites, or plays a pattern"))
    if needs.brakes or needs.clutches:
        what = [*needs.brakes, *needs.clutches]
        why = f"{_count(what, 'output')}: {', '.join(what)}; contact memory decides force at polarity reversal and after release"
        rows.append(PlanRow("brake", "brake", BRAKE_LEVEL, why))
    else:
        absent.append(Absence("brake", "nothing in the scene is grasped with brakes, and no rule engages a clutch"))
    if needs.piezos:
        rows.append(PlanRow("piezo", "burst", "envelope", "one 240 Hz burst of fixed length when a grasp begins"))
    else:
        absent.append(Absence("piezo", "no grasp in the scene shakes a fingertip"))
    return Plan(scene.name, tuple(rows), tuple(absent))


def _count(names: Sequence[str], what: str) -> str:
    return f"{len(names)} {what}{'' if len(names) == 1 else 's'}"


def _modes(pins: Sequence[str], pulses: Sequence[str]) -> str:
    modes = [(pins, "contact"), (pulses, "pulse")]
    return " and ".join(f"{len(sites)} in {mode} mode" for sites, mode in modes if sites)
