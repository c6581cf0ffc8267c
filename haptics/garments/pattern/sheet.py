"""Panels laid out on sheets: one drawing that both file formats are written from. Millimetres, y upwards, origin lower left.

Layers, so that a cutter's program can take one at a time: the reinforcement's cut, the cloth's cut, seam lines, marks, text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import shapely

from haptics.errors import InputError
from haptics.garments.mesh import Floats
from haptics.garments.pattern.pattern import Pattern, PatternPanel, Seam, SeamSide

REINFORCEMENT, CLOTH, SEAMS, MARKS, TEXT = LAYERS = ("cut-reinforcement", "cloth", "seams", "marks", "text")
MM_PER_M = 1000.0
SCALE_BAR_MM = 100.0
CROSS_MM, NOTCH_MM, ARROW_MM = 6.0, 4.0, 50.0
TITLE_MM, SMALL_MM = 4.0, 3.0
"""Heights of text."""
WIDTH_OF_LETTER = 0.62
"""Of a letter's height, on the wide side: lines are broken by it."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One line or outline on a sheet.

    :param layer: one of ``LAYERS``.
    :param lines: rings of a polygon (outer anticlockwise, holes clockwise), or one open line; mm, ``(points, 2)`` each.
    :param closed: whether the last point is joined to the first.
    """

    layer: str
    lines: tuple[Floats, ...]
    closed: bool


@dataclass(frozen=True)
class Text:
    """A line of text.

    :param text: what is printed.
    :param x_mm: horizontal position of the anchor, mm.
    :param y_mm: baseline, mm.
    :param height_mm: of its capitals, mm.
    :param anchor: ``middle``: about its middle; ``start``: from its lower left.
    """

    text: str
    x_mm: float
    y_mm: float
    height_mm: float
    anchor: str = "middle"


@dataclass(eq=False)
class Sheet:
    """One sheet of material with everything drawn on it.

    :param title: of the file.
    :param width_mm: of the sheet, mm.
    :param height_mm: of the sheet, mm.
    :param shapes: lines and outlines, in drawing order.
    :param texts: lines of text.
    """

    title: str
    width_mm: float
    height_mm: float
    shapes: list[Shape] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Placed:
    """A panel on a sheet: ``flat @ turn * 1000 + shift``.

    :param number: index of the panel in the pattern.
    :param turn: rotation or reflection, ``(2, 2)``.
    :param shift_mm: mm, ``(2,)``.
    """

    number: int
    turn: Floats
    shift_mm: Floats

    def at(self, points_m: Floats) -> Floats:
        """Points of the panel on the sheet.

        :param points_m: on the flat panel, m, ``(points, 2)``.
        :return: on the sheet, mm, ``(points, 2)``.
        """
        return points_m @ self.turn * MM_PER_M + self.shift_mm


def lay_out(pattern: Pattern) -> list[Sheet]:
    """The sheets for a pattern: panels on shelves, the tallest first, as many on a sheet as fit its length.

    :param pattern: what to lay out.
    :return: at least one sheet.
    :raises InputError: a panel that is wider or longer than the sheet; the message gives the sizes.
    """
    options = pattern.options
    margin_mm = MM_PER_M * options.margin_m
    width_mm, longest_mm = MM_PER_M * options.sheet_width_m, MM_PER_M * options.sheet_length_m
    lines = _broken(_title(pattern), width_mm - 2 * margin_mm - SCALE_BAR_MM - TITLE_MM)
    head_mm = max(len(lines) * 1.6 * TITLE_MM, 6 * TITLE_MM) + margin_mm
    room_mm = np.array([width_mm - 2 * margin_mm, longest_mm - 2 * margin_mm - head_mm])
    turned = [_fitted(panel, room_mm, options.mirrored) for panel in pattern.panels]
    order = sorted(range(len(turned)), key=lambda i: (-round(turned[i][1][1], 6), i))
    sheets: list[Sheet] = []
    for placed, used_mm in _shelves(order, turned, room_mm, margin_mm):
        title = pattern.name if len(sheets) == 0 else f"{pattern.name} {len(sheets) + 1}"
        sheet = Sheet(title, width_mm, used_mm + head_mm + 2 * margin_mm)
        _heading(sheet, lines, margin_mm)
        for place in placed:
            _draw(sheet, pattern, Placed(place.number, place.turn, place.shift_mm + margin_mm))
        sheets.append(sheet)
    return sheets


def _title(pattern: Pattern) -> list[str]:
    worst = max(pattern.panels, key=lambda panel: panel.flat.distortion.rms_length)
    side = "mirrored: seen from the inside of the garment" if pattern.options.mirrored else "seen from the outside of the garment"
    narrow = sum(len(panel.narrow) for panel in pattern.panels)
    smallest = f"{MM_PER_M * pattern.options.smallest_feature_m:g} mm"
    return [
        f"garment: {pattern.name}",
        *(f"{name}: {value}" for name, value in pattern.labels.items()),
        f"reinforcement: {1e4 * pattern.cut_area_m2:.1f} cm2 to cut, {1e4 * pattern.reinforced_area_m2:.1f} cm2 on the body",
        f"flattening: lengths off by {100 * worst.flat.distortion.rms_length:.1f} % rms in panel {worst.name}",
        *([f"places narrower than {smallest}: {narrow} (circled)"] if narrow else []),
        f"panels: {len(pattern.panels)}, {side}",
        f"seam allowance: {MM_PER_M * pattern.options.seam_allowance_m:g} mm",
    ]


def _broken(parts: list[str], width_mm: float) -> list[str]:
    """Parts one after another, a new line where the next does not fit."""
    lines: list[str] = []
    for part in parts:
        together = f"{lines[-1]}  |  {part}" if lines else part
        if lines and len(together) * WIDTH_OF_LETTER * TITLE_MM <= width_mm:
            lines[-1] = together
        else:
            lines.append(part)
    return lines


def _fitted(panel: PatternPanel, room_mm: Floats, mirrored: bool) -> tuple[Floats, Floats, Floats]:
    """How to turn a panel so that it fits, its size then, and its lower left corner before it is moved, mm."""
    flip = np.diag([-1.0, 1.0]) if mirrored else np.eye(2)
    upright = MM_PER_M * panel.outline_m @ flip
    for turn in (flip, flip @ np.array([[0.0, 1.0], [-1.0, 0.0]])):
        points = MM_PER_M * panel.outline_m @ turn
        size = np.ptp(points, axis=0)
        if np.all(size <= room_mm):
            return turn, size, points.min(axis=0)
    size = np.ptp(upright, axis=0)
    raise InputError(
        f"panel {panel.name} is {size[0]:.0f} x {size[1]:.0f} mm; allowed on this sheet: {room_mm[0]:.0f} x {room_mm[1]:.0f} mm "
        "within the margins, upright or turned by 90 degrees (a wider sheet or more panels may help)"
    )


def _shelves(
    order: list[int], turned: list[tuple[Floats, Floats, Floats]], room_mm: Floats, gap_mm: float
) -> list[tuple[list[Placed], float]]:
    """For each sheet its panels, placed from the lower left of the room, and the length used."""
    sheets: list[tuple[list[Placed], float]] = []
    placed: list[Placed] = []
    x = shelf = 0.0
    top = 0.0
    for i in order:
        turn, size, corner = turned[i]
        if x > 0 and x + size[0] > room_mm[0]:
            x, shelf = 0.0, top + gap_mm
        if placed and shelf + size[1] > room_mm[1]:
            sheets.append((placed, top))
            placed, x, shelf, top = [], 0.0, 0.0, 0.0
        placed.append(Placed(i, turn, np.array([x, shelf]) - corner))
        x += size[0] + gap_mm
        top = max(top, shelf + size[1])
    return [*sheets, (placed, top)]


def _heading(sheet: Sheet, lines: list[str], margin_mm: float) -> None:
    """Title, the scale bar to be measured after cutting, and crosses in the corners to register one layer on another."""
    top = sheet.height_mm - margin_mm - TITLE_MM
    for i, line in enumerate(lines):
        sheet.texts.append(Text(line, margin_mm + CROSS_MM, top - 1.6 * TITLE_MM * i, TITLE_MM, "start"))
    right = sheet.width_mm - margin_mm - CROSS_MM
    bar = np.array([[right - SCALE_BAR_MM, top - TITLE_MM], [right, top - TITLE_MM]])
    sheet.shapes.append(Shape(MARKS, (bar,), False))
    for x, _ in bar:
        sheet.shapes.append(Shape(MARKS, (np.array([[x, bar[0, 1] - 2], [x, bar[0, 1] + 2]]),), False))
    sheet.texts.append(Text(f"{SCALE_BAR_MM:g} mm", right - SCALE_BAR_MM / 2, bar[0, 1] + 2, SMALL_MM))
    half = CROSS_MM / 2
    for x in (half + 1, sheet.width_mm - half - 1):
        for y in (half + 1, sheet.height_mm - half - 1):
            sheet.shapes.append(Shape(MARKS, (np.array([[x - half, y], [x + half, y]]),), False))
            sheet.shapes.append(Shape(MARKS, (np.array([[x, y - half], [x, y + half]]),), False))


def _draw(sheet: Sheet, pattern: Pattern, place: Placed) -> None:
    panel = pattern.panels[place.number]
    for polygon in panel.cut.polygons:
        rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
        # A mirrored ring runs in the other direction; outer rings stay anticlockwise.
        step = 1 if np.linalg.det(place.turn) > 0 else -1
        sheet.shapes.append(Shape(REINFORCEMENT, tuple(place.at(ring[::step]) for ring in rings), True))
    sheet.shapes.append(Shape(CLOTH, (place.at(panel.outline_m),), True))
    for seam in pattern.seams:
        for side in seam.sides:
            if side.panel == place.number:
                sheet.shapes.append(Shape(SEAMS, (place.at(side.points_m),), False))
                _notches(sheet, place, seam, side)
    for x, y in panel.narrow:
        angle = np.linspace(0, 2 * np.pi, 25)[:-1]
        circle = place.at(np.array([[x, y]])) + 3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        sheet.shapes.append(Shape(MARKS, (circle,), True))
    _name_and_arrow(sheet, pattern, place, panel)


def _notches(sheet: Sheet, place: Placed, seam: Seam, side: SeamSide) -> None:
    """Ticks into the panel, each with the seam's number and its own: what is sewn together has the same numbers."""
    inwards = 1.0 if side is seam.sides[0] else -1.0
    points = seam.notches(side)
    for i, (point, at_m) in enumerate(zip(points, seam.notches_m, strict=True)):
        step = int(np.clip(np.searchsorted(seam.along_m, at_m), 1, len(seam.along_m) - 1))
        along = side.points_m[step] - side.points_m[step - 1]
        inner = inwards * np.array([-along[1], along[0]]) / np.linalg.norm(along) / MM_PER_M
        sheet.shapes.append(Shape(MARKS, (place.at(np.stack([point, point + NOTCH_MM * inner])),), False))
        x, y = place.at((point + (NOTCH_MM + 1.5 * SMALL_MM) * inner)[None])[0]
        sheet.texts.append(Text(f"{seam.number}.{i + 1}", x, y - SMALL_MM / 2, SMALL_MM))


def _name_and_arrow(sheet: Sheet, pattern: Pattern, place: Placed, panel: PatternPanel) -> None:
    """The panel's name and an arrow upwards, where the cloth is widest free of reinforcement."""
    cloth = shapely.Polygon(panel.flat.flat_m[panel.flat.panel.loops[0]])
    free = cloth.difference(shapely.union_all(panel.cut.polygons))
    # Where reinforcement covers the panel whole, the marks lie on it.
    widest: Any = shapely.maximum_inscribed_circle(cast(Any, cloth if free.is_empty else free))
    middle_m, radius_mm = np.asarray(widest.coords[0]), MM_PER_M * shapely.length(widest)
    up = np.array([0.0, min(ARROW_MM / 2, 0.5 * radius_mm)])
    x, y = place.at(middle_m[None])[0]
    tail, head = ((x, y) + sign * up @ place.turn for sign in (-1.0, 1.0))
    barb = 0.2 * (head - tail)
    for turn in (0.5, -0.5):
        cos, sin = np.cos(turn), np.sin(turn)
        sheet.shapes.append(Shape(MARKS, (np.stack([head, head - barb @ np.array([[cos, -sin], [sin, cos]])]),), False))
    sheet.shapes.append(Shape(MARKS, (np.stack([tail, head]),), False))
    beyond = up / np.linalg.norm(up) * 2 * SMALL_MM @ place.turn
    for label, (label_x, label_y) in ((pattern.options.up_label, head + beyond), (pattern.options.down_label, tail - beyond)):
        sheet.texts.append(Text(label, label_x, label_y - SMALL_MM / 2, SMALL_MM))
    sheet.texts.append(Text(f"{panel.name}  {pattern.name}", x + TITLE_MM, y + TITLE_MM / 2, TITLE_MM, "start"))
