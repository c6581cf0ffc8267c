"""From poses as a file has them to a recording: units, basis and time are settled for all of it, missing joints are put in.

A pose that lacks a joint, an orientation or a time in order is refused and the rest kept; where a large share is, the file is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.scene.hand_files.declared import Declared
from haptics.scene.hand_files.inferred import ASK, basis_of, unit_of_length, unit_of_time
from haptics.scene.hand_files.pose_rows import PoseRows
from haptics.scene.hand_files.spelling import TIMES_NS, UNITS_M
from haptics.scene.hand_files.tracked import WholePoses, forward, runs, whole_ns
from haptics.scene.hands.basis import BASES, Basis
from haptics.scene.hands.completion import MAKEABLE, REQUIRED, bent_back, completed
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import JOINT, JOINTS, SIDES, Side
from haptics.scene.hands.origin import Origin
from haptics.scene.hands.recording import HandRecording, HandTrack, RefusedPose
from haptics.time import NS_PER_S

LOOKED_AT = 200
"""So many poses, from all of the file, are enough to see in which basis and unit it is."""
_NOBODY = "poses without a hand: no joint has a place of its own"


def settled(rows: PoseRows, told: Declared, source: str, form: str, axes: Basis | None = None) -> HandRecording:
    """The recording that collected poses are.

    :param rows: of a whole file.
    :param told: what whoever reads it says of its numbers; it counts before what the file says.
    :param source: the file's name.
    :param form: what kind of file it is, in words.
    :param axes: of the numbers, in metres, where the kind of file says so; None: as is said or certain.
    :return: in metres and OpenXR's basis; time zero is the first pose.
    :raises InputError: there is no pose, something is neither said nor certain, or a large share of the poses is refused.
    """
    rows.check_share()
    said = told.over(rows.declared)
    numbers = rows.table()
    turned = bool(np.isnan(numbers[:, :, 3:]).all())
    placed = np.all(np.isfinite(numbers[:, :, :3]), axis=2)
    there = _there(numbers, placed)
    rows.dropped.update({_NOBODY: int((~there).sum())} if not there.all() else {})
    made = tuple(name for name in MAKEABLE if 2 * int(placed[there, JOINT[name]].sum()) < int(there.sum()))
    whole = _sided(rows, _whole(rows, numbers, placed, there, made, turned), said.side)
    rows.check_share(len(whole))
    index = [one for one, side in whole.items() if told.side in (None, side)]
    sides: list[Side] = [whole[one] for one in index]
    if not index:
        gone = "".join(f"; left out: {count} {name}" for name, count in rows.dropped.items())
        raise InputError(f"there is no pose{f' of the {told.side} hand' if told.side else ''} in it{gone}")

    time, of_time = unit_of_time(_of_one_hand(rows, index, sides), said.time)
    size_ns = TIMES_NS[time]
    axes, of_axes = (axes, []) if axes is not None else _axes(numbers[index[:: 1 + len(index) // LOOKED_AT]], turned, said)
    poses = forward(WholePoses(np.array(index), sides, whole_ns([rows.time[one] for one in index], size_ns)), rows)
    rows.check_share(len(poses.index))

    numbers = numbers[poses.index]
    first_ns, last_ns = int(poses.time_ns.min()), int(poses.time_ns.max())
    unit = next(name for name, size_m in UNITS_M.items() if size_m == axes.unit_m)
    origin = Origin(form, axes.name, unit, time, made, turned, _off_m(axes, numbers))
    tracks = tuple(
        _track(number, side, poses.time_ns[run] - first_ns, numbers[run], axes, origin)
        for number, (side, run) in enumerate(runs(poses, [rows.track[one] for one in poses.index]))
    )
    return HandRecording(
        source=source,
        tracks=tracks,
        frame_count=len(np.unique(poses.time_ns)),
        duration_s=(last_ns - first_ns) / NS_PER_S,
        dropped=dict(rows.dropped),
        refused=tuple(
            RefusedPose(None if at is None else round(at * size_ns) - first_ns, side, reason) for at, side, reason in rows.refused
        ),
        notes=(*of_time, *of_axes, *origin.made_of_others, *(_bent_back(tracks) if turned else ())),
        origin=origin,
    )


def _there(numbers: Floats, placed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of which poses there is a hand; while there is none, trackers give no joints, or all in one point."""
    required = [JOINT[name] for name in REQUIRED]
    place = numbers[:, required, :3]
    return np.any(placed, axis=1) & ~np.all(place == place[:, :1], axis=(1, 2))


def _whole(
    rows: PoseRows,
    numbers: Floats,
    placed: NDArray[np.bool_],
    there: NDArray[np.bool_],
    made: tuple[str, ...],
    turned: bool,
) -> NDArray[np.int64]:
    """Which poses have all that is not made; the others of a hand that is there are refused."""
    read = [JOINT[name] for name in JOINTS if name not in made]
    oriented = np.ones_like(placed) if turned else np.all(np.isfinite(numbers[:, :, 3:]), axis=2)
    whole = np.all((placed & oriented)[:, read], axis=1)
    for index in np.flatnonzero(there & ~whole).tolist():
        what, has = ("position", placed) if not placed[index, read].all() else ("orientation", oriented)
        lost = ", ".join(JOINTS[joint] for joint in read if not has[index, joint])
        rows.reject(index, f": no {what} of {lost}; missing, called otherwise, or lost")
    return np.flatnonzero(there & whole)


def _sided(rows: PoseRows, index: NDArray[np.int64], said: str | None) -> dict[int, Side]:
    """The side of each pose, by its index; a pose without one is refused."""
    found: dict[int, Side] = {}
    for one in index.tolist():
        side = rows.side[one] or said
        if side == "left" or side == "right":
            found[one] = side
        else:
            rows.reject(one, f" does not say of which hand it is, left or right; {ASK} --side`")
    return found


def _of_one_hand(rows: PoseRows, index: list[int], sides: list[Side]) -> Floats:
    """The times of the hand that has most poses, as those of two may lie close together."""
    times = ([rows.time[one] for one, own in zip(index, sides, strict=True) if own == side] for side in SIDES)
    return np.array(max(times, key=len), float)


def _axes(numbers: Floats, turned: bool, said: Declared) -> tuple[Basis, list[str]]:
    unit, of_unit = unit_of_length(numbers[:, :, :3], said.unit)
    basis, of_basis = basis_of(numbers[:, :, :3], numbers[:, :, 3:], turned, said.basis)
    return replace(BASES[basis], unit_m=UNITS_M[unit]), [*of_unit, *of_basis]


def _off_m(axes: Basis, numbers: Floats) -> float:
    """How far a joint comes to lie from where the file has it, when it is turned back, m."""
    position, turn = numbers[:, :, :3], numbers[:, :, 3:]
    back = axes.from_openxr(*axes.to_openxr(position, turn))[0]
    return float(np.nanmax(np.linalg.norm(back - position, axis=2))) * axes.unit_m


def _track(number: int, side: Side, time_ns: NDArray[np.int64], numbers: Floats, axes: Basis, origin: Origin) -> HandTrack:
    position_m, turn = axes.to_openxr(numbers[:, :, :3], numbers[:, :, 3:])
    return HandTrack(side, number, time_ns, *completed(position_m, turn, side, origin.made, origin.turned))


def _bent_back(tracks: tuple[HandTrack, ...]) -> list[str]:
    """Where orientations were made of the side that is stated, only how the fingers bend can speak against it."""
    wrong = {track.side for track in tracks if bent_back(track.position_m, track.side)}
    return [
        f"the {side} hand's fingers bend out of its back: it may be the other hand, or a mirrored one" for side in sorted(wrong)
    ]
