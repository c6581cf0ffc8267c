"""A sheet as DXF (R2010) in millimetres, with the layers of the SVG; every outline a closed polyline, holes clockwise."""

from __future__ import annotations

from io import StringIO
from typing import Any

from haptics.errors import InputError
from haptics.extras import install
from haptics.garments.pattern.sheet import CLOTH, LAYERS, MARKS, REINFORCEMENT, SEAMS, TEXT, Sheet

COLOURS = {REINFORCEMENT: 1, CLOTH: 7, SEAMS: 3, MARKS: 8, TEXT: 8}
"""AutoCAD's colour numbers."""


def dxf_bytes(sheet: Sheet) -> bytes:
    """The file's content; the same sheet gives the same bytes.

    :param sheet: what to write.
    :return: DXF text, R2010, in mm.
    :raises InputError: ezdxf is missing.
    """
    ezdxf = _ezdxf()
    stream = StringIO()
    # A file's dates and random identifiers are all that differs between two runs; ezdxf leaves them out only by this switch.
    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        document = _document(ezdxf, sheet)
        document.write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    return document.encode(stream.getvalue())


def _ezdxf() -> Any:
    try:
        import ezdxf
    except ImportError as error:
        raise InputError(f"writing DXF needs ezdxf; install it with: {install('garment')}") from error
    return ezdxf


def _document(ezdxf: Any, sheet: Sheet) -> Any:
    from ezdxf.enums import TextEntityAlignment

    document = ezdxf.new("R2010", units=ezdxf.units.MM)
    document.header["$EXTMIN"], document.header["$EXTMAX"] = (0, 0, 0), (sheet.width_mm, sheet.height_mm, 0)
    for layer in LAYERS:
        document.layers.add(layer, color=COLOURS[layer])
    space = document.modelspace()
    for shape in sheet.shapes:
        for line in shape.lines:
            space.add_lwpolyline(line.tolist(), close=shape.closed, dxfattribs={"layer": shape.layer})
    alignments = {"middle": TextEntityAlignment.BOTTOM_CENTER, "start": TextEntityAlignment.LEFT}
    for text in sheet.texts:
        entity = space.add_text(text.text, height=text.height_mm, dxfattribs={"layer": TEXT})
        entity.set_placement((text.x_mm, text.y_mm), align=alignments[text.anchor])
    return document
