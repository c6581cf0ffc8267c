"""A sheet as SVG: 1 unit of the viewBox is 1 mm, one group a layer, in Inkscape's manner, which cutters' programs follow."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from haptics.garments.mesh import Floats
from haptics.garments.pattern.sheet import CLOTH, LAYERS, MARKS, REINFORCEMENT, SEAMS, TEXT, Sheet

SVG = "http://www.w3.org/2000/svg"
INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
STYLES = {
    REINFORCEMENT: {"fill": "#c8d8f0", "fill-rule": "evenodd", "stroke": "#d00000", "stroke-width": "0.25"},
    CLOTH: {"fill": "none", "stroke": "#000000", "stroke-width": "0.35"},
    SEAMS: {"fill": "none", "stroke": "#007030", "stroke-width": "0.25", "stroke-dasharray": "4 2"},
    MARKS: {"fill": "none", "stroke": "#404040", "stroke-width": "0.25"},
    TEXT: {"fill": "#202020", "font-family": "sans-serif"},
}


def svg_bytes(sheet: Sheet) -> bytes:
    """The file's content; the same sheet gives the same bytes.

    :param sheet: what to write.
    :return: SVG text in UTF-8.
    """
    ET.register_namespace("", SVG)
    ET.register_namespace("inkscape", INKSCAPE)
    width, height = _number(sheet.width_mm), _number(sheet.height_mm)
    size = {"width": f"{width}mm", "height": f"{height}mm", "viewBox": f"0 0 {width} {height}"}
    root = ET.Element(f"{{{SVG}}}svg", size)
    ET.SubElement(root, f"{{{SVG}}}title").text = sheet.title
    groups = {
        layer: ET.SubElement(
            root,
            f"{{{SVG}}}g",
            {"id": layer, f"{{{INKSCAPE}}}groupmode": "layer", f"{{{INKSCAPE}}}label": layer, **STYLES[layer]},
        )
        for layer in LAYERS
    }
    for shape in sheet.shapes:
        path = " ".join(_path(line, sheet.height_mm, shape.closed) for line in shape.lines)
        ET.SubElement(groups[shape.layer], f"{{{SVG}}}path", {"d": path})
    for text in sheet.texts:
        place = {"x": _number(text.x_mm), "y": _number(sheet.height_mm - text.y_mm)}
        style = {"font-size": _number(text.height_mm / CAPITALS), "text-anchor": text.anchor}
        ET.SubElement(groups[TEXT], f"{{{SVG}}}text", place | style).text = text.text
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


CAPITALS = 0.72
"""Height of capitals over the size of a sans-serif font."""


def _path(points_mm: Floats, height_mm: float, closed: bool) -> str:
    """SVG's y runs down the page."""
    steps = " ".join(f"{_number(x)},{_number(height_mm - y)}" for x, y in points_mm)
    return f"M {steps} Z" if closed else f"M {steps}"


def _number(value_mm: float) -> str:
    """A tenth of a micrometre is fine enough; no negative zero."""
    return f"{round(float(value_mm), 4) + 0.0:.4f}".rstrip("0").rstrip(".")
