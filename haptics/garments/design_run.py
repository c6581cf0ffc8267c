"""The main job: find the reinforcement of a garment against a motion, rate it beside hand-drawn ones, and draw it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import LimitError
from haptics.garments.design.designs import COVERAGE_TOLERANCE, DesignSequence, DesignStep, DesignStore
from haptics.garments.design.drawn import SHAPES, DrawnDesign, best_drawn
from haptics.garments.design.job import STORE, DesignJob, put_on, settings_of, slow_notice
from haptics.garments.design.rating import Unconverged, coverage_of, solved
from haptics.garments.design.topology import DesignInterrupted, Progress, optimise, steps_about
from haptics.garments.equilibrium.wearing import WornMotion
from haptics.garments.views.pictures import draw_density, draw_energy, draw_sequence, why_no_pictures
from haptics.recording.output import check_outputs, make_folder, refuse_existing, replacing

FILES = (STORE, "sequence.png", "density.png", "garment.png", "design.json")
Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class DesignReport:
    """What came of a job.

    :param job: what was asked for.
    :param worn: the garment on its body.
    :param sequence: the designs; those made until a step found no equilibrium, if ``stopped`` is set.
    :param drawn: the hand-drawn baselines by shape; None where none of their places has an equilibrium.
    :param seconds: duration of each step made in this run, s; empty where the sequence was complete before.
    :param stopped: why the evolution stopped too early; None where it did not.
    :param notes: what is missing without being wrong, for people.
    :param files: what was written.
    """

    job: DesignJob
    worn: WornMotion
    sequence: DesignSequence
    drawn: dict[str, DrawnDesign | None]
    seconds: tuple[float, ...]
    stopped: str | None
    notes: tuple[str, ...]
    files: tuple[Path, ...]

    @property
    def faults(self) -> list[str]:
        """Limits that were not kept; none where all is well."""
        final, goal = self.sequence.final, self.job.coverage
        found = [self.stopped] if self.stopped else []
        if abs(final.coverage - goal) > COVERAGE_TOLERANCE:
            found.append(f"coverage is {final.coverage:.4f}; must be {goal:g} to within {COVERAGE_TOLERANCE:g}")
        found += [f"no equilibrium of the drawn {shape} at any place" for shape, best in self.drawn.items() if best is None]
        return found

    def to_json(self) -> dict[str, Any]:
        """Plain data. ``density_increase`` and the baselines' ``density`` are the same ratio: energy by area of the reinforced
        part over that of the fully reinforced garment.

        :return: what ``design.json`` holds; units are in the keys.
        """
        final, job = self.sequence.final, self.job
        steps = len(self.sequence.steps)
        return {
            "garment": job.garment,
            "motion": job.motion,
            "angle_deg": self.worn.angle_deg,
            "body": job.body,
            "phenotype": dict(job.phenotype),
            "level": job.level,
            "lame": job.lame,
            **job.frame,
            "vertices": len(self.worn.simulation.rest.vertices_m),
            "triangles": len(self.worn.simulation.triangles),
            "steps": steps + (self.stopped is not None),
            "converged_steps": steps,
            "solver": self.worn.simulation.solver_name,
            "final_step": self.sequence.steps.index(final),
            "density_increase": final.density,
            "density_increase_eq65": final.density_eq65,
            "coverage": final.coverage,
            "coverage_asked": job.coverage,
            "seconds_per_step": _spread(self.seconds),
            "energy_j": final.energy_j,
            "full_j_m2": self.sequence.full.reinforced_j_m2,
            "largest_residual_n": max(step.residual_n for step in self.sequence.steps),
            "complete": self.sequence.complete,
            "faults": self.faults,
            "notes": list(self.notes),
            "files": [str(path) for path in self.files],
            **{shape: _drawn_json(best) for shape, best in self.drawn.items()},
        }


def run_design(
    job: DesignJob,
    out: Path,
    resume: bool = False,
    force: bool = False,
    progress: Progress | None = None,
    say: Say | None = None,
    warn: Say | None = None,
) -> DesignReport:
    """Make the designs and everything that shows them, in a folder: the files of ``FILES``.

    The design store is written after each step: a run that was broken off is continued by ``resume``. Pictures are left out where
    matplotlib is not installed.

    :param job: what to design.
    :param out: the folder, made if need be.
    :param resume: go on with the store that is there, and renew the other files; begin where there is none.
    :param force: begin anew over files that exist.
    :param progress: called after each completed step with its number from 0 and the step; None: nobody is.
    :param say: called with what is being done besides, for people; None: nobody is.
    :param warn: called, before anything takes long, with what will; None: nobody is.
    :return: the designs and the files written.
    :raises InputError: files that exist, settings other than those of the store that is resumed, or as ``put_on``.
    :raises LimitError: the fully reinforced garment has no equilibrium, so that there is nothing to begin with.
    """
    say = say or (lambda what: None)
    paths = {name: out / name for name in FILES}
    for path in paths.values():
        if out.is_dir():
            refuse_existing(path, force or resume)
    say(f"putting {job.garment} on body {job.body}")
    worn = put_on(job)
    if resume:
        DesignStore(paths[STORE], settings_of(job, worn)).refuse_others()
    slow = slow_notice(worn, steps_about(job.coverage), "steps")
    if slow is not None and warn is not None:
        warn(slow)
    _make_room(out, [] if resume else list(paths.values()))
    say("rating the drawn line and X")
    drawn = _baselines(job, worn)
    say("evolving the design")
    sequence, seconds, stopped = _designed(job, worn, paths[STORE], drawn, progress)
    missing = why_no_pictures()
    written = [path for path in paths.values() if not (missing and path.suffix == ".png")]
    notes = tuple(what for what in (*worn.garment.notes, slow, missing) if what)
    report = DesignReport(job, worn, sequence, drawn, seconds, stopped, notes, tuple(written))
    if not missing:
        say("drawing")
        _draw(report, paths)
    with replacing(paths["design.json"], force=True) as partial:
        partial.write_text(json.dumps(report.to_json(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return report


def _make_room(out: Path, stale: list[Path]) -> None:
    """The folder, without what would show older designs than those that are begun."""
    make_folder(out)
    check_outputs({name: out / name for name in FILES}, force=True)
    for path in stale:
        path.unlink(missing_ok=True)


def _designed(
    job: DesignJob, worn: WornMotion, path: Path, drawn: Mapping[str, DrawnDesign | None], progress: Progress | None
) -> tuple[DesignSequence, tuple[float, ...], str | None]:
    """The sequence, the time of each step made now, and why it stopped too early, if it did."""
    times = [time.perf_counter()]

    def stepped(number: int, step: DesignStep) -> None:
        times.append(time.perf_counter())
        if progress:
            progress(number, step)

    stopped, store = None, DesignStore(path, settings_of(job, worn))
    rivals = [best for best in drawn.values() if best]
    try:
        sequence = optimise(worn.simulation, job.coverage, store=store, progress=stepped, rivals=rivals)
    except DesignInterrupted as error:
        if error.sequence is None:
            raise LimitError(f"{job.garment}, {job.motion}: {error}") from error
        sequence, stopped = error.sequence, str(error)
    return sequence, tuple(np.diff(times).tolist()), stopped


def _baselines(job: DesignJob, worn: WornMotion) -> dict[str, DrawnDesign | None]:
    """The drawn line and X with the coverage asked for; None where one has no equilibrium."""
    try:
        full = solved(worn.simulation, worn.simulation.designable)
    except Unconverged as error:
        raise LimitError(f"{job.garment}, {job.motion}: {error}") from error
    found: dict[str, DrawnDesign | None] = {}
    for shape in SHAPES:
        try:
            found[shape] = best_drawn(worn.simulation, shape, job.coverage, full)
        except Unconverged:
            found[shape] = None
    return found


def _draw(report: DesignReport, paths: dict[str, Path]) -> None:
    job, worn, sequence = report.job, report.worn, report.sequence
    title = f"{worn.garment.name} against {job.motion} by {worn.angle_deg:g}°, body {job.body}"
    draw_sequence(worn, sequence, paths["sequence.png"], force=True)
    densities = {shape: best.density if best else None for shape, best in report.drawn.items()}
    draw_density(sequence, densities, title, paths["density.png"], force=True)
    final = sequence.final
    state = solved(worn.simulation, final.design, sequence.at_final.positions_m)
    covered = f"{title}: {100 * coverage_of(worn.simulation, final.design):.1f} % covered, density × {final.density:.2f}"
    draw_energy(worn, final.design, state.positions_m, state.element_energy_j, covered, paths["garment.png"], force=True)


def _drawn_json(best: DrawnDesign | None) -> dict[str, Any]:
    if best is None:
        return {"density": None}
    return {
        "density": best.density,
        "density_eq65": best.density_eq65,
        "coverage": best.coverage,
        "energy_j": best.energy_j,
        "place": best.place,
        "tried": best.tried,
    }


def _spread(seconds: tuple[float, ...]) -> dict[str, float | None]:
    if not seconds:
        return {"median": None, "p95": None}
    return {"median": float(np.median(seconds)), "p95": float(np.quantile(seconds, 0.95))}
