"""When to act for a touch that has not happened yet: early when it is certain, late when it is not.

A person accepts a touch from 15 ms before to 50 ms after the eye sees it (Di Luca and Mahnan 2019, by its abstract), so acting
early on a guess costs more than acting late. With the forecast distance ``d(h)`` of a site to an object and its standard
deviation ``s(h)`` (``haptics.rendering.prediction``), the pin is to be at the skin at the first ``h`` for which

- ``d(h) + q s(h) <= 0``: it is touching, a little after the middle of the guess, and
- ``d(h') + z s(h') <= -0.3 mm`` for some ``h'`` in ``[h, h + 15 ms]``: it is *sure* to touch before an early pin is noticed.

While the second fails the decision is left to the next frame, whose guess reaches less far; at the latest a pose inside the
object decides. Each frame plans anew; between frames a tick only compares times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.rendering.prediction import Forecast, PredictionParameters, Predictor
from haptics.time import NS_PER_MS, NS_PER_S

Floats = NDArray[np.float64]
Distance = Callable[[Floats], Floats]
"""Signed distance of points (m, d) to an object's surface, (m,), metres; negative inside."""

NEVER_NS = 2**62
LONG_AGO_NS = -(2**61)
STEP_S = 2.5e-3
"""Grid along the path; between its points distances are taken as straight, off by under 0.01 mm at 10 m/s²."""
FASTEST_M_S = 5.0
"""Site and object approach each other no faster; an object farther than that allows need not be looked at again yet."""
_NOTHING = np.empty(0, dtype=np.intp)


@dataclass(frozen=True, slots=True)
class DecisionParameters:
    """The rule's constants."""

    doubt_early: float = 0.4
    """``q``: standard deviations by which the aim is late of the middle of the guess."""
    doubt_sure: float = 1.3
    """``z``: standard deviations that count as sure."""
    early_s: float = 0.015
    """How early a touch may be felt (the window's near end)."""
    sure_m: float = 0.3e-3
    """How deep *sure* means: ahead of the touch, a graze is no reason to act."""
    horizon_s: float = 0.055
    """No guess reaches farther past its frame."""
    release_m: float = 0.3e-3
    """A touch ends when the site is farther off than this, now and when the pin will have left."""
    dwell_ns: int = 10 * NS_PER_MS
    """A pin does not turn round sooner: the length of a stroke."""


@dataclass(frozen=True, slots=True)
class Decided:
    """A touch that begins or ends now.

    :param site: index of the site.
    :param object: index of the object.
    :param begins: whether the touch begins; else it ends.
    :param aimed_ns: when the device is to have acted.
    """

    site: int
    object: int
    begins: bool
    aimed_ns: int


def touch_ahead(
    ahead_s: Floats, distance_m: Floats, deviation_m: Floats, now_m: Floats, parameters: DecisionParameters
) -> Floats:
    """The rule: how far ahead each of m pairs is to be touched, (m,), seconds; NaN where that is to be left to a later frame.

    :param ahead_s: (k,), a grid of ``STEP_S``, from the earliest moment at which the device could have acted.
    :param distance_m: (m, k), metres, the forecast distances.
    :param deviation_m: (m, k), metres, their standard deviations.
    :param now_m: (m,), metres, distance at the frame itself.
    :param parameters: constants of the rule.
    :return: (m,), seconds after the frame.
    """
    p = parameters
    window = round(p.early_s / STEP_S)
    late_m = distance_m + p.doubt_early * deviation_m
    crossed = late_m <= 0.0
    sure = _within(distance_m + p.doubt_sure * deviation_m <= -p.sure_m, window)
    decided = (crossed & sure) | (now_m <= 0.0)[:, None]
    first = decided.argmax(axis=1)
    rows = np.arange(len(first))
    before = np.maximum(first - 1, 0)
    fell_m = late_m[rows, before] - late_m[rows, first]
    between = crossed[rows, first] & ~crossed[rows, before]
    back_s = np.where(between, -STEP_S * late_m[rows, first] / np.where(between, fell_m, 1.0), 0.0)
    return np.where(decided.any(axis=1), ahead_s[first] - back_s, np.nan)


def _within(flags: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """Whether any of the next ``steps`` flags, or this one, is set."""
    count = np.zeros((flags.shape[0], flags.shape[1] + steps + 1), dtype=np.int64)
    np.cumsum(flags, axis=1, out=count[:, 1 : flags.shape[1] + 1])
    count[:, flags.shape[1] + 1 :] = count[:, flags.shape[1], None]
    return count[:, steps + 1 :] > count[:, : flags.shape[1]]


class TouchDecider:
    """Touches of one hand's sites with objects: fed with frames, asked at ticks.

    Distances are asked for when a frame comes, so objects may move, at up to ``FASTEST_M_S`` with the site's speed; after a jump
    call ``forget``. A scalar condition is decided alike: positions (1, d), radius 0, and ``distance`` the signal in metres, below
    zero where the condition holds.

    :param distances: one function for each object.
    :param radius_m: of the sites' spheres, (n,), metres, 0 or more.
    :param lead_ns: from sending the command until the device has acted, 0 or more.
    :param release_lead_ns: the same for its return; None: as ``lead_ns``.
    :param stale_ns: a plan dies when its pose is older than this, or arrived longer ago.
    :param decision: constants of the rule; None: as shipped.
    :param prediction: constants of the forecast; None: as shipped.
    :raises InputError: a negative radius or lead.
    """

    def __init__(
        self,
        distances: Sequence[Distance],
        radius_m: ArrayLike,
        lead_ns: int,
        release_lead_ns: int | None = None,
        stale_ns: int = 50 * NS_PER_MS,
        decision: DecisionParameters | None = None,
        prediction: PredictionParameters | None = None,
    ):
        self._distances = tuple(distances)
        self._radius_m = np.asarray(radius_m, dtype=float)
        if self._radius_m.ndim != 1 or not (self._radius_m >= 0).all():
            raise InputError(f"radius_m = {radius_m}; expected one radius of 0 m or more for each site")
        if lead_ns < 0:
            raise InputError(f"lead_ns = {lead_ns} ns; must be at least 0 ns")
        self.lead_ns = lead_ns
        self.release_lead_ns = lead_ns if release_lead_ns is None else release_lead_ns
        self._stale_ns = stale_ns
        self._p = decision or DecisionParameters()
        self._predictor = Predictor(prediction)
        shape = (len(self._distances), len(self._radius_m))
        self._touching = np.zeros(shape, dtype=bool)
        self._turned_ns = np.full(shape, LONG_AGO_NS, dtype=np.int64)
        self._act_ns = np.full(shape, NEVER_NS, dtype=np.int64)
        self._aimed_ns = np.zeros(shape, dtype=np.int64)
        self._ends: list[Decided] = []
        self._seen_m = np.zeros(shape[0])
        self._seen_ns = np.zeros(shape[0], dtype=np.int64)
        self._next_ns = NEVER_NS
        self._dies_ns = NEVER_NS

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Which site (column) is taken to touch which object (row)."""
        return self._touching

    def forget(self) -> None:
        """No touch, no plan, no past frame."""
        self._predictor.forget()
        self._touching[:] = False
        self._turned_ns[:] = LONG_AGO_NS
        self._seen_m[:] = 0.0
        self._ends.clear()
        self.drop_plans()

    def adopt(self, index: int, other: TouchDecider, other_index: int = 0) -> None:
        """Take over from another decider of the same sites what it holds about one object: what touches it, and since when.

        :param index: of the object here.
        :param other: the other decider; stays as it is.
        :param other_index: of the object there.
        """
        self._touching[index] = other._touching[other_index]
        self._turned_ns[index] = other._turned_ns[other_index]
        self._act_ns[index] = NEVER_NS
        self._seen_m[index] = 0.0

    def observe(self, time_ns: int, position_m: ArrayLike, now_ns: int) -> None:
        """Plan anew from a frame; frames that are not later than the last change nothing.

        :param time_ns: when the frame was sampled.
        :param position_m: the sites' centres, (n, d), metres; a site that was not seen keeps its state and gets no plan.
        :param now_ns: when it arrived.
        :raises InputError: another shape.
        """
        forecast = self._predictor.observe(time_ns, position_m)
        if forecast is None:
            return
        self.drop_plans()
        earliest_s = max(now_ns + self.lead_ns - time_ns, 0) / NS_PER_S
        if now_ns - time_ns > self._stale_ns or earliest_s >= self._p.horizon_s:
            return
        self._dies_ns = min(time_ns, now_ns) + self._stale_ns
        leaves_s = min((now_ns + self.release_lead_ns - time_ns) / NS_PER_S, self._p.horizon_s)
        ahead_s = np.concatenate([(0.0, leaves_s), np.arange(earliest_s, self._p.horizon_s, STEP_S)])
        rows, columns, distance_m = self._near(forecast, ahead_s)
        if not len(rows):
            return
        now_m, then_m, distance_m = distance_m[:, 0], distance_m[:, 1], distance_m[:, 2:]
        self._end(rows, columns, np.minimum(now_m, then_m), now_ns)
        free = ~self._touching[rows, columns]
        if free.any():
            deviation_m = forecast.deviation(ahead_s[2:])[columns[free]]
            touch_s = touch_ahead(ahead_s[2:], distance_m[free], deviation_m, now_m[free], self._p)
            self._plan(rows[free], columns[free], touch_s, time_ns)

    def due(self, now_ns: int) -> list[Decided]:
        """What is to be done at this tick.

        :param now_ns: the tick's time.
        :return: ends first, then beginnings in the order of their times; each is handed out once.
        """
        if not self._ends and now_ns < self._next_ns:
            return []
        decided, self._ends = self._ends, []
        if now_ns > self._dies_ns:
            self.drop_plans()
        rows, columns = (self._act_ns <= now_ns).nonzero()
        for row, column in sorted(zip(rows.tolist(), columns.tolist(), strict=True), key=lambda at: (self._act_ns[at], at)):
            decided.append(Decided(column, row, True, int(self._aimed_ns[row, column])))
            self._touching[row, column] = True
            self._turned_ns[row, column] = now_ns
            self._act_ns[row, column] = NEVER_NS
        self._next_ns = int(self._act_ns.min(initial=NEVER_NS))
        return decided

    def _near(self, forecast: Forecast, ahead_s: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
        """Objects and sites that may meet or already touch, (m,) each, and their distances along the path, (m, k)."""
        time_ns, reach_m = forecast.time_ns, forecast.reach_m(self._p.horizon_s)
        may_have_come_m = (FASTEST_M_S / NS_PER_S) * (time_ns - self._seen_ns)
        look = (self._seen_m - may_have_come_m <= np.fmax.reduce(reach_m, initial=0.0)) | self._touching.any(axis=1)
        rows, columns, along_m = [], [], []
        for index in look.nonzero()[0].tolist():
            now_m = self._distances[index](forecast.position_m) - self._radius_m
            self._seen_m[index], self._seen_ns[index] = np.fmin.reduce(now_m, initial=np.inf), time_ns
            sites = ((now_m <= reach_m) | self._touching[index]).nonzero()[0]
            if len(sites):
                path = forecast.path(ahead_s, sites)
                distance_m = self._distances[index](path.reshape(-1, path.shape[2])).reshape(path.shape[:2])
                rows.append(np.full(len(sites), index))
                columns.append(sites)
                along_m.append(distance_m - self._radius_m[sites, None])
        if not rows:
            return _NOTHING, _NOTHING, np.empty((0, len(ahead_s)))
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(along_m)

    def _end(self, rows: NDArray[np.intp], columns: NDArray[np.intp], off_m: Floats, now_ns: int) -> None:
        rested = now_ns - self._turned_ns[rows, columns] >= self._p.dwell_ns
        for pair in (self._touching[rows, columns] & (off_m > self._p.release_m) & rested).nonzero()[0].tolist():
            row, column = int(rows[pair]), int(columns[pair])
            self._touching[row, column] = False
            self._turned_ns[row, column] = now_ns
            self._ends.append(Decided(column, row, False, now_ns + self.release_lead_ns))

    def _plan(self, rows: NDArray[np.intp], columns: NDArray[np.intp], touch_s: Floats, time_ns: int) -> None:
        for pair in np.isfinite(touch_s).nonzero()[0].tolist():
            at = int(rows[pair]), int(columns[pair])
            touch_ns = time_ns + round(float(touch_s[pair]) * NS_PER_S)
            act_ns = max(touch_ns - self.lead_ns, int(self._turned_ns[at]) + self._p.dwell_ns)
            self._act_ns[at], self._aimed_ns[at] = act_ns, act_ns + self.lead_ns
            self._next_ns = min(self._next_ns, act_ns)

    def drop_plans(self) -> None:
        """Nothing is planned any more."""
        self._act_ns[:] = NEVER_NS
        self._next_ns = NEVER_NS
        self._dies_ns = NEVER_NS
