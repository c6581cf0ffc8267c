"""A mesh's units and axes: how to bring them to ours, and whether its size suggests others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres in each unit that a mesh may be drawn in."""
WORDS = {"m": "metres", "dm": "decimetres", "cm": "centimetres", "mm": "millimetres", "in": "inches", "ft": "feet"}
AXES = ("x", "y", "z")
_RARER = {"m": 0.0, "dm": 0.8, "cm": 0.0, "mm": 0.0, "in": 0.3, "ft": 0.8}
"""Handicap, in decades of size, of units that few programs draw in. Assumed."""
_NEARLY = 0.3
"""A second unit is named if it is worse by at most so many decades. Assumed."""


@dataclass(frozen=True)
class Kind:
    """What a mesh is drawn as.

    :param what: in words, with an article.
    :param smallest_m: range of its longest side, metres; assumed.
    :param largest_m: likewise, with ``smallest_m``.
    :param usual_m: what it is most often; decides between units.
    :param cure: how a user names a unit, with ``{unit}`` and ``{scale}`` where they go.
    """

    what: str
    smallest_m: float
    largest_m: float
    usual_m: float
    cure: str

    def has(self, extent_m: float) -> bool:
        """Whether anything of the kind can be that long.

        :param extent_m: longest side, metres.
        :return: whether it is within ``smallest_m`` to ``largest_m``.
        """
        return self.smallest_m <= extent_m <= self.largest_m


@dataclass(frozen=True)
class SizeFault:
    """A size that nothing of its kind has.

    :param seen: what is wrong, and what is allowed.
    :param cure: the likeliest unit as a question, and how to name it; empty where no unit makes sense of it.
    """

    seen: str
    cure: str

    def __str__(self) -> str:
        return f"{self.seen}; {self.cure}" if self.cure else self.seen


def size_fault(vertices: Floats, kind: Kind, scale: float = 1.0) -> SizeFault | None:
    """What is wrong with a mesh's size, if anything: its largest side, in metres, is not in the kind's range.

    :param vertices: ``(v, 3)`` as in the file.
    :param kind: what it is drawn as.
    :param scale: metres per unit of the file.
    :return: the fault with a likely cure, or None.
    """
    extent = extent_of(vertices)
    if kind.has(extent * scale):
        return None
    seen = f"it is {extent * scale:g} m across; must be {kind.smallest_m:g} to {kind.largest_m:g} m, as {kind.what} is"
    return SizeFault(seen, _question(extent, kind, [unit for unit in likely_units(extent, kind) if unit != "m"]))


def other_unit(vertices: Floats, kind: Kind) -> str:
    """Whether a mesh whose size is possible in metres is more often of that size in another unit.

    :param vertices: ``(v, 3)``, as in the file.
    :param kind: what it is drawn as.
    :return: the question to the user, with the cure; empty where metres are likely.
    """
    extent = extent_of(vertices)
    likely = likely_units(extent, kind)
    return "" if "m" in likely else _question(extent, kind, likely)


def extent_of(vertices: Floats) -> float:
    """The longest side of the box around a mesh.

    :param vertices: ``(v, 3)``.
    :return: in the vertices' unit; infinite where it is beyond computing.
    """
    with np.errstate(over="ignore"):
        return float(np.ptp(vertices, axis=0).max())


def likely_units(extent: float, kind: Kind) -> list[str]:
    """The units in which an extent is of a usual size, the likeliest first, then those nearly as likely.

    :param extent: longest side, in the file's unit.
    :param kind: what it is drawn as.
    :return: names in ``UNITS``; empty where no unit gives a possible size.
    """
    worse = {
        unit: abs(math.log10(extent * metres / kind.usual_m)) + _RARER[unit]
        for unit, metres in UNITS.items()
        if kind.has(extent * metres)
    }
    return sorted((unit for unit in worse if worse[unit] <= min(worse.values()) + _NEARLY), key=lambda unit: worse[unit])


def _question(extent: float, kind: Kind, likely: list[str]) -> str:
    if not likely:
        return ""
    unit, *others = likely
    also = f"; or in {WORDS[others[0]]}, {extent * UNITS[others[0]]:.3g} m?" if others else ""
    cure = kind.cure.format(unit=unit, scale=f"{UNITS[unit]:g}")
    return f"is it in {WORDS[unit]}? Then it is {extent * UNITS[unit]:.3g} m across: {cure}{also}"


_TURNS = {
    ("z", "z"): ((0, 1), (1, 1), (2, 1)),
    ("y", "z"): ((0, 1), (2, -1), (1, 1)),
    ("x", "z"): ((2, -1), (1, 1), (0, 1)),
    ("y", "y"): ((0, 1), (1, 1), (2, 1)),
    ("z", "y"): ((0, 1), (2, 1), (1, -1)),
    ("x", "y"): ((1, -1), (0, 1), (2, 1)),
}
"""Quarter turns from an axis that points up to another: of each new coordinate, the old one and its sign."""


def in_frame(vertices: Floats, scale: float = 1.0, up: str = "z", to: str = "z", quarter_turns: int = 0) -> Floats:
    """The vertices in metres, with the axis ``up`` of the file turned to our ``to``, then turned about it by quarters.

    Nothing is rounded but by ``scale``: turned coordinates are the file's, exchanged.

    :param vertices: ``(v, 3)``, as in the file.
    :param scale: metres per unit of the file.
    :param up: axis of the file that points up, ``x``, ``y`` or ``z``.
    :param to: our axis that points up, ``y`` or ``z``.
    :param quarter_turns: about ``to``, right-handed; any whole number.
    :return: ``(v, 3)``.
    """
    turned = np.stack([sign * vertices[:, axis] for axis, sign in _TURNS[up, to]], axis=1) if up != to else vertices
    vertical = AXES.index(to)
    a, b = (vertical + 1) % 3, (vertical + 2) % 3
    for _ in range(quarter_turns % 4):
        turned = turned.copy()
        turned[:, [a, b]] = np.stack([-turned[:, b], turned[:, a]], axis=1)
    return turned * scale if scale != 1.0 else turned
