"""The names of a hand's 26 joints, in OpenXR's order (``XR_EXT_hand_tracking``), and how thick a hand is there."""

from __future__ import annotations

import re
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.units import nearest

FINGERS = ("thumb", "index", "middle", "ring", "little")
JOINTS: tuple[str, ...] = (
    "palm",
    "wrist",
    *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")),
    *(f"{finger}_{part}" for finger in FINGERS[1:] for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")),
)
JOINT = {name: index for index, name in enumerate(JOINTS)}
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
_HUMPS = re.compile(r"(?<=[a-z])(?=[A-Z])")
"""Between the words of ``ThumbTip``."""


def _nominal_radius_m() -> NDArray[np.float64]:
    """Half the thickness of an adult hand at each joint, metres, shape (26,); assumed, as not every tracker reports it."""
    of_part = {"palm": 0.014, "wrist": 0.022, "metacarpal": 0.014, "proximal": 0.010, "intermediate": 0.009}
    radius = np.array([of_part.get(name.split("_")[-1], 0.008) for name in JOINTS])
    radius.flags.writeable = False
    return radius


NOMINAL_RADIUS_M = _nominal_radius_m()


def joint_index(name: str) -> int:
    """The place of a joint in ``JOINTS``.

    :param name: ours, or the spelling of OpenXR, WebXR, Unity XR Hands, Unreal or Godot; ``pinky`` is ``little``.
    :return: 0 to 25.
    :raises InputError: no such joint.
    """
    plain = _HUMPS.sub("_", str(name)).lower().replace("-", "_")
    plain = plain.removeprefix("xr_").removeprefix("hand_joint_").removesuffix("_ext")
    plain = plain.replace("_finger", "").replace("_phalanx", "").replace("pinky", "little")
    if plain not in JOINT:
        known = f"{', '.join(JOINTS)}, or WebXR's or Unity's names for them{nearest(plain, JOINTS)}"
        raise InputError(f"joint = {name!r} is not known; known joints: {known}")
    return JOINT[plain]
