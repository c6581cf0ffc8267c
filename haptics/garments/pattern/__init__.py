"""From a garment and a design to pieces to cut (thesis 5.7): seams, flat panels, outlines, sheets in SVG and DXF."""

from importlib.util import find_spec

from haptics.errors import InputError
from haptics.extras import install

if find_spec("shapely") is None:
    raise InputError(f"patterns need shapely; install it with: {install('garment')}")

from haptics.garments.pattern.files import write_pattern
from haptics.garments.pattern.pattern import Pattern, PatternOptions, PatternPanel, Seam, SeamSide, make_pattern

__all__ = ["Pattern", "PatternOptions", "PatternPanel", "Seam", "SeamSide", "make_pattern", "write_pattern"]
