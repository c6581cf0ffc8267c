"""What a design is made for, kept beside it: from that the same garment can be put on the same body again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.garments.bodies import MOTIONS, Body, Motion, open_body
from haptics.garments.design.designs import COVERAGE_TOLERANCE, DesignSequence, DesignStep, asked_for, read_designs
from haptics.garments.design.topology import SMALLEST_COVERAGE
from haptics.garments.equilibrium.cholesky import installed_solvers
from haptics.garments.equilibrium.wearing import WornMotion, wear
from haptics.garments.garment import LEVELS, OWN, Garment, mesh_of, open_garment, refuse_frame
from haptics.garments.materials import CLOTH, INTERFACE, REINFORCED, Interface, Lame, Material, ReinforcedMaterial
from haptics.garments.mesh import SurfaceMesh
from haptics.meshes import AXES, UNITS
from haptics.units import in_range, one_of

STORE = "designs.h5"
"""Name of the design sequence in a design's folder."""
MIN_STRETCH = 1e-3
"""A motion that changes no edge of the garment by more than this part does not load it."""

FAST_VERTICES = 8000
"""A drawn mesh of this many vertices costs as much as level ``standard``."""
STANDARD_STEP_S, STEP_POWER = 0.5, 1.17
"""Time of a warm step of level ``standard`` on one core, and the power of its growth with the vertices: measured
(docs/explanation/garments.md)."""


@dataclass(frozen=True)
class DesignJob:
    """A garment, a motion, and how finely they are computed.

    :param garment: one of ``GARMENTS``, or the file of a mesh around the straight body.
    :param motion: one of ``MOTIONS``.
    :param coverage: reinforced over designable area, 0.01 to 1.
    :param angle_deg: how far, degrees from straight; None takes the motion's default.
    :param level: one of ``LEVELS``; ``OWN`` for a mesh.
    :param body: one of ``BODIES``.
    :param phenotype: of the body, as ``open_body`` takes it.
    :param solver: see ``cholesky.installed_solvers``; None takes the fastest.
    :param lame: `plane` or `thesis`, see ``Material.lame_n_m``.
    :param units: of a mesh, as ``read_mesh`` takes them; None: metres.
    :param up: of a mesh, as ``read_mesh`` takes it; None: z.
    :raises InputError: a name or number that is not allowed.
    """

    garment: str
    motion: str
    coverage: float = 1.0
    angle_deg: float | None = None
    level: str = "draft"
    body: str = "capsule"
    phenotype: Mapping[str, float] = field(default_factory=dict)
    solver: str | None = None
    lame: Lame = "plane"
    units: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        if mesh_of(self.garment) is None:
            one_of("level", self.level, tuple(LEVELS))
            refuse_frame(self.garment, self.units, self.up)
        else:
            one_of("level of a garment from a mesh", self.level, (OWN,))
        one_of("motion", self.motion, tuple(MOTIONS))
        one_of("lame", self.lame, ("plane", "thesis"))
        in_range("coverage", self.coverage, SMALLEST_COVERAGE, 1.0)
        MOTIONS[self.motion].checked_deg(self.angle_deg)
        if self.units is not None:
            one_of("units", self.units, tuple(UNITS))
        if self.up is not None:
            one_of("up", self.up, AXES)
        if self.solver is not None:
            one_of("solver", self.solver, installed_solvers())

    @property
    def frame(self) -> dict[str, str]:
        """``units`` and ``up``, those given."""
        given = {"units": self.units, "up": self.up}
        return {key: value for key, value in given.items() if value is not None}


def put_on(job: DesignJob) -> WornMotion:
    """The job's garment on the job's body, in the motion.

    :param job: what to wear, and how.
    :return: the garment at rest where the motion starts, worn where it ends.
    :raises InputError: a body or a solver that is not installed, or a motion that does not stretch the garment.
    """
    body = open_body(job.body, job.phenotype)
    garment, motion = open_garment(body, job.garment, job.level, **job.frame), MOTIONS[job.motion]
    refuse_unloaded(body, garment, motion, motion.checked_deg(job.angle_deg))
    return wear(body, garment, motion, job.angle_deg, lame=job.lame, solver=job.solver)


def settings_of(job: DesignJob, worn: WornMotion) -> dict[str, Any]:
    """All that the job's designs depend on, as plain data.

    :param job: what is worn, and how.
    :param worn: the same, put on: its angle and solver are those used.
    :return: plain JSON data, to be kept by a ``DesignStore``.
    """
    return {
        **_garment_of(job.garment),
        **job.frame,
        "motion": job.motion,
        "coverage": job.coverage,
        "angle_deg": worn.angle_deg,
        "level": job.level,
        "body": job.body,
        "phenotype": dict(job.phenotype),
        "solver": worn.simulation.solver_name,
        "lame": job.lame,
        "cloth": asdict(CLOTH),
        "reinforced": asdict(REINFORCED),
        "interface": asdict(INTERFACE),
    }


@dataclass(frozen=True, eq=False)
class KeptDesigns:
    """A design sequence that was read, on its body again.

    :param path: the file.
    :param settings: what it was made for and with.
    :param sequence: what was read.
    :param worn: the garment on its body, at the end of the motion.
    """

    path: Path
    settings: dict[str, Any]
    sequence: DesignSequence
    worn: WornMotion

    def step(self, number: int | None = None, coverage: float | None = None) -> tuple[int, DesignStep]:
        """One design with its number: that step, or the one for a coverage; the one that was asked for if neither is given.

        For a coverage: of the steps that have it the densest, else the nearest.

        :param number: step from 0; None: see ``coverage``.
        :param coverage: reinforced over designable area, from that of the last step to 1; None: see ``number``.
        :return: number and design.
        :raises InputError: both, or a step or coverage out of range.
        """
        steps = self.sequence.steps
        if number is not None and coverage is not None:
            raise InputError(f"step = {number} and coverage = {coverage:g}; pass only one of the two")
        if number is not None:
            chosen = steps[int(in_range("step", number, 0, len(steps) - 1))]
        elif coverage is not None:
            in_range("coverage", coverage, min(step.coverage for step in steps) - COVERAGE_TOLERANCE, 1.0)
            nearest = min(steps, key=lambda step: abs(step.coverage - coverage))
            chosen = nearest if abs(nearest.coverage - coverage) > COVERAGE_TOLERANCE else asked_for(steps, coverage)
        else:
            chosen = self.sequence.final
        return steps.index(chosen), chosen


def open_designs(path: Path, motion: str | None = None, angle_deg: float | None = None) -> KeptDesigns:
    """Read a design sequence and put its garment on its body again.

    :param path: the file, or the folder of ``haptics garment design``.
    :param motion: another motion to wear it in; None takes the design's.
    :param angle_deg: how far, degrees from straight; None takes the design's angle, or the other motion's default.
    :return: the sequence with its garment, put on.
    :raises InputError: no such file, a garment's mesh that has changed, or a garment that this version, on this machine, makes
        otherwise.
    """
    file = path / STORE if path.is_dir() else path
    settings, sequence = read_designs(file)
    for key, value in _garment_of(settings["garment"]).items():
        if settings.get(key) != value:
            raise InputError(
                f"{file}: the mesh {settings['garment']} has changed since these designs were made; restore it, or design anew"
            )
    body = open_body(settings["body"], settings["phenotype"])
    garment = open_garment(body, settings["garment"], settings["level"], settings.get("units"), settings.get("up"))
    materials: dict[str, Any] = {
        "cloth": Material(**settings["cloth"]),
        "reinforced": ReinforcedMaterial(**settings["reinforced"]),
        "interface": Interface(**settings["interface"]),
        "lame": settings["lame"],
    }
    made_on = (len(sequence.final.design), len(sequence.at_latest.positions_m))
    if made_on != (len(garment.triangles), garment.weights.shape[0]):
        raise InputError(
            f"{file}: its designs are for {made_on[0]} triangles and {made_on[1]} vertices, {settings['garment']} on body "
            f"{settings['body']} has {len(garment.triangles)} and {garment.weights.shape[0]} now; use the version that made them"
        )
    chosen = MOTIONS[one_of("motion", motion or settings["motion"], tuple(MOTIONS))]
    if angle_deg is None and chosen.name == settings["motion"]:
        angle_deg = settings["angle_deg"]
    refuse_unloaded(body, garment, chosen, chosen.checked_deg(angle_deg))
    return KeptDesigns(file, settings, sequence, wear(body, garment, chosen, angle_deg, **materials))


def slow_notice(worn: WornMotion, times: int, what: str) -> str | None:
    """How long a drawn mesh that is finer than level ``standard`` will take; None where it is not.

    :param worn: the garment on its body.
    :param times: how often it is brought to equilibrium.
    :param what: these, for people: "steps".
    :return: a sentence for people, or None.
    """
    vertices = worn.garment.weights.shape[0]
    if worn.garment.level != OWN or vertices <= FAST_VERTICES:
        return None
    seconds = STANDARD_STEP_S * (vertices / LEVELS["standard"]) ** STEP_POWER
    minutes = times * seconds / 60
    fewer = f"a mesh of {LEVELS['draft']} to {LEVELS['standard']} vertices gives the same within a few per cent"
    return (
        f"{worn.garment.name} has {vertices} vertices: about {seconds:.2g} s for each of {times} {what}, "
        f"{minutes:.2g} min or more; {fewer}"
    )


def _garment_of(garment: str) -> dict[str, str]:
    """What identifies a garment: its name, or its mesh's path and content."""
    path = mesh_of(garment)
    if path is None:
        return {"garment": garment}
    return {"garment": str(path.resolve()), "garment_sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


def refuse_unloaded(body: Body, garment: Garment, motion: Motion, angle_deg: float) -> None:
    """Refuse a motion that does not load the garment.

    :param body: the body.
    :param garment: the garment on it.
    :param motion: the motion.
    :param angle_deg: how far, degrees from straight.
    :raises InputError: no edge of the garment changes; the message names motions that do.
    """
    if _stretch(body, garment, motion, angle_deg) > MIN_STRETCH:
        return
    others = [one.name for one in MOTIONS.values() if _stretch(body, garment, one, one.default_deg) > MIN_STRETCH]
    raise InputError(
        f"motion = {motion.name!r} is not allowed for {garment.name}: it bends no joint under this garment, so that no cloth is "
        f"stretched; allowed: {', '.join(others)}"
    )


def _stretch(body: Body, garment: Garment, motion: Motion, angle_deg: float) -> float:
    """Largest relative change of an edge's length between the motion's start and end, the garment moving with the skin."""
    rest, end = (
        garment.on(body.posed_m(motion.pose(angle))) for angle in (motion.rest_deg(angle_deg), motion.end_deg(angle_deg))
    )
    edges = SurfaceMesh(rest, garment.triangles).edges
    before, after = (np.linalg.norm(m[edges[:, 0]] - m[edges[:, 1]], axis=1) for m in (rest, end))
    return float(np.abs(after / before - 1).max())
