"""Whether a pose that was handed in is one at all: types and shapes, before any number in it is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from haptics.scene.joints import SIDES
from haptics.scene.shown import shown

if TYPE_CHECKING:
    from haptics.scene.hand import HandFrame


def ill_formed(frame: HandFrame) -> str | None:
    """Why a frame's fields are not of the types and shapes that they must have, or None."""
    for name, bits in (("time_ns", 63), ("track_id", 31)):
        number = getattr(frame, name)
        if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or abs(int(number)) >= 1 << bits:
            return f"{name} is {shown(number)}; allowed: a whole number of {bits + 1} bits"
    if not isinstance(frame.side, str) or frame.side not in SIDES:
        return f"side is {shown(frame.side)}; allowed: {', '.join(SIDES)}"
    if not isinstance(frame.valid, (bool, np.bool_)):
        return f"valid is {shown(frame.valid)}; allowed: True or False"
    for name, shape in (("position_m", (26, 3)), ("orientation_xyzw", (26, 4))):
        array = getattr(frame, name)
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "fi":
            return f"{name} is {shown(array)}; allowed: an array {shape} of numbers"
    position, orientation = frame.position_m, frame.orientation_xyzw
    if position.shape != (26, 3) or orientation.shape != (26, 4):
        return f"shapes {position.shape} and {orientation.shape}; allowed: (26, 3) and (26, 4)"
    return None
