"""A sequence of designs, and the file that keeps it while it is made: killed at any moment, all completed steps are in it.

::

    /                       attributes: creator, haptics_designs (version of this layout), coverage (asked for), complete
      settings              all that the sequence depends on, as JSON text
      full                  energy densities of the fully reinforced garment: reinforced, eq. 6.5 (J/m2)
      steps/design          (steps, ceil(triangles / 8)) uint8: eight triangles a byte, the first in the highest bit
      steps/...             (steps,) each: the numbers of ``DesignStep``
      final/positions_m     (vertices, 3): the equilibrium of the design asked for
    latest/positions_m    (vertices, 3): the last equilibrium, from which the next one starts
      latest/history_j_m2   (triangles,): sensitivities averaged over the past (eq. 5.14)

Each step replaces the file by a whole one, sealed against damage (:mod:`haptics.recording.seal`). The same sequence gives the
same bytes, whether or not it was interrupted.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.garments.design.rating import Densities
from haptics.garments.mesh import Bools, Floats
from haptics.recording.hdf5_file import DamagedFile, attribute_of, group_at, reading, text_at, values_at, writing
from haptics.recording.output import replacing
from haptics.recording.seal import check_seal, seal

LAYOUT = 2
_UNSEALED = 1
"""The last layout that was written without a seal."""
COVERAGE_TOLERANCE = 0.003
"""How far a design's coverage may be from the one asked for, as a part of the designable area."""
_NUMBERS = ("coverage", "energy_j", "density", "density_eq65", "residual_n", "iterations")


@dataclass(frozen=True, eq=False)
class DesignStep:
    """One design and what its equilibrium gave.

    :param design: reinforced triangles, ``(triangles,)``.
    :param coverage: reinforced over designable area, 0 to 1.
    :param energy_j: strain energy of the whole garment, J, what is maximised (eq. 5.11).
    :param density: energy by area of the reinforced part, over that of the fully reinforced garment (5.6).
    :param density_eq65: energy of the whole garment by reinforced area, likewise (eq. 6.5).
    :param residual_n: force left over, N; always a converged equilibrium.
    :param iterations: Newton steps it took.
    """

    design: Bools
    coverage: float
    energy_j: float
    density: float
    density_eq65: float
    residual_n: float
    iterations: int


@dataclass(frozen=True, eq=False)
class Reached:
    """The state of a design from which the next one follows.

    :param positions_m: its equilibrium, m, ``(vertices, 3)``.
    :param history_j_m2: filtered and averaged sensitivities after it, J/m2, ``(triangles,)``.
    """

    positions_m: Floats
    history_j_m2: Floats


@dataclass(frozen=True, eq=False)
class DesignSequence:
    """Designs in the order in which they were found, with the state from which the next one follows.

    :param steps: the designs, at least one.
    :param coverage: coverage asked for, 0.01 to 1.
    :param full: energy densities of the fully reinforced garment.
    :param at_final: state of ``final``.
    :param at_latest: state of the last step.
    :param complete: nothing is left to do.
    """

    steps: tuple[DesignStep, ...]
    coverage: float
    full: Densities
    at_final: Reached
    at_latest: Reached
    complete: bool

    @property
    def final(self) -> DesignStep:
        """The design asked for: of those that have the coverage, the one of maximum density; until there is one, the last.

        At the target the procedure goes on swapping triangles, and where loops open and close again its steps differ widely.
        """
        return asked_for(self.steps, self.coverage)


def asked_for(steps: tuple[DesignStep, ...], coverage: float) -> DesignStep:
    """The step of maximum density among those with the coverage; the last step while none has it.

    :param steps: at least one.
    :param coverage: coverage asked for, met to ``COVERAGE_TOLERANCE``.
    :return: one of ``steps``.
    """
    there = [step for step in steps if abs(step.coverage - coverage) <= COVERAGE_TOLERANCE]
    return max(there, key=lambda step: step.density) if there else steps[-1]


class DesignStore:
    """One HDF5 file with a design sequence.

    :param path: the file; need not exist yet.
    :param settings: what the sequence depends on besides the cloth and the parameters of ``optimise``, as plain JSON data:
        garment, motion, angle, body, level, materials, solver.
    """

    def __init__(self, path: str | os.PathLike[str], settings: Mapping[str, Any] | None = None):
        self.path, self._settings = Path(path), dict(settings or {})

    def load(self, settings: Mapping[str, Any]) -> DesignSequence | None:
        """What is in the file so far; None if there is no file.

        :param settings: what ``optimise`` depends on, added to those of the store, as plain JSON data.
        :return: the sequence; None if there is no file.
        :raises InputError: it was begun with other settings (the message names each), or is no design sequence.
        """
        if not self.path.exists():
            return None
        begun, sequence = _read(self.path)
        wanted = json.loads(_json({**self._settings, **settings}))
        self._refuse_others(begun, wanted, begun.keys() | wanted.keys())
        return sequence

    def refuse_others(self) -> None:
        """Check, before anything takes time, that what is in the file was begun with the settings of this store.

        :raises InputError: it was not, or is no design sequence.
        """
        if self.path.exists():
            wanted = json.loads(_json(self._settings))
            self._refuse_others(_read(self.path)[0], wanted, wanted.keys())

    def _refuse_others(self, begun: Mapping[str, Any], wanted: Mapping[str, Any], keys: Set[str]) -> None:
        differ = [
            f"{key} was {begun.get(key)!r} and is now {wanted.get(key)!r}"
            for key in sorted(keys)
            if begun.get(key) != wanted.get(key)
        ]
        if differ:
            raise InputError(
                f"{self.path} was begun with other settings: {'; '.join(differ)}; use the same settings, or another file"
            )

    def save(self, settings: Mapping[str, Any], sequence: DesignSequence) -> None:
        """Put ``sequence`` in place of what is in the file.

        :param settings: as in ``load``.
        :param sequence: what to write.
        :raises InputError: settings that are not plain JSON data; the folder is missing.
        :raises HapticsError: it cannot be written (a full disk); the file is as it was.
        """
        text = _json({**self._settings, **settings})
        with replacing(self.path, force=True) as partial:
            _write(partial, text, sequence)


def read_designs(path: str | os.PathLike[str]) -> tuple[dict[str, Any], DesignSequence]:
    """The settings and the sequence in a file that ``DesignStore`` wrote.

    :param path: the HDF5 file.
    :return: settings as plain JSON data, and the sequence.
    :raises InputError: there is no such file, or it is no design sequence.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a file written by haptics garment design")
    return _read(path)


def _json(settings: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(settings), sort_keys=True, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"settings are not plain JSON data: {error}") from error


def _write(path: Path, settings: str, sequence: DesignSequence) -> None:
    with writing(path) as file:
        file.attrs["creator"] = "haptics"
        file.attrs["coverage"] = sequence.coverage
        file.attrs["complete"] = sequence.complete
        _put(file, "settings", np.bytes_(settings.encode()))
        _put(file, "full", [sequence.full.reinforced_j_m2, sequence.full.eq65_j_m2])
        _put(file, "steps/design", np.packbits([step.design for step in sequence.steps], axis=1))
        for name in _NUMBERS:
            _put(file, f"steps/{name}", [getattr(step, name) for step in sequence.steps])
        for name, reached in (("final", sequence.at_final), ("latest", sequence.at_latest)):
            _put(file, f"{name}/positions_m", reached.positions_m)
            _put(file, f"{name}/history_j_m2", reached.history_j_m2)
        file.attrs["haptics_designs"] = LAYOUT  # last: without it nothing is taken for a design sequence
    seal(path)


def _put(file: Any, name: str, data: Any) -> None:
    file.create_dataset(name, data=data, track_times=False)


def _read(path: Path) -> tuple[dict[str, Any], DesignSequence]:
    found = check_seal(path)
    if found is not None and not found.whole:
        raise DamagedFile(path, found.damage)
    try:
        with reading(path) as file:
            layout = file.attrs.get("haptics_designs")
            if layout not in range(1, LAYOUT + 1):
                raise ValueError(f"its layout is {layout}; must be 1 to {LAYOUT}")
            if found is None and layout > _UNSEALED:
                raise ValueError("the seal at its end is missing")
            final, latest = (
                Reached(values_at(group, "positions_m"), values_at(group, "history_j_m2"))
                for group in (group_at(file, "final"), group_at(file, "latest"))
            )
            steps = group_at(file, "steps")
            designs = np.unpackbits(values_at(steps, "design"), axis=1, count=len(latest.history_j_m2)).astype(bool)
            numbers = [values_at(steps, name).tolist() for name in _NUMBERS]
            sequence = DesignSequence(
                tuple(DesignStep(design, *row) for design, *row in zip(designs, *numbers, strict=True)),
                float(attribute_of(file, "coverage", (float, np.floating))),
                Densities(*values_at(file, "full").tolist()),
                final,
                latest,
                bool(attribute_of(file, "complete", np.bool_)),
            )
            settings = json.loads(text_at(file, "settings"))
            if not isinstance(settings, dict):
                raise ValueError("its settings are not a JSON object")
            return settings, sequence
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a design sequence, or a damaged one: {error}") from error
