"""From a pose to decided touches in one compiled call.

The same forecast as ``prediction.Predictor`` and the same rule as ``decision.TouchDecider``, over bodies laid out in arrays
(``haptics.scene.geometry.packed``). Those two files define what is decided and why; this one only makes it cheap, and a test
holds the two together on every recorded hand.
"""

# Types that depend on one another through these loops are beyond what a checker infers.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptics.scene.geometry.packed import MESH, PackedBodies, mesh_distance_m, solid_distance_m, to_local

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

PRESENT, ABSENT, FAR = 0, 1, 2
"""What a body is to a decider: there; decided elsewhere, so that what touches it stays as it is; out of reach for now."""
FAR_M = 1.0
FRAMES_KEPT = 256
"""Room for past frames: 50 ms of them at 5 kHz; the oldest go first where there are more."""
_FRAME, _FRAMES, _VELOCITY, _VELOCITIES = range(4)


class History(NamedTuple):
    """What a forecast looks back on, as rings of K places.

    :param rings: place of the oldest and number of frames, then of velocities, (4,).
    :param frame_ns: when each frame was sampled, (K,), ns.
    :param frame_m: its places, (K, n, d), metres.
    :param middle_ns: middle of the time that a velocity was taken over, (K,), ns.
    :param end_ns: its end, (K,), ns.
    :param velocity_m_s: (K, n, d), m/s.
    :param squared_change: of the velocity before it, over time, (K, n), (m/s²)²; -1 where there is none.
    """

    rings: Integers
    frame_ns: Integers
    frame_m: Floats
    middle_ns: Integers
    end_ns: Integers
    velocity_m_s: Floats
    squared_change: Floats

    @classmethod
    def of(cls, points: int, coordinates: int) -> History:
        """An empty history.

        :param points: n.
        :param coordinates: d.
        :return: its arrays.
        """
        kept = FRAMES_KEPT
        return cls(
            np.zeros(4, np.int64),
            np.zeros(kept, np.int64),
            np.zeros((kept, points, coordinates)),
            np.zeros(kept, np.int64),
            np.zeros(kept, np.int64),
            np.zeros((kept, points, coordinates)),
            np.zeros((kept, points)),
        )


class Forecast(NamedTuple):
    """Where points will be (``prediction.Forecast``); all zero where only the last pose is known.

    :param velocity_m_s: (n, d), m/s.
    :param bending_m_s2: the believed share of the acceleration, (n, d), m/s².
    :param doubt_m_s2: (n,), m/s².
    """

    velocity_m_s: Floats
    bending_m_s2: Floats
    doubt_m_s2: Floats


class Decisions(NamedTuple):
    """What a decider holds of each body (row) and site (column).

    :param touching: which site is taken to touch which body, (m, n).
    :param turned_ns: since when, (m, n), ns.
    :param act_ns: when a touch is to be acted for, (m, n), ns.
    :param aimed_ns: when the device is to have acted, (m, n), ns.
    :param seen_m: how far the nearest site was when last looked at, (m,), metres.
    :param seen_ns: when that was, (m,), ns.
    """

    touching: NDArray[np.bool_]
    turned_ns: Integers
    act_ns: Integers
    aimed_ns: Integers
    seen_m: Floats
    seen_ns: Integers


class Constants(NamedTuple):
    """Those of ``PredictionParameters`` and ``DecisionParameters``, with the decider's leads.

    :param velocity_span_ns: see ``PredictionParameters``, ns.
    :param acceleration_span_ns: likewise, ns.
    :param recent_ns: likewise, ns.
    :param longest_gap_ns: likewise, ns.
    :param damping_per_s: likewise, 1/s.
    :param common_gain: likewise.
    :param own_gain: likewise.
    :param level_weight: likewise.
    :param disagreement_weight: likewise.
    :param recent_weight: likewise.
    :param noise_m: likewise, metres.
    :param doubt_early: see ``DecisionParameters``.
    :param doubt_sure: likewise.
    :param early_steps: ``early_s`` in steps.
    :param sure_m: likewise, metres.
    :param horizon_s: likewise, s.
    :param release_m: likewise, metres.
    :param dwell_ns: likewise, ns.
    :param lead_ns: of the decider, ns.
    :param release_lead_ns: likewise, ns.
    :param stale_ns: likewise, ns.
    :param step_s: grid along the path, s.
    :param fastest_m_s: site and body approach each other no faster, m/s.
    :param never_ns: a time that does not come, ns.
    """

    velocity_span_ns: int
    acceleration_span_ns: int
    recent_ns: int
    longest_gap_ns: int
    damping_per_s: float
    common_gain: float
    own_gain: float
    level_weight: float
    disagreement_weight: float
    recent_weight: float
    noise_m: float
    doubt_early: float
    doubt_sure: float
    early_steps: int
    sure_m: float
    horizon_s: float
    release_m: float
    dwell_ns: int
    lead_ns: int
    release_lead_ns: int
    stale_ns: int
    step_s: float
    fastest_m_s: float
    never_ns: int


@njit(cache=True, error_model="numpy")
def _forecast(time_ns: int, position_m: Floats, k: Constants, past: History, out: Forecast) -> tuple[bool, float, float]:
    """Take a frame. Returns whether it is later than the last, and the forecast's span (s) and damping (1/s)."""
    count, room = past.rings, past.frame_ns.shape[0]
    points, coordinates = position_m.shape
    if count[_FRAMES] > 0:
        elapsed_ns = time_ns - past.frame_ns[(count[_FRAME] + count[_FRAMES] - 1) % room]
        if elapsed_ns <= 0:
            return False, 0.0, 0.0
        if elapsed_ns > k.longest_gap_ns:
            count[:] = 0
    earlier = -1
    for back in range(count[_FRAMES] - 1, -1, -1):
        at = (count[_FRAME] + back) % room
        if time_ns - past.frame_ns[at] >= k.velocity_span_ns:
            earlier = at
            break
    if count[_FRAMES] == room:
        count[_FRAME] = (count[_FRAME] + 1) % room
        count[_FRAMES] -= 1
    at = (count[_FRAME] + count[_FRAMES]) % room
    past.frame_ns[at] = time_ns
    past.frame_m[at] = position_m
    count[_FRAMES] += 1
    while count[_FRAMES] > 1 and time_ns - past.frame_ns[(count[_FRAME] + 1) % room] >= k.longest_gap_ns:
        count[_FRAME] = (count[_FRAME] + 1) % room
        count[_FRAMES] -= 1
    out.velocity_m_s[:] = 0.0
    out.bending_m_s2[:] = 0.0
    out.doubt_m_s2[:] = 0.0
    still_span_s = k.velocity_span_ns / 1e9
    if earlier < 0:
        return True, still_span_s, 0.0

    span_s = (time_ns - past.frame_ns[earlier]) / 1e9
    middle_ns = (time_ns + past.frame_ns[earlier]) // 2
    short = _velocity_before(middle_ns - k.velocity_span_ns, past)
    long = _velocity_before(middle_ns - k.acceleration_span_ns, past)
    if count[_VELOCITIES] == room:
        count[_VELOCITY] = (count[_VELOCITY] + 1) % room
        count[_VELOCITIES] -= 1
    new = (count[_VELOCITY] + count[_VELOCITIES]) % room
    count[_VELOCITIES] += 1
    past.middle_ns[new], past.end_ns[new] = middle_ns, time_ns
    velocity = past.velocity_m_s[new]
    for point in range(points):
        for axis in range(coordinates):
            velocity[point, axis] = (position_m[point, axis] - past.frame_m[earlier, point, axis]) / span_s
    if short < 0:
        past.squared_change[new] = -1.0
        return True, still_span_s, 0.0
    per_s = 1e9 / (middle_ns - past.middle_ns[short])
    for point in range(points):
        squared = 0.0
        for axis in range(coordinates):
            squared += ((velocity[point, axis] - past.velocity_m_s[short, point, axis]) * per_s) ** 2
        past.squared_change[new, point] = squared
    kept_ns = min(time_ns - k.recent_ns, middle_ns - k.acceleration_span_ns)
    while count[_VELOCITIES] > 1 and past.middle_ns[(count[_VELOCITY] + 1) % room] <= kept_ns:
        count[_VELOCITY] = (count[_VELOCITY] + 1) % room
        count[_VELOCITIES] -= 1
    if long < 0:
        return True, still_span_s, 0.0

    steady_per_s = 1e9 / (middle_ns - past.middle_ns[long])
    steady = out.bending_m_s2
    common = np.zeros(coordinates)
    seen = 0
    for point in range(points):
        finite = True
        for axis in range(coordinates):
            steady[point, axis] = (velocity[point, axis] - past.velocity_m_s[long, point, axis]) * steady_per_s
            finite = finite and math.isfinite(steady[point, axis])
        if finite:
            seen += 1
            for axis in range(coordinates):
                common[axis] += steady[point, axis]
    if seen:
        common /= seen
    for point in range(points):
        lately, recent = 0.0, 0
        for number in range(count[_VELOCITIES]):
            at = (count[_VELOCITY] + number) % room
            squared = past.squared_change[at, point]
            if squared != -1.0 and time_ns - past.end_ns[at] < k.recent_ns:
                lately += squared
                recent += 1
        level, disagreement = 0.0, 0.0
        for axis in range(coordinates):
            latest = (velocity[point, axis] - past.velocity_m_s[short, point, axis]) * per_s
            level += steady[point, axis] ** 2
            disagreement += (latest - steady[point, axis]) ** 2
        out.doubt_m_s2[point] = math.sqrt(
            k.level_weight**2 * level + k.disagreement_weight**2 * disagreement + k.recent_weight**2 * (lately / recent)
        )
        for axis in range(coordinates):
            steady[point, axis] = k.own_gain * steady[point, axis] + (k.common_gain - k.own_gain) * common[axis]
    out.velocity_m_s[:] = velocity
    return True, span_s, k.damping_per_s


@njit(cache=True, error_model="numpy")
def _velocity_before(middle_ns: int, past: History) -> int:
    """Place in the ring of the latest velocity whose middle is not after a time; -1 if none is."""
    room = past.middle_ns.shape[0]
    for back in range(past.rings[_VELOCITIES] - 1, -1, -1):
        at = (past.rings[_VELOCITY] + back) % room
        if past.middle_ns[at] <= middle_ns:
            return at
    return -1


@njit(cache=True, error_model="numpy")
def _gaps_m(
    bodies: PackedBodies,
    row: int,
    place_m: Floats,
    velocity_m_s: Floats,
    bending_m_s2: Floats,
    radius_m: float,
    along_s: Floats,
    bend_s2: Floats,
    gaps_m: Floats,
) -> None:
    """Distances of a site's sphere to a body along its path in the body's frame; of several points, that of the farthest."""
    kind, a, b, c = bodies.kind[row], bodies.size_m[row, 0], bodies.size_m[row, 1], bodies.size_m[row, 2]
    first, end, corners_m, sphere_m, box_m = (
        bodies.triangles[row, 0],
        bodies.triangles[row, 1],
        bodies.corners_m,
        bodies.sphere_m,
        bodies.box_m,
    )
    for i in range(0, place_m.shape[0], 3):
        for step in range(along_s.shape[0]):
            s, t = along_s[step], bend_s2[step]
            x = place_m[i] + velocity_m_s[i] * s + bending_m_s2[i] * t
            y = place_m[i + 1] + velocity_m_s[i + 1] * s + bending_m_s2[i + 1] * t
            z = place_m[i + 2] + velocity_m_s[i + 2] * s + bending_m_s2[i + 2] * t
            if kind == MESH:
                gap_m = mesh_distance_m(first, end, corners_m, sphere_m, box_m, row, x, y, z) - radius_m
            else:
                gap_m = solid_distance_m(kind, a, b, c, x, y, z) - radius_m
            if i == 0 or gap_m > gaps_m[step] or math.isnan(gap_m):
                gaps_m[step] = gap_m


@njit(cache=True, error_model="numpy")
def _now_m(bodies: PackedBodies, row: int, place_m: Floats, radius_m: Floats, gaps_m: Floats) -> None:
    """The same of all sites where they are now, (n, d) in the body's frame."""
    kind, a, b, c = bodies.kind[row], bodies.size_m[row, 0], bodies.size_m[row, 1], bodies.size_m[row, 2]
    first, end, corners_m, sphere_m, box_m = (
        bodies.triangles[row, 0],
        bodies.triangles[row, 1],
        bodies.corners_m,
        bodies.sphere_m,
        bodies.box_m,
    )
    for site in range(place_m.shape[0]):
        for i in range(0, place_m.shape[1], 3):
            x, y, z = place_m[site, i], place_m[site, i + 1], place_m[site, i + 2]
            if kind == MESH:
                gap_m = mesh_distance_m(first, end, corners_m, sphere_m, box_m, row, x, y, z) - radius_m[site]
            else:
                gap_m = solid_distance_m(kind, a, b, c, x, y, z) - radius_m[site]
            if i == 0 or gap_m > gaps_m[site] or math.isnan(gap_m):
                gaps_m[site] = gap_m


@njit(cache=True, error_model="numpy")
def observe(
    time_ns: int,
    now_ns: int,
    position_m: Floats,
    radius_m: Floats,
    k: Constants,
    past: History,
    forecast: Forecast,
    bodies: PackedBodies,
    standing: Integers,
    held: Decisions,
    ends: Integers,
) -> tuple[bool, int, int, int]:
    """Plan anew from a frame.

    :param time_ns: when it was sampled.
    :param now_ns: when it arrived.
    :param position_m: (n, d), metres; d = 3 for sites, 6 for pairs of points that are to be near together.
    :param radius_m: of the sites' spheres, (n,), metres.
    :param k: constants.
    :param past: changed in place.
    :param forecast: room for it, changed in place.
    :param bodies: m of them.
    :param standing: ``PRESENT``, ``ABSENT`` or ``FAR``, (m,).
    :param held: changed in place.
    :param ends: (m n, 2), room for body and site of touches that end now.
    :return: whether the frame was later than the last; number of ends; time of the next act and of the plans' death, ns, or
        ``never_ns``.
    """
    later, span_s, damping_per_s = _forecast(time_ns, position_m, k, past, forecast)
    if not later:
        return False, 0, k.never_ns, k.never_ns
    held.act_ns[:] = k.never_ns
    next_ns = k.never_ns
    earliest_s = max(now_ns + k.lead_ns - time_ns, 0) / 1e9
    if now_ns - time_ns > k.stale_ns or earliest_s >= k.horizon_s:
        return True, 0, next_ns, k.never_ns
    leaves_s = min((now_ns + k.release_lead_ns - time_ns) / 1e9, k.horizon_s)
    steps = math.ceil((k.horizon_s - earliest_s) / k.step_s)
    sites, coordinates = position_m.shape
    velocity, bending = forecast.velocity_m_s, forecast.bending_m_s2

    reach_m = np.empty(sites)
    farthest_m = 0.0
    for site in range(sites):
        speed2, bend2 = 0.0, 0.0
        for axis in range(coordinates):
            speed2 += velocity[site, axis] ** 2
            bend2 += bending[site, axis] ** 2
        reach_m[site] = math.sqrt(speed2) * k.horizon_s + math.sqrt(bend2) * (0.5 * k.horizon_s * (k.horizon_s + span_s))
        if reach_m[site] > farthest_m:
            farthest_m = reach_m[site]

    along_s, bend_s2, gaps_m = np.empty(steps + 2), np.empty(steps + 2), np.empty(steps + 2)
    for step in range(steps + 2):
        ahead_s = leaves_s if step == 1 else earliest_s + k.step_s * (step - 2) if step > 1 else 0.0
        along_s[step] = ahead_s * (1.0 - damping_per_s * ahead_s)
        bend_s2[step] = 0.5 * ahead_s * (ahead_s + span_s)
    place_m, there_m_s, there_m_s2 = (
        np.empty((sites, coordinates)),
        np.empty((sites, coordinates)),
        np.empty((sites, coordinates)),
    )
    now_m = np.empty(sites)
    ended = 0
    for row in range(standing.shape[0]):
        touched = False
        for site in range(sites):
            touched = touched or held.touching[row, site]
        may_have_come_m = (k.fastest_m_s / 1e9) * (time_ns - held.seen_ns[row])
        if not (touched or held.seen_m[row] - may_have_come_m <= farthest_m):
            continue
        held.seen_m[row], held.seen_ns[row] = math.inf, time_ns
        if standing[row] == ABSENT:
            continue
        if standing[row] == FAR:
            now_m[:] = FAR_M - radius_m
        else:
            to_local(bodies.rotation, bodies.origin_m, row, position_m, True, place_m)
            _now_m(bodies, row, place_m, radius_m, now_m)
        near = False
        for site in range(sites):
            if now_m[site] < held.seen_m[row]:
                held.seen_m[row] = now_m[site]
            near = near or now_m[site] <= reach_m[site]
        if not (near or touched):
            continue
        to_local(bodies.rotation, bodies.origin_m, row, velocity, False, there_m_s)
        to_local(bodies.rotation, bodies.origin_m, row, bending, False, there_m_s2)
        for site in range(sites):
            if not (now_m[site] <= reach_m[site] or held.touching[row, site]):
                continue
            if standing[row] == FAR:
                gaps_m[:] = now_m[site]
            else:
                _gaps_m(bodies, row, place_m[site], there_m_s[site], there_m_s2[site], radius_m[site], along_s, bend_s2, gaps_m)
            if held.touching[row, site]:
                off_m = min(gaps_m[0], gaps_m[1])
                if off_m > k.release_m and now_ns - held.turned_ns[row, site] >= k.dwell_ns:
                    held.touching[row, site] = False
                    held.turned_ns[row, site] = now_ns
                    ends[ended] = row, site
                    ended += 1
                else:
                    continue
            touch_s = _touch_ahead(gaps_m, forecast.doubt_m_s2[site], earliest_s, span_s, k)
            if math.isfinite(touch_s):
                touch_ns = time_ns + round(touch_s * 1e9)
                act_ns = max(touch_ns - k.lead_ns, held.turned_ns[row, site] + k.dwell_ns)
                held.act_ns[row, site], held.aimed_ns[row, site] = act_ns, act_ns + k.lead_ns
                next_ns = min(next_ns, act_ns)
    return True, ended, next_ns, min(time_ns, now_ns) + k.stale_ns


@njit(cache=True, error_model="numpy")
def _touch_ahead(gaps_m: Floats, doubt_m_s2: float, earliest_s: float, span_s: float, k: Constants) -> float:
    """``decision.touch_ahead`` for one site and body; ``gaps_m`` from its third number on is the path."""
    steps = gaps_m.shape[0] - 2
    sure_until, checked = -1, 0
    before_m = math.nan
    for step in range(steps):
        ahead_s = earliest_s + k.step_s * step
        deviation_m = doubt_m_s2 * (0.5 * ahead_s * (ahead_s + span_s)) + k.noise_m * (1.0 + ahead_s / span_s)
        late_m = gaps_m[step + 2] + k.doubt_early * deviation_m
        decided = gaps_m[0] <= 0.0
        if not decided and late_m <= 0.0:
            checked = max(checked, step)
            while checked < steps and checked <= step + k.early_steps:
                then_s = earliest_s + k.step_s * checked
                then_m = doubt_m_s2 * (0.5 * then_s * (then_s + span_s)) + k.noise_m * (1.0 + then_s / span_s)
                if gaps_m[checked + 2] + k.doubt_sure * then_m <= -k.sure_m:
                    sure_until = checked
                    break
                checked += 1
            decided = sure_until >= step
        if decided:
            if late_m <= 0.0 and before_m > 0.0:
                return ahead_s - (-k.step_s * late_m / (before_m - late_m))
            return ahead_s
        before_m = late_m
    return math.nan
