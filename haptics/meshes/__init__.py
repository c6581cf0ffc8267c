"""Meshes drawn in other programs: reading them, guessing wrong units and axes, repairing them with a note, finding holes.

Shared by all rooms that take meshes; what else a mesh must be, each of them checks itself.
"""

from haptics.meshes.cleaning import cleaned
from haptics.meshes.files import FORMATS, LARGEST_TRIANGLES, check_arrays, read_triangles
from haptics.meshes.fitting import Fit, best_fit
from haptics.meshes.frame import AXES, UNITS, WORDS, Kind, SizeFault, extent_of, in_frame, other_unit, size_fault
from haptics.meshes.holes import capped, holes, holes_in_words
from haptics.meshes.orientation import MAX_PIECES, outward, pieces_of
from haptics.meshes.winding import winding_number

__all__ = [
    "AXES",
    "FORMATS",
    "LARGEST_TRIANGLES",
    "MAX_PIECES",
    "UNITS",
    "WORDS",
    "Fit",
    "Kind",
    "SizeFault",
    "best_fit",
    "capped",
    "check_arrays",
    "cleaned",
    "extent_of",
    "holes",
    "holes_in_words",
    "in_frame",
    "other_unit",
    "outward",
    "pieces_of",
    "read_triangles",
    "size_fault",
    "winding_number",
]
