"""A design over a whole motion, beside another of the same area: what each makes of its area, and how hard it is to move."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptics.errors import InputError, LimitError
from haptics.garments.design.drawn import SHAPES, best_drawn
from haptics.garments.design.job import DesignJob, open_designs, put_on, slow_notice
from haptics.garments.design.masks import MASKS, read_mask, with_coverage
from haptics.garments.design.rating import Densities, Unconverged, coverage_of, solved
from haptics.garments.equilibrium.simulation import Equilibrium
from haptics.garments.equilibrium.wearing import MotionEvaluation, WornMotion, evaluate_motion
from haptics.garments.mesh import Bools
from haptics.units import in_range

ANGLES = 18
"""Parts that a motion is divided into, unless asked for otherwise."""


@dataclass(frozen=True, eq=False)
class Rated:
    """A design at the end of a motion and at the angles before.

    :param name: what a person calls it: step, shape or file.
    :param design: reinforced triangles, ``(triangles,)``.
    :param coverage: reinforced over designable area, 0 to 1.
    :param density: energy by reinforced area over that of the fully reinforced garment, as in ``DesignStep``.
    :param density_eq65: the same of the whole garment's energy (eq. 6.5).
    :param motion: energy and torque by angle.
    :param place: where a drawn design lies, for people; empty for others.
    """

    name: str
    design: Bools
    coverage: float
    density: float
    density_eq65: float
    motion: MotionEvaluation
    place: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain data.

        :return: JSON-ready; units are in the keys.
        """
        return {
            "name": self.name,
            "place": self.place,
            "coverage": self.coverage,
            "density_increase": self.density,
            "density_increase_eq65": self.density_eq65,
            "converged": self.motion.converged,
            "angles_deg": self.motion.angles_deg.tolist(),
            "energy_j": self.motion.energy_j.tolist(),
            "stored_j": self.motion.stored_j.tolist(),
            "torque_n_m": self.motion.torque_n_m.tolist(),
            "residual_n": [state.residual_n for state in self.motion.equilibria],
        }


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A design, and what it was compared with.

    :param settings: garment, motion, angle, body, level; plain data.
    :param worn: the garment on its body.
    :param rated: the design.
    :param against: what it was compared with; None where with nothing.
    :param notes: what was mended of meshes, and what they cost, for people.
    """

    settings: Mapping[str, Any]
    worn: WornMotion
    rated: Rated
    against: Rated | None
    notes: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        """Every equilibrium was found."""
        return self.rated.motion.converged and (self.against is None or self.against.motion.converged)

    def to_json(self) -> dict[str, Any]:
        """Plain data.

        :return: JSON-ready; units are in the keys.
        """
        against = None if self.against is None else self.against.to_json()
        return {**self.settings, **self.rated.to_json(), "against": against, "notes": list(self.notes)}


def evaluate_design(
    path: Path,
    job: DesignJob | None = None,
    motion: str | None = None,
    angle_deg: float | None = None,
    against: str | None = None,
    steps: int = ANGLES,
    step: int | None = None,
    coverage: float | None = None,
    units: str | None = None,
    up: str | None = None,
    warn: Callable[[str], None] | None = None,
) -> Evaluation:
    """Rate a design over a motion.

    :param path: a design sequence (file or folder), or a mask as ``masks.read_mask`` takes it.
    :param job: what a mask is worn on and in; None with a design sequence, which holds its own.
    :param motion: another motion than the sequence's; None takes that.
    :param angle_deg: how far, degrees from straight; None takes the sequence's angle, or the other motion's default.
    :param against: ``line``, ``x`` or a mask, drawn with the same area.
    :param steps: parts of the motion, 1 to 1000.
    :param step: step of the sequence, from 0; None: see ``coverage``.
    :param coverage: chooses a design of the sequence, the one asked for if None; a mask is grown or trimmed to it.
    :param units: of masks that are meshes, as ``read_mesh`` takes them; the garment's own are the job's, or the sequence's.
    :param up: of masks that are meshes, as ``read_mesh`` takes it.
    :param warn: called, before anything takes long, with what will; None: nobody is.
    :return: the design's density and curves, and the other's beside it.
    :raises InputError: a file, name or number that is not allowed.
    :raises LimitError: no equilibrium at the end of the motion, so that nothing can be rated.
    """
    in_range("steps", steps, 1, 1000)
    if against is not None and against not in SHAPES:
        _is_mask(Path(against), f"{', '.join(SHAPES)}, or a mask")
    if path.suffix.lower() in MASKS:
        _is_mask(path, "a mask")
        if job is None:
            raise InputError(f"{path} is a mask, which records no garment and no motion; pass --garment and --motion with it")
        if step is not None:
            raise InputError(f"step = {step}: {path} is a mask, a single design; pass --step only with a design sequence")
        worn = put_on(job)
        notes = list(worn.garment.notes)
        design, name = _mask(worn, path, coverage, units, up, notes), path.name
        settings = {"garment": job.garment, "motion": job.motion, "body": job.body, "phenotype": dict(job.phenotype)}
        settings["level"] = job.level
    else:
        if job is not None:
            raise InputError(f"{path} already records its garment and body; pass --garment/--body only with a mask")
        kept = open_designs(path, motion, angle_deg)
        notes = list(kept.worn.garment.notes)
        number, chosen = kept.step(step, coverage)
        worn, design, name = kept.worn, chosen.design, f"step {number}"
        settings = {key: kept.settings[key] for key in ("garment", "body", "phenotype", "level")} | {
            "motion": worn.motion.name,
            "step": number,
        }
    settings |= {"angle_deg": worn.angle_deg, "solver": worn.simulation.solver_name}
    slow = slow_notice(worn, 2 + steps, "equilibria")
    if slow is not None:
        notes.append(slow)
        if warn is not None:
            warn(slow)
    try:
        full = solved(worn.simulation, worn.simulation.designable)
        rated = _rated(worn, full, name, design, steps)
        other = None if against is None else _opponent(worn, full, against, rated.coverage, steps, units, up, notes)
    except Unconverged as error:
        raise LimitError(f"{path}: {error}") from error
    return Evaluation(settings, worn, rated, other, tuple(notes))


def _rated(worn: WornMotion, full: Equilibrium, name: str, design: Bools, steps: int, place: str = "") -> Rated:
    cloth = worn.simulation
    whole = Densities.of(cloth.designable, cloth.areas_m2, full.element_energy_j)
    state = solved(cloth, design, full.positions_m)
    ratio = Densities.of(design, cloth.areas_m2, state.element_energy_j).over(whole)
    motion = evaluate_motion(worn, design, worn.motion.path(worn.angle_deg, steps))
    return Rated(name, design, coverage_of(cloth, design), ratio.reinforced_j_m2, ratio.eq65_j_m2, motion, place)


def _opponent(
    worn: WornMotion,
    full: Equilibrium,
    against: str,
    coverage: float,
    steps: int,
    units: str | None,
    up: str | None,
    notes: list[str],
) -> Rated:
    if against in SHAPES:
        best = best_drawn(worn.simulation, against, coverage, full)
        return _rated(worn, full, against, best.design, steps, best.place)
    path = Path(against)
    return _rated(worn, full, path.name, _mask(worn, path, coverage, units, up, notes), steps)


def _is_mask(path: Path, expected: str) -> None:
    if path.suffix.lower() not in MASKS or not path.is_file():
        raise InputError(f"{path}: no such design; expected {expected}, a file that ends in {', '.join(MASKS)}")


def _mask(worn: WornMotion, path: Path, coverage: float | None, units: str | None, up: str | None, notes: list[str]) -> Bools:
    rest = worn.simulation.rest.at(worn.garment.on(worn.body.straight_m))
    mask = read_mask(path, rest, units=units, up=up, note=notes.append)
    return mask if coverage is None else with_coverage(mask, rest, worn.simulation.designable, coverage)
