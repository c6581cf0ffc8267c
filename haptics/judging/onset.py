"""Onset error: when a device acted, less when the hand really touched.

*Touched* is the first moment at which a site's signed distance to an object reaches zero on a cubic through all frames, future
ones too, and counts if the touch gets 1 mm deep and is not at the very edge of the track. Touched and acted are matched one to
one within 100 ms, nearest first. A person accepts errors within [-15, +50] ms (Di Luca and Mahnan 2019, by its abstract).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.time import NS_PER_MS, NS_PER_S

Floats = NDArray[np.float64]

DEEP_M = 1e-3
AFTER_START_NS = 120 * NS_PER_MS
BEFORE_END_NS = 60 * NS_PER_MS
MATCH_NS = 100 * NS_PER_MS
FALSE_NS = 50 * NS_PER_MS
WINDOW_NS = (-15 * NS_PER_MS, 50 * NS_PER_MS)
FAST_M_S = 0.1
SPEED_EDGES_M_S = (0.0, 0.1, 0.2, 0.5, 1.0, np.inf)
TRUTH_STEP_NS = NS_PER_MS // 2


@dataclass(frozen=True, slots=True)
class Touched:
    """A touch that happened.

    :param time_ns: when the distance crossed zero.
    :param site: 0 to 14, the place in ``SITES``.
    :param object: its name.
    :param approach_m_s: speed at which the distance fell at that moment, m/s.
    :param depth_m: the deepest it got before it ended, metres.
    :param counted: deep enough, and not at the track's edge; others only excuse those who acted for them.
    """

    time_ns: int
    site: int = 0
    object: str = ""
    approach_m_s: float = 1.0
    depth_m: float = 0.01
    counted: bool = True


def touches_on(time_ns: ArrayLike, distance_m: Floats, sites: Collection[int] | None = None, name: str = "") -> list[Touched]:
    """Touches of one object in one track, in the order of site and time; one that lasts from before the start is not among them.

    :param time_ns: (t,), of the whole track, close enough for a straight line between (1 ms or less).
    :param distance_m: (t, n), metres, signed distance of each site's sphere on the true path.
    :param sites: columns that are wanted; None: all.
    :param name: the object's, passed on to each touch.
    :return: all touches, those that do not count included.
    """
    times = np.asarray(time_ns, dtype=np.int64)
    wanted = range(distance_m.shape[1]) if sites is None else sorted(sites)
    return [touch for site in wanted for touch in _touches(times, distance_m[:, site], site, name)]


def _touches(times: NDArray[np.int64], distance: Floats, site: int, name: str) -> Iterable[Touched]:
    outside = distance > 0.0
    ends = np.append((~outside[:-1] & outside[1:]).nonzero()[0], len(times) - 1)
    for at in (outside[:-1] & ~outside[1:]).nonzero()[0].tolist():
        step_ns, fell_m = int(times[at + 1] - times[at]), float(distance[at] - distance[at + 1])
        touch_ns = int(times[at]) + round(step_ns * float(distance[at]) / fell_m)
        end = int(ends[np.searchsorted(ends, at + 1)])
        depth_m = -float(distance[at + 1 : end + 1].min())
        inner = times[0] + AFTER_START_NS <= touch_ns <= times[-1] - BEFORE_END_NS
        yield Touched(touch_ns, site, name, fell_m / step_ns * NS_PER_S, depth_m, bool(inner and depth_m >= DEEP_M))


def match(acted_ns: Sequence[int], touched_ns: Sequence[int], within_ns: int = MATCH_NS) -> list[int | None]:
    """Pair touches with acts one to one, nearest pairs first.

    :param acted_ns: when the device acted.
    :param touched_ns: when the hand touched.
    :param within_ns: a pair farther apart than this is none; default 100 ms.
    :return: for each touch the index in ``acted_ns`` of its own act, or None where it was missed.
    """
    pairs = sorted(
        (abs(acted - touched), t, a)
        for t, touched in enumerate(touched_ns)
        for a, acted in enumerate(acted_ns)
        if abs(acted - touched) <= within_ns
    )
    found: list[int | None] = [None] * len(touched_ns)
    taken: set[int] = set()
    for _, touch, act in pairs:
        if found[touch] is None and act not in taken:
            found[touch] = act
            taken.add(act)
    return found


def held_acts(
    time_ns: ArrayLike, distance_m: Floats, latency_ns: int, tick_ns: int, lead_ns: int, release_m: float = 0.0
) -> list[list[int]]:
    """*Hold*, the rule without prediction: for each site when its device acts if a pose inside the object is what starts it.

    :param time_ns: (f,), of the frames.
    :param distance_m: (f, n), metres, signed distance of each site's sphere at each frame.
    :param latency_ns: from the sampling of a frame to its arrival.
    :param tick_ns: length of a tick; an act is sent at the first tick after the arrival.
    :param lead_ns: from sending the command until the device has acted.
    :param release_m: a touch ends at a frame farther off than this.
    :return: for each of the n sites the moments (ns) at which its device acts.
    """
    acts: list[list[int]] = [[] for _ in range(distance_m.shape[1])]
    tick_ends = [-(-(int(time) + latency_ns) // tick_ns) * tick_ns for time in np.asarray(time_ns)]
    for site, column in enumerate(distance_m.T.tolist()):
        inside = False
        for tick, distance in zip(tick_ends, column, strict=True):
            if not inside and distance <= 0.0:
                acts[site].append(tick + lead_ns)
            inside = distance <= (release_m if inside else 0.0)
    return acts


@dataclass
class Onsets:
    """Errors gathered, site by site and object by object; ``hold`` gathers those of acting on the last pose, beside them.

    :param error_ms: acted - touched of each counted touch, ms; infinite where it was missed.
    :param approach_m_s: approach speed of each counted touch, m/s, in the same order.
    :param false: acts with no touch within 50 ms.
    :param shallow: acts for a touch that did not get 1 mm deep.
    """

    error_ms: list[float] = field(default_factory=list)
    approach_m_s: list[float] = field(default_factory=list)
    false: int = 0
    shallow: int = 0
    _hold: Onsets | None = None

    @property
    def hold(self) -> Onsets:
        """The same without prediction."""
        if self._hold is None:
            self._hold = Onsets()
        return self._hold

    def add(self, touched: Sequence[Touched], acted_ns: Sequence[int], judged_ns: tuple[int, int] | None = None) -> None:
        """Match touches with acts, and gather the errors.

        :param touched: of one site with one object, counted or not.
        :param acted_ns: when its device acted for that object.
        :param judged_ns: first and last moment; acts outside are not called false, as what they were for may lie beyond the
            track. None: all are judged.
        """
        counted = [touch for touch in touched if touch.counted]
        partner = match(acted_ns, [touch.time_ns for touch in counted])
        for touch, act in zip(counted, partner, strict=True):
            self.error_ms.append(np.inf if act is None else (acted_ns[act] - touch.time_ns) / NS_PER_MS)
            self.approach_m_s.append(touch.approach_m_s)
        for acted in acted_ns:
            if judged_ns is not None and not judged_ns[0] <= acted <= judged_ns[1]:
                continue
            near = [touch for touch in touched if abs(touch.time_ns - acted) <= FALSE_NS]
            self.false += not near
            self.shallow += bool(near) and all(touch.depth_m < DEEP_M for touch in near)

    def merge(self, other: Onsets) -> None:
        """Add another's errors to these.

        :param other: stays as it is.
        """
        self.error_ms += other.error_ms
        self.approach_m_s += other.approach_m_s
        self.false += other.false
        self.shallow += other.shallow
        if other._hold is not None:
            self.hold.merge(other._hold)


@dataclass(frozen=True, slots=True)
class OnsetStatistics:
    """Statistics of counted touches. None where no touch was counted, or where the touch at that place was missed.

    ``false`` and ``shallow`` count all acts, whatever the speed.

    :param n: counted touches.
    :param signed_median: median error of the touches that were met, ms; negative: early.
    :param median: median ``|error|``, ms; a missed touch counts as infinite.
    :param p95: 95th percentile of ``|error|``, ms, likewise.
    :param in_window: share, 0 to 1, with an error from -15 to +50 ms.
    :param missed: touches that no act matched.
    :param false: acts with no touch within 50 ms.
    :param shallow: acts for touches less than 1 mm deep.
    :param median_mm: median of ``|error| * approach speed``, mm.
    """

    n: int
    signed_median: float | None
    median: float | None
    p95: float | None
    in_window: float | None
    missed: int
    false: int
    shallow: int
    median_mm: float | None

    def to_json(self) -> dict[str, Any]:
        """By name.

        :return: every field by its name.
        """
        return {name: getattr(self, name) for name in self.__slots__}


def statistics_of(onsets: Onsets, from_m_s: float = 0.0, to_m_s: float = np.inf) -> OnsetStatistics:
    """Statistics of the touches with an approach speed in ``[from_m_s, to_m_s)``.

    :param onsets: errors as gathered.
    :param from_m_s: lowest approach speed, m/s.
    :param to_m_s: the speed below which touches are taken, m/s; default no bound.
    :return: errors in milliseconds.
    """
    approach = np.array(onsets.approach_m_s)
    chosen = (approach >= from_m_s) & (approach < to_m_s)
    error, approach = np.array(onsets.error_ms)[chosen], approach[chosen]
    met = error[np.isfinite(error)]
    off = np.abs(error)
    low, high = (edge / NS_PER_MS for edge in WINDOW_NS)
    return OnsetStatistics(
        n=len(error),
        signed_median=_finite(np.median(met)) if len(met) else None,
        median=_rank(off, 0.5),
        p95=_rank(off, 0.95),
        in_window=float(np.mean((error >= low) & (error <= high))) if len(error) else None,
        missed=len(error) - len(met),
        false=onsets.false,
        shallow=onsets.shallow,
        median_mm=_rank(off * approach, 0.5),
    )


def onset_statistics(onsets: Onsets) -> dict[str, Any]:
    """Statistics of all touches, of fast ones (100 mm/s or more), and by approach speed, each with those of ``hold``.

    :param onsets: errors as gathered, ``hold`` beside them.
    :return: plain data for JSON: the fields of ``OnsetStatistics`` and ``hold``, then ``fast`` with the same, and ``by_speed``, a
        list of the same with ``from_m_s`` and ``to_m_s`` (None: no bound).
    """
    return {
        **_beside_hold(onsets, 0.0, np.inf),
        "fast": _beside_hold(onsets, FAST_M_S, np.inf),
        "by_speed": [
            {"from_m_s": low, "to_m_s": _finite(high), **_beside_hold(onsets, low, high)}
            for low, high in pairwise(SPEED_EDGES_M_S)
        ],
    }


def _beside_hold(onsets: Onsets, low: float, high: float) -> dict[str, Any]:
    return {**statistics_of(onsets, low, high).to_json(), "hold": statistics_of(onsets.hold, low, high).to_json()}


def _rank(values: Floats, share: float) -> float | None:
    """The value below which that share lies, a missed touch counting as infinite; one of the values, so no inf - inf."""
    return _finite(np.quantile(values, share, method="higher")) if len(values) else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
