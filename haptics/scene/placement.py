"""Where to put an object so that a recorded hand meets it, whatever the recording.

*At the palm*: at an offset in the palm's axes. *In the hand*: where thumb and index close on it. A closing stroke is a fall
of the distance D between their tips from a local maximum to the next local minimum; it qualifies as a grasp if it falls by
50 mm or more to under 0.4 of its opening. The object of the first qualifying stroke is as wide as at half the fall,
``span = D_min + 0.5 (D_max - D_min)`` between the tips' centres, so its radius is ``span / 2 - tip radius``, and it sits
midway between the tips at the moment D crosses the span.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from haptics.errors import InputError
from haptics.scene.hands.frame import Floats
from haptics.scene.hands.joints import JOINT, SIDES
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.sites import TIP_RADIUS_M
from haptics.time import NS_PER_S
from haptics.units import one_of

MIN_FALL_M = 0.05
CLOSED_SHARE = 0.4
SPAN_SHARE = 0.5
TURN_M = 0.01
"""A rise this far above the lowest point ends a stroke, and a fall this far begins one: well above the noise of a tracker
(0.06 mm) and trembling fingers. Recorded strokes are the same ones for 1 to 30 mm."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """Thumb and index closing: from the widest moment to the closest.

    :param start_ns: when they are widest apart.
    :param end_ns: when they are closest.
    :param d_max_m: the distance of their tips' centres at the start, metres.
    :param d_min_m: the same at the end, metres.
    """

    start_ns: int
    end_ns: int
    d_max_m: float
    d_min_m: float

    @property
    def qualifies(self) -> bool:
        """Whether it is wide and tight enough to be taken for a grasp."""
        return self.d_max_m - self.d_min_m >= MIN_FALL_M and self.d_min_m < CLOSED_SHARE * self.d_max_m

    @property
    def span_m(self) -> float:
        """The distance of the tips' centres at which the object placed for this stroke is met."""
        return self.d_min_m + SPAN_SHARE * (self.d_max_m - self.d_min_m)


@dataclass(frozen=True, slots=True, eq=False)
class InHand:
    """An object placed in the hand.

    :param centre_m: (3,), metres.
    :param axis: (3,), unit, from the thumb's tip to the index's.
    :param radius_m: of a sphere that both tips touch at ``time_ns``, metres.
    :param span_m: distance of the tips' centres then, metres.
    :param time_ns: when the tips reach it.
    :param track_id: of the hand that does.
    :param stroke: with which it does.
    """

    centre_m: Floats
    axis: Floats
    radius_m: float
    span_m: float
    time_ns: int
    track_id: int
    stroke: Stroke


@dataclass(frozen=True, slots=True, eq=False)
class AtPalm:
    """An object placed relative to the palm.

    :param centre_m: (3,), metres, in the world.
    :param orientation_xyzw: (4,), the palm's, unit quaternion.
    """

    centre_m: Floats
    orientation_xyzw: Floats


def closing_strokes(track: HandTrack) -> list[Stroke]:
    """The strokes of a track that qualify as a grasp; one that the track's end cuts short counts as far as it got.

    :param track: one hand.
    :return: in order of time.
    """
    distance_m = np.linalg.norm(track.joint_m("index_tip") - track.joint_m("thumb_tip"), axis=1).tolist()
    return [stroke for first, last in _falls(distance_m) if (stroke := _stroke(track, distance_m, first, last)).qualifies]


def expected_grasps(recording: HandRecording, side: str | None = None) -> int:
    """How often a hand closes as if to grasp.

    :param recording: of one or both hands.
    :param side: ``left`` or ``right``; None: the one with most frames.
    :return: the number of qualifying strokes in all its tracks.
    :raises InputError: another side.
    """
    return sum(len(closing_strokes(track)) for track in _tracks(recording, side))


def place_in_hand(recording: HandRecording, side: str | None = None) -> InHand | None:
    """Where the first qualifying stroke meets its object.

    :param recording: of one or both hands.
    :param side: ``left`` or ``right``; None: the one with most frames.
    :return: or None if the hand never closes so.
    :raises InputError: another side.
    """
    for track in _tracks(recording, side):
        for stroke in closing_strokes(track):
            return _met(track, stroke)
    return None


def place_at_palm(
    recording: HandRecording, offset_m: ArrayLike = (0.0, 0.0, 0.0), side: str | None = None, at: str = "first"
) -> AtPalm:
    """A place fixed to the palm as it is at one pose: ``c = p + R o``.

    :param recording: of one or both hands.
    :param offset_m: ``o``, (3,), metres, in the palm's axes: x to the right seen from behind, -y out of the palm, -z forward.
    :param side: ``left`` or ``right``; None: the one with most frames.
    :param at: ``first`` pose of the recording, or ``median``: the middle of all its palm positions, and the mean direction.
    :return: the place in the world, and the palm's orientation.
    :raises InputError: another side or ``at``, a hand that the recording does not have, or an offset of another shape.
    """
    one_of("at", at, ("first", "median"))
    offset = np.asarray(offset_m, float)
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise InputError(f"offset_m = {offset_m!r}; expected three finite numbers, metres")
    tracks = _tracks(recording, side)
    if not tracks:
        raise InputError(f"{recording.source} has no {side or recording.side_with_most_frames} hand")
    palm_m = np.concatenate([track.position_m[:, JOINT["palm"]] for track in tracks])
    turn = np.concatenate([track.orientation_xyzw[:, JOINT["palm"]] for track in tracks])
    if at == "first":
        palm_m, turn = palm_m[:1], turn[:1]
    # The mean rotation is the main axis of q q^T, which does not mind the sign of a quaternion.
    orientation = np.linalg.eigh(turn.T @ turn)[1][:, -1]
    vector, scalar = orientation[:3], orientation[3]
    orientation = orientation if scalar >= 0 else -orientation
    twice = 2.0 * np.cross(vector, offset)
    centre = np.median(palm_m, axis=0) + offset + scalar * twice + np.cross(vector, twice)
    return AtPalm(centre, orientation)


def _tracks(recording: HandRecording, side: str | None) -> tuple[HandTrack, ...]:
    return recording.of_side(recording.side_with_most_frames if side is None else one_of("side", side, SIDES))


def _falls(distance_m: list[float]) -> list[tuple[int, int]]:
    """Indices of each local maximum and the minimum that follows it, turns smaller than ``TURN_M`` overlooked."""
    falls, widest, closest, falling = [], 0, 0, False
    for index, distance in enumerate(distance_m):
        if falling and distance <= distance_m[closest]:
            closest = index
        elif falling and distance - distance_m[closest] > TURN_M:
            falls.append((widest, closest))
            widest, falling = index, False
        elif not falling and distance >= distance_m[widest]:
            widest = index
        elif not falling and distance_m[widest] - distance > TURN_M:
            closest, falling = index, True
    return [*falls, (widest, closest)] if falling else falls


def _stroke(track: HandTrack, distance_m: list[float], first: int, last: int) -> Stroke:
    return Stroke(int(track.time_ns[first]), int(track.time_ns[last]), distance_m[first], distance_m[last])


def _met(track: HandTrack, stroke: Stroke) -> InHand:
    first, last = np.searchsorted(track.time_ns, [stroke.start_ns, stroke.end_ns])
    window = slice(first, last + 1)
    time_s = (track.time_ns[window] - stroke.start_ns) / NS_PER_S
    thumb_m, index_m = track.joint_m("thumb_tip")[window], track.joint_m("index_tip")[window]
    distance_m = np.linalg.norm(index_m - thumb_m, axis=1)
    after = int(np.argmax(distance_m <= stroke.span_m))
    before = after - 1
    share = (distance_m[before] - stroke.span_m) / (distance_m[before] - distance_m[after])

    def then(values: np.ndarray) -> np.ndarray:
        return values[before] + share * (values[after] - values[before])

    between_m = then(index_m) - then(thumb_m)
    return InHand(
        centre_m=0.5 * (then(thumb_m) + then(index_m)),
        axis=between_m / np.linalg.norm(between_m),
        radius_m=0.5 * stroke.span_m - TIP_RADIUS_M,
        span_m=stroke.span_m,
        time_ns=stroke.start_ns + round(float(then(time_s)) * NS_PER_S),
        track_id=track.track_id,
        stroke=stroke,
    )
