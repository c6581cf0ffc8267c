"""What the views draw, from whatever streams a recording has: one hand, its actuators, its devices, what happened.

Streams and fields that are absent give empty arrays, so that a view shows the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.recording.recording import Recording
from haptics.recording.streams import check_fields, is_unicode
from haptics.time import NS_PER_S

RISE_SCALE_K = 25.0
"""Temperature rise at the top of the colour scale."""
RISE_COLOURS = ((69, 117, 180), (145, 191, 219), (254, 224, 144), (252, 141, 89), (215, 48, 39))
"""The colour scale from 0 K to :data:`RISE_SCALE_K` in equal steps (sRGB): blue to red, distinct to the colour-blind."""

FINGERS = ("thumb", "index", "middle", "ring", "little")
SIDES = ("left", "right")

# OpenXR's 26 joints: palm, wrist, four of the thumb, five of each other finger
_WRIST, _METACARPAL, _TIP = 1, (2, 6, 11, 16, 21), (5, 10, 15, 20, 25)
CHAINS = np.array(
    [[_WRIST, *range(first, last + 1), *[last] * (4 - last + first)] for first, last in zip(_METACARPAL, _TIP, strict=True)]
)
"""Joint indices from the wrist to each fingertip, (5, 6); the thumb's tip is repeated."""

# where a glove's actuators sit if the recording does not state it: halfway between two joints
_NOMINAL_SITES = {
    **{f"{finger}_tip": (tip, tip) for finger, tip in zip(FINGERS, _TIP, strict=True)},
    **{f"{finger}_phalanx": (tip - 2, tip - 1) for finger, tip in zip(FINGERS[:4], _TIP, strict=False)},
    **{f"palm_{finger}": (base + 1, base + 1) for finger, base in zip(FINGERS, _METACARPAL, strict=True)},
    "palm_outer": (2, 3),
}


_NUMBERS = "biuf"
_KNOWN: dict[str, dict[str, tuple[str, tuple[int, ...] | None]]] = {
    "poses": {"side": ("iu", ()), "accepted": ("biu", ()), "position_m": ("f", (26, 3)), "orientation_xyzw": ("f", (26, 4))},
    "ticks": dict.fromkeys(("rise_k", "pin_out", "volts", "force_n", "piezo"), (_NUMBERS, None)),
    "requests": {"site": ("Siu", ()), "kind": ("S", ()), "played": ("biu", ()), "reason": ("S", ())},
    "events": {"kind": ("S", ()), "subject": ("S", ())},
}
"""What the fields are that views look for; see ``streams.check_fields``."""


@dataclass(frozen=True)
class Sites:
    """Where actuators sit on the joints: ``c = W p + R(q_f) o``.

    :ivar names: of the actuators (n,).
    :ivar weights: ``W``, of each joint (n, 26).
    :ivar offset_joint: ``f`` (n,), the joint in whose axes the offset is, 0 to 25.
    :ivar offset_m: ``o``, m (n, 3).
    """

    names: tuple[str, ...]
    weights: NDArray[np.float64]
    offset_joint: NDArray[np.intp]
    offset_m: NDArray[np.float64]

    def positions(self, poses: NDArray[np.void]) -> NDArray[np.float32]:
        """Centres of the actuators.

        :param poses: rows of the stream ``poses`` (time,).
        :return: m (time, n, 3).
        """
        centres = np.einsum("sj,tjk->tsk", self.weights, poses["position_m"].astype(float))
        if np.any(self.offset_m):
            turn = poses["orientation_xyzw"][:, self.offset_joint].astype(float)
            cross = 2.0 * np.cross(turn[..., :3], self.offset_m)
            centres += self.offset_m + turn[..., 3:] * cross + np.cross(turn[..., :3], cross)
        return centres.astype(np.float32)


def sites_of(recording: Recording) -> Sites:
    """The header's ``sites`` (``names``, ``weights``, ``offset_joint``, ``offset_m``), or a nominal glove's.

    :param recording: whose header is read.
    :return: the sites.
    :raises InputError: they are not of that form.
    """
    given = recording.header.get("sites")
    if isinstance(given, dict) and {"names", "weights"} <= set(given):
        try:
            return _sites(given)
        except (OverflowError, TypeError, ValueError) as error:
            raise InputError(f"{recording.path}: the header's sites cannot be drawn: {error}") from error
    weights = np.zeros((len(_NOMINAL_SITES), 26))
    for row, (one, other) in zip(weights, _NOMINAL_SITES.values(), strict=True):
        row[one] += 0.5
        row[other] += 0.5
    return Sites(tuple(_NOMINAL_SITES), weights, np.zeros(len(weights), np.intp), np.zeros((len(weights), 3)))


def _sites(given: dict[str, Any]) -> Sites:
    weights = np.array(given["weights"], float)
    count = len(given["names"])
    joint = np.array(given.get("offset_joint", np.zeros(count, int)))
    offset_m = np.array(given.get("offset_m", np.zeros((count, 3))), float)
    if not all(isinstance(name, str) and is_unicode(name) for name in given["names"]):
        raise TypeError("a name is not text")
    if weights.shape != (count, 26) or joint.shape != (count,) or offset_m.shape != (count, 3):
        raise ValueError(f"{count} names, weights {weights.shape}, offset_joint {joint.shape}, offset_m {offset_m.shape}")
    if count and (joint.dtype.kind != "i" or joint.min() < 0 or joint.max() > 25):
        raise ValueError("offset_joint is not a joint, 0 to 25")
    if not (np.abs(weights) <= 1e3).all() or not (np.abs(offset_m) <= 1e3).all():
        raise ValueError("a weight or offset beyond 1000")
    return Sites(tuple(given["names"]), weights, joint.astype(np.intp), offset_m)


def rows(recording: Recording, name: str, fields: Sequence[str]) -> NDArray[np.void]:
    """A stream's rows.

    :param recording: where to look.
    :param name: of the stream.
    :param fields: that it must have.
    :return: structured array ``(n,)``; empty if the recording lacks the stream or one of ``fields``.
    :raises InputError: a field that views look for is of another type or shape.
    """
    if name in recording and set(fields) <= set(recording.streams[name].fields):
        spec = recording.streams[name]
        known = {field: kind for field, kind in _KNOWN.get(name, {}).items() if field in spec.fields}
        check_fields(str(recording.path), spec, known)
        return recording.stream(name)
    return np.zeros(0, [("time_ns", "<i8"), *((field, "<f4") for field in fields)])


def field(rows: NDArray[np.void], name: str) -> NDArray[Any]:
    """A field of rows as a table.

    :param rows: structured array (time,).
    :param name: of the field.
    :return: its values (time, n), with n = 0 if there is no such field.
    """
    if name not in (rows.dtype.names or ()):
        return np.zeros((len(rows), 0))
    width = int(np.prod(rows.dtype[name].shape))
    return rows[name].reshape(len(rows), width)


def poses_of(recording: Recording, side: str) -> NDArray[np.void]:
    """Accepted, finite poses of one hand.

    :param recording: where to look.
    :param side: "left" or "right".
    :return: rows of the stream ``poses`` (n,).
    """
    poses = rows(recording, "poses", ("side", "accepted", "position_m", "orientation_xyzw"))
    if not len(poses):
        return poses
    finite = np.isfinite(poses["position_m"]).all(axis=(1, 2)) & np.isfinite(poses["orientation_xyzw"]).all(axis=(1, 2))
    return poses[(poses["side"] == SIDES.index(side)) & (poses["accepted"] != 0) & finite]


def glove_side(recording: Recording) -> str:
    """The hand that wears the glove: the header's ``side``, or the one with more poses.

    :param recording: where to look.
    :return: "left" or "right".
    """
    side = recording.header.get("side")
    return side if side in SIDES else max(reversed(SIDES), key=lambda side: len(poses_of(recording, side)))


def start_ns(recording: Recording) -> int:
    """When the session began: the header's ``start_ns``, or the earliest row that a view shows.

    :param recording: where to look.
    :return: host time, ns; 0 if there are no rows.
    """
    given = recording.header.get("start_ns")
    if isinstance(given, int) and abs(given) < 2**62:
        return given
    shown = [rows(recording, name, ())["time_ns"] for name in ("poses", "ticks", "events")]
    return min((int(time_ns.min()) for time_ns in shown if time_ns.size), default=0)


def seconds(time_ns: NDArray[Any], origin_ns: int) -> NDArray[np.float64]:
    """Time since an origin.

    :param time_ns: ns, any shape.
    :param origin_ns: ns.
    :return: s, the same shape.
    """
    return (time_ns - origin_ns) / NS_PER_S


def text(column: NDArray[Any]) -> list[str]:
    """A column of fixed-length text; numbers read as such.

    :param column: (n,).
    :return: n texts.
    """
    return [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value) for value in column.tolist()]


def events_of(recording: Recording) -> list[tuple[int, str, str]]:
    """What happened, in time's order.

    :param recording: where to look.
    :return: (time_ns, level, words) of each; level ``WARN`` for faults and for pulses denied, else ``INFO``.
    """
    lines = []
    for row in rows(recording, "events", ("kind",)):
        words = " ".join(filter(None, text(np.array([row[field] for field in row.dtype.names[1:]]))))
        trouble = any(word in words for word in ("fault", "lost", "refused", "error"))
        lines.append((int(row["time_ns"]), "WARN" if trouble else "INFO", words))
    requests = rows(recording, "requests", ("site", "kind", "played", "reason"))
    denied = requests[requests["played"] == 0]
    names = sites_of(recording).names
    for time_ns, site, kind, reason in zip(
        denied["time_ns"].tolist(), denied["site"].tolist(), text(denied["kind"]), text(denied["reason"]), strict=True
    ):
        where = names[site] if isinstance(site, int) and 0 <= site < len(names) else text(np.array([site]))[0]
        lines.append((time_ns, "WARN", f"{where}: {kind} denied: {reason}"))
    return sorted(lines, key=lambda line: line[0])


def touches_of(recording: Recording) -> list[tuple[int, str]]:
    """When the hand touched: the events of kind ``touch``.

    :param recording: where to look.
    :return: (time_ns, site) of each.
    """
    events = rows(recording, "events", ("kind", "subject"))
    if not len(events):
        return []
    touch = events[events["kind"] == b"touch"]
    return list(zip(touch["time_ns"].tolist(), text(touch["subject"]), strict=True))


def labels(names: Sequence[str], count: int, what: str) -> list[str]:
    """Names for a number of lines: those given, then numbers.

    :param names: as far as they are known.
    :param count: how many are wanted.
    :param what: word before a number.
    :return: ``count`` names.
    """
    return [*names[:count], *(f"{what} {index}" for index in range(len(names), count))]


def brakes_of(recording: Recording) -> tuple[str, ...]:
    """What each output of the brake controller drives: the header's ``brakes``.

    :param recording: whose header is read.
    :return: names, as far as there are any.
    """
    given = recording.header.get("brakes")
    return tuple(map(str, given)) if isinstance(given, list) else ()


def rise_colours(rise_k: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours of temperature rises; what is not finite is grey.

    :param rise_k: K (...,).
    :return: sRGB (..., 3).
    """
    known = np.isfinite(rise_k)
    place = np.clip(np.where(known, rise_k, 0.0) / RISE_SCALE_K, 0.0, 1.0)
    steps = np.linspace(0.0, 1.0, len(RISE_COLOURS))
    parts = [np.interp(place, steps, [colour[part] for colour in RISE_COLOURS]) for part in range(3)]
    return np.where(known[..., None], np.stack(parts, axis=-1).round(), 128).astype(np.uint8)
