"""What forces a patch of the stated materials can give at all: layouts tried against the two published ones (thesis 5.6.1).

The drawings of the published *Line* and *X* are not available. So many layouts are pulled under several readings of the text,
and a bound gives what no layout can exceed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import log

from haptics.garments.materials import CLOTH, REINFORCED, Lame, Material
from haptics.garments.patch.bands import Band, Layout, crossed, fitted, parallel
from haptics.garments.patch.clamped_patch import SIDE_M, ClampedPatch, PatchResult, pulled
from haptics.units import in_range, one_of

Family = Callable[[float], Layout]

FAMILIES: dict[str, Family] = {
    "along": parallel(1, 0.0, SIDE_M),
    "along, 3 bands": parallel(3, 0.0, SIDE_M),
    "along, 5 bands": parallel(5, 0.0, SIDE_M),
    "at 15 degrees": parallel(1, 15.0, SIDE_M),
    "at 30 degrees": parallel(1, 30.0, SIDE_M),
    "at 35 degrees": parallel(1, 35.0, SIDE_M),
    "at 45 degrees": parallel(1, 45.0, SIDE_M),
    "across": parallel(1, 90.0, SIDE_M),
    "across, 3 bands": parallel(3, 90.0, SIDE_M),
    "plus": lambda width_m: (Band(0.0, width_m), Band(90.0, width_m)),
    "x at 5 degrees": crossed(5.0),
    "x at 20 degrees": crossed(20.0),
    "x at 30 degrees": crossed(30.0),
    "x at 45 degrees": crossed(45.0),
    "x at 60 degrees": crossed(60.0),
}
"""Layouts by the width of their bands; angles from the pull."""

READINGS = ("plane", "thesis", "plane, sliding", "plane, thick")
"""Lamé's constants of ``Material.lame_n_m``; clamps that let the cloth narrow; the stated 0.35 mm as the thickness of the vinyl
alone, on top of the cloth's 0.27 mm."""


@dataclass(frozen=True)
class Tried:
    """A layout under a reading, and what it gave.

    :param family: of ``FAMILIES``.
    :param reading: of ``READINGS``.
    :param result: force, energy and coverage.
    """

    family: str
    reading: str
    result: PatchResult


def layouts_tried(coverage: float = 0.4, strain: float = 0.1, elements: int = 1000) -> Iterator[Tried]:
    """Every family at a coverage, under every reading.

    :param coverage: 0 to 1.
    :param strain: pull over side, 0 to 2, no unit.
    :param elements: number of triangles before corners are graded, 50 to 200,000.
    :return: yields each as soon as it is solved.
    :raises InputError: numbers outside those of ``pull``.
    """
    for family in FAMILIES:
        for reading in READINGS:
            yield Tried(family, reading, try_layout(family, reading, coverage, strain, elements))


def try_layout(
    family: str, reading: str = "plane", coverage: float = 0.4, strain: float = 0.1, elements: int = 1000
) -> PatchResult:
    """Pull one family's layout under one reading.

    :param family: one of ``FAMILIES``.
    :param reading: one of ``READINGS``.
    :param coverage: 0 to 1.
    :param strain: pull over side, 0 to 2, no unit.
    :param elements: number of triangles before corners are graded, 50 to 200,000.
    :return: force, energy and coverage.
    :raises InputError: a name that is not among them, or numbers outside those of ``pull``.
    """
    one_of("family", family, list(FAMILIES))
    one_of("reading", reading, READINGS)
    patch = ClampedPatch(
        elements,
        strain,
        "thesis" if reading == "thesis" else "plane",
        fitted(FAMILIES[family], coverage, SIDE_M),
        reinforced=replace(REINFORCED, thickness_m=CLOTH.thickness_m + REINFORCED.thickness_m)
        if reading == "plane, thick"
        else REINFORCED,
        clamps="sliding" if reading == "plane, sliding" else "held",
    )
    return pulled(patch, patch.layout_design)


def coverage_for(
    force_n: float, family: str = "along", reading: str = "plane", strain: float = 0.1, elements: int = 1000
) -> float:
    """The coverage at which a family gives a force.

    :param force_n: at the clamp, N.
    :param family: one of ``FAMILIES``.
    :param reading: one of ``READINGS``.
    :param strain: pull over side, 0 to 2, no unit.
    :param elements: number of triangles before corners are graded, 50 to 200,000.
    :return: coverage to within 5e-4, 0 to 1.
    :raises InputError: a force below that of cloth alone or above that of the full patch; names and numbers as in ``try_layout``.
    """
    from scipy.optimize import root_scalar

    def force_at(coverage: float) -> float:
        return try_layout(family, reading, coverage, strain, elements).force_n

    in_range("force", force_n, force_at(0.0), force_at(1.0), "N")
    return float(root_scalar(lambda c: force_at(float(c)) - force_n, bracket=(0.0, 1.0), xtol=5e-4).root)


def max_energy_j(
    coverage: float,
    strain: float = 0.1,
    lame: Lame = "plane",
    cloth: Material = CLOTH,
    reinforced: Material = REINFORCED,
) -> float:
    """Strain energy that no layout of a coverage can pass: that of the patch stretched evenly, which any layout can only lower.

    With F = diag(1 + strain, 1) every triangle has its material's W = mu/2 (s^2 - 1) - mu log s + lambda/2 (log s)^2, wherever it
    lies. While the force grows less than in proportion to the pull u, as here, the force is below 2 E / u.

    :param coverage: 0 to 1.
    :param strain: pull over side, 0 to 2, no unit.
    :param lame: see ``Material.lame_n_m``.
    :param cloth: of the part without reinforcement.
    :param reinforced: of the part with it.
    :return: energy, J.
    :raises InputError: a number outside these.
    """
    in_range("coverage", coverage, 0.0, 1.0)
    s = 1.0 + in_range("strain", strain, 0.0, 2.0)

    def density(material: Material) -> float:
        lam, mu = material.lame_n_m(lame)
        return 0.5 * mu * (s * s - 1.0) - mu * log(s) + 0.5 * lam * log(s) ** 2

    return SIDE_M**2 * ((1.0 - coverage) * density(cloth) + coverage * density(reinforced))
