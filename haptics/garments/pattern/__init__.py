"""From a garment and a design to pieces to cut (thesis 5.7): seams, flat panels, outlines, sheets in SVG and DXF."""

from importlib.util import find_spec

from haptics.errors import InputError

if find_spec("shapely") is None:
    raise InputError("patterns need shapely; install it with: pip install 'wearable-haptics[garment]'")

from haptics.garments.pattern.files import write_pattern
from haptics.garments.pattern.pattern import Pattern, PatternOptions, PatternPanel, Seam, SeamSide, make_pattern

__all__ = ["Pattern", "PatternOptions", "PatternPanel", "Seam", "SeamSide", "make_pattern", "write_pattern"]
