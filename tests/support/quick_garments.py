"""What many commands on the same sleeve share is computed once a process; pictures are small, and few places are tried.

Only in tests of commands: neighbours on a body, drawn baselines and pictures have tests of their own (``tests/garments``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from haptics.garments import design_run, evaluation
from haptics.garments.design import drawn
from haptics.garments.design.drawn import best_drawn
from haptics.garments.equilibrium import simulation
from haptics.garments.equilibrium.surface import neighbour_lists
from haptics.garments.views import pictures

PIXELS, DPI = 60, 50
PLACES, REACHES = 4, (0.5,)
_kept: dict[tuple[Any, ...], Any] = {}


def _once(key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
    if key not in _kept:
        _kept[key] = make()
    return _kept[key]


def _digest(*arrays: np.ndarray) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()


def _neighbours(rest: Any) -> Any:
    return _once(("lists", _digest(rest.vertices_m, rest.triangles)), lambda: neighbour_lists(rest))


def _drawn(cloth: Any, shape: str, coverage: float, full: Any = None) -> Any:
    posed = _digest(cloth.rest.vertices_m, cloth._skin.copy_m, cloth._lame, cloth._attached)
    return _once((shape, round(coverage, 2), posed), lambda: best_drawn(cloth, shape, coverage, full))


_solve = simulation.GarmentOnBody.solve


def _solved(cloth: Any, design: Any, start: Any = None) -> Any:
    """The solve that begins cold, of the whole garment reinforced, is every command's first and dearest."""
    if start is not None or not np.array_equal(design, cloth.designable):
        return _solve(cloth, design, start)

    def make() -> Any:
        return _solve(cloth, design), cloth._homes, cloth._constants

    posed = _digest(
        cloth.rest.vertices_m,
        cloth.rest.triangles,
        cloth._skin.surface.vertices_m,
        cloth._skin.copy_m,
        cloth._lame,
        cloth._attached,
    )
    asked = ("cold", posed, cloth.solver_name, cloth.tolerance_n, repr(cloth.interface))
    found, cloth._homes, cloth._constants = _once(asked, make)
    return found


@contextmanager
def quick_garments() -> Iterator[None]:
    """Commands within the context share drawn baselines and neighbours on a body."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(simulation, "neighbour_lists", _neighbours)
        patched.setattr(simulation.GarmentOnBody, "solve", _solved)
        patched.setattr(design_run, "best_drawn", _drawn)
        patched.setattr(evaluation, "best_drawn", _drawn)
        patched.setattr(drawn, "PLACES", PLACES)
        patched.setattr(drawn, "REACHES", REACHES)
        patched.setattr(pictures, "PIXELS", PIXELS)
        patched.setattr(pictures, "DPI", DPI)
        yield
