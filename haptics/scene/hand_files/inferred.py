"""What a file does not say of its numbers, where the numbers leave one answer only; elsewhere it is asked for.

- *Unit of lengths.* From wrist to tip along its middle finger, a hand is ``SHORTEST_M`` to ``LONGEST_M`` long: less than a factor
  of ten, so that at most one of metre, centimetre and millimetre fits.
- *Unit of time.* Poses of a tracker are ``FASTEST_S`` to ``SLOWEST_S`` apart: less than a factor of a thousand, likewise.
- *Basis.* A joint's own forward axis runs along its bone. OpenXR's, Unity's and Unreal's differ in it.
"""

from __future__ import annotations

import numpy as np

from haptics.errors import InputError
from haptics.scene.hand_files.spelling import TIMES_NS, UNITS_M
from haptics.scene.hands.basis import BASES
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.handedness import ALONG_BONES, along_bones
from haptics.scene.hands.joints import JOINT
from haptics.time import NS_PER_S

SHORTEST_M, LONGEST_M = 0.08, 0.30
"""Length of a hand from the wrist to the tip of the middle finger, a small child's and the largest (assumed, with a margin)."""
FASTEST_S, SLOWEST_S = 1e-3, 0.5
"""How far apart a tracker's poses are in the median (assumed; those in use give some 10 to 300 a second)."""
_CHAIN = [JOINT["wrist"], *(JOINT[f"middle_{part}"] for part in ("proximal", "intermediate", "distal", "tip"))]
ASK = "say it in the file, or convert it with `haptics hand convert FILE OUT"
"""Ends a message, with the option that says it."""


def unit_of_length(position: Floats, declared: str | None) -> tuple[str, list[str]]:
    """The unit of a file's lengths.

    :param position: (n, 26, 3), in that unit, n at least 1.
    :param declared: what is said of it, or None.
    :return: one of ``UNITS_M``, and a note where it was inferred.
    :raises InputError: nothing is said, and no unit makes it a hand's size; or another is said than the only one that does.
    """
    bones = np.diff(position[:, _CHAIN], axis=1)
    long = float(np.median(np.sum(np.linalg.norm(bones, axis=2), axis=1)))
    fitting = next((unit for unit, size_m in UNITS_M.items() if SHORTEST_M <= long * size_m <= LONGEST_M), None)
    hand = f"the hand is {long:.4g} long from its wrist to the tip of its middle finger"
    if declared is not None:
        if fitting not in (None, declared):
            raise InputError(f"unit = {declared!r}, but {hand}, which is a hand's length in {fitting} only")
        return declared, []
    if fitting is None:
        raise InputError(
            f"the unit of its lengths is not declared, and {hand}, a hand's length in none of {', '.join(UNITS_M)}; {ASK} --unit`"
        )
    return fitting, [f"unit: {fitting} was inferred, as {hand}; the file does not say"]


def unit_of_time(time: Floats, declared: str | None) -> tuple[str, list[str]]:
    """The unit of a file's times.

    :param time: (n,), of one hand, in that unit.
    :param declared: what is said of it, or None.
    :return: one of ``TIMES_NS``, and a note where it was inferred, or looks wrong.
    :raises InputError: nothing is said, and no unit makes it the pace of a tracker.
    """
    apart = np.diff(np.unique(time))
    median = float(np.median(apart)) if len(apart) else 0.0
    paces_s = {unit: median * size_ns / NS_PER_S for unit, size_ns in TIMES_NS.items()}
    fitting = next((unit for unit, pace_s in paces_s.items() if FASTEST_S <= pace_s <= SLOWEST_S), None)
    if declared is not None:
        if fitting in (None, declared):
            return declared, []
        how = "fast" if paces_s[declared] < FASTEST_S else "slow"
        return declared, [f"the poses are {paces_s[declared]:.3g} s apart, too {how} for a tracker; are the times in {fitting}?"]
    if fitting is not None:
        return fitting, [f"time: {fitting} was inferred, as poses are {median:.4g} apart; the file does not say"]
    raise InputError(
        f"the unit of its times is not declared, and its poses are {median:.4g} apart, the pace of a tracker in none of "
        f"{', '.join(TIMES_NS)}; {ASK} --time`"
    )


def basis_of(position: Floats, orientation: Floats, turned: bool, declared: str | None) -> tuple[str, list[str]]:
    """Whose axes a file's numbers have.

    :param position: (n, 26, 3), in any unit.
    :param orientation: (n, 26, 4), quaternions; looked at unless ``turned``.
    :param turned: whether the file has no orientations.
    :param declared: what is said of it, or None.
    :return: a name of ``BASES``, and a note where it was inferred.
    :raises InputError: nothing is said and it cannot be known, or the joints contradict what is said.
    """
    if turned:
        if declared is None:
            raise InputError(f"its basis is not declared, and without orientations it cannot be known; {ASK} --basis`")
        return declared, []
    fit = {name: _along(name, position, orientation) for name in BASES}
    fitting = next((name for name, cosine in fit.items() if cosine >= ALONG_BONES), None)
    if declared is not None and fit[declared] >= ALONG_BONES:
        return declared, []
    if declared is not None:
        cure = "no other fits either; is a quaternion (x, y, z, w)?" if fitting is None else f"{fitting} fits"
        raise InputError(
            f"basis = {declared!r} does not fit the joints: their forward axes do not run along the fingers' bones; {cure}"
        )
    if fitting is None:
        raise InputError(
            f"its basis is not declared, and in none of {', '.join(BASES)} the joints' forward axes run along the fingers' "
            "bones; turn each joint so that it points along its bone as your engine points forward"
        )
    return fitting, [f"basis: {fitting} was inferred, as the joints' forward axes fit no other; the file does not say"]


def _along(name: str, position: Floats, orientation: Floats) -> float:
    poses = BASES[name].to_openxr(position, orientation)
    return float(np.median([along_bones(*pose) for pose in zip(*poses, strict=True)]))
