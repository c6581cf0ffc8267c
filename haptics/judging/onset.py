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

    :param approach_m_s: how fast the distance fell at that moment. :param depth_m: the deepest it got before it ended.
    :param counted: deep enough, and not at the track's edge; others only excuse those who acted for them.
    """

    time_ns: int
    site: int = 0
    object: str = ""
    approach_m_s: float = 1.0
    depth_m: float = 0.01
    counted: bool = True


def touches_on(time_ns: ArrayLike, distance_m: Floats, sites: Collection[int] | None = None, name: str = "") -> list[Touched]:
    """Touches of one object in one track, in the order of site and time; one that is under way at the start is none.

    :param time_ns: (t,), of the whole track, close enough for a straight line between (1 ms or less).
    :param distance_m: (t, n), signed distance of each site's sphere on the true path. :param sites: those wanted; default all.
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
    """For each touch the place of the act that is its own, or ``None``: one to one, nearest pairs first."""
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

    :param time_ns: (f,), of the frames. :param distance_m: (f, n), signed distance of each site's sphere at each frame.
    :param release_m: a touch ends at a frame farther off than this.
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
    """Errors gathered, site by site and object by object; ``hold`` gathers those of acting on the last pose, beside them."""

    error_ms: list[float] = field(default_factory=list)
    """acted - touched of each counted touch; infinite where it was missed."""
    approach_m_s: list[float] = field(default_factory=list)
    false: int = 0
    """Acted, and no touch within 50 ms."""
    shallow: int = 0
    """Acted for a touch that did not get 1 mm deep."""
    _hold: Onsets | None = None

    @property
    def hold(self) -> Onsets:
        """The same without prediction."""
        if self._hold is None:
            self._hold = Onsets()
        return self._hold

    def add(self, touched: Sequence[Touched], acted_ns: Sequence[int], judged_ns: tuple[int, int] | None = None) -> None:
        """Match what was touched with what was done for it.

        :param touched: of one site, counted or not. :param acted_ns: of its device.
        :param judged_ns: acts before or after are not called false: what they were for may lie beyond the track.
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
        """Take in another's."""
        self.error_ms += other.error_ms
        self.approach_m_s += other.approach_m_s
        self.false += other.false
        self.shallow += other.shallow
        if other._hold is not None:
            self.hold.merge(other._hold)


@dataclass(frozen=True, slots=True)
class OnsetStatistics:
    """Of n counted touches; milliseconds. ``None`` where there is nothing to tell, or the touch at that place was missed.

    ``in_window`` is a share of 1. ``false`` and ``shallow`` are of all acts, whatever the speed. ``median_mm`` is the median of
    ``|error| * approach speed``.
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
        """By name."""
        return {name: getattr(self, name) for name in self.__slots__}


def statistics_of(onsets: Onsets, from_m_s: float = 0.0, to_m_s: float = np.inf) -> OnsetStatistics:
    """Of the touches with an approach speed in ``[from_m_s, to_m_s)``."""
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
    """All touches; ``fast`` those at 100 mm/s or more; ``by_speed``; and the same of ``hold`` within each."""
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
