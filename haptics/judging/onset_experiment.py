"""Onset error over recorded hands and objects at random places: the decider as shipped, at 1 kHz, in virtual time.

Each hand's fingertips meet spheres, boxes and capsules spread over the space they sweep. Truth is the cubic through all frames;
the decider sees a frame only when its latency has passed, and a device acts ``lead_ns`` after its command.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.judging.onset import AFTER_START_NS, BEFORE_END_NS, TRUTH_STEP_NS, Onsets, Touched, held_acts, touches_on
from haptics.rendering.decision import DecisionParameters, TouchDecider
from haptics.rendering.prediction import PredictionParameters
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Box, Capsule, Placed, Sphere
from haptics.scene.hands.recording import HandTrack
from haptics.scene.sites import SITE, nominal_sites
from haptics.time import NS_PER_MS, NS_PER_S

Floats = NDArray[np.float64]
TICK_NS = NS_PER_MS
PIN_LEAD_NS = 6 * NS_PER_MS
TIPS = tuple(SITE[f"{finger}_tip"] for finger in ("thumb", "index", "middle", "ring", "little"))
MARGIN_M = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class SitePath:
    """A hand's sites over time.

    :param time_ns: (f,), when the frames were sampled.
    :param position_m: (f, n, 3), the sites' centres, metres.
    :param radius_m: (n,), radii of the sites' spheres, metres.
    """

    time_ns: NDArray[np.int64]
    position_m: Floats
    radius_m: Floats

    @classmethod
    def of(cls, track: HandTrack) -> SitePath:
        """The path of a recorded hand's fifteen sites.

        :param track: one hand without bad poses.
        :return: its sites by the nominal map.
        """
        sites = nominal_sites()
        return cls(track.time_ns, sites.positions(track.position_m, track.orientation_xyzw), sites.radius_m)


def random_bodies(path: SitePath, count: int, rng: np.random.Generator, judged: Sequence[int] = TIPS) -> list[Placed]:
    """Objects of 20 to 120 mm, spread evenly over the box that the judged sites sweep, 30 mm wider on each side.

    :param path: the hand.
    :param count: how many objects.
    :param rng: source of shapes and places.
    :param judged: indices of the sites that sweep the box; default the five fingertips.
    :return: spheres, boxes and capsules with equal chance.
    """
    swept = path.position_m[:, list(judged)].reshape(-1, 3)
    low, high = swept.min(axis=0) - MARGIN_M, swept.max(axis=0) + MARGIN_M
    return [_body(low, high, rng) for _ in range(count)]


def _body(low: Floats, high: Floats, rng: np.random.Generator) -> Placed:
    turn = rng.normal(size=4)
    place, orientation = rng.uniform(low, high), turn / np.linalg.norm(turn)
    pose = Pose(tuple(place.tolist()), tuple(orientation.tolist()))
    kind = rng.integers(3)
    if kind == 0:
        return Placed(Sphere(rng.uniform(0.015, 0.060)), pose)
    if kind == 1:
        return Placed(Box(tuple(rng.uniform(0.03, 0.12, 3).tolist())), pose)
    return Placed(Capsule(rng.uniform(0.01, 0.04), rng.uniform(0.02, 0.12)), pose)


def onset_experiment(
    paths: Sequence[SitePath],
    latencies_ns: Sequence[int] = (0, 10 * NS_PER_MS, 20 * NS_PER_MS),
    objects: int = 150,
    seed: int = 1,
    lead_ns: int = PIN_LEAD_NS,
    judged: Sequence[int] = TIPS,
    decision: DecisionParameters | None = None,
    prediction: PredictionParameters | None = None,
) -> dict[int, Onsets]:
    """Onsets by latency, *hold* beside them; the same for the same arguments.

    :param paths: hands, each with objects of its own.
    :param latencies_ns: from the sampling of a frame to its arrival; each is one experiment.
    :param objects: spread for each path.
    :param seed: of shapes and places.
    :param lead_ns: from sending a command until the device has acted; default a pin's 6 ms.
    :param judged: indices of the sites whose touches count; default the five fingertips.
    :param decision: constants of the decision; None: as shipped.
    :param prediction: constants of the prediction; None: as shipped.
    :return: the errors by latency (ns).
    """
    found = {latency: Onsets() for latency in latencies_ns}
    for number, path in enumerate(paths):
        bodies = random_bodies(path, objects, np.random.default_rng((seed, number)), judged)
        truth = _truth(path, bodies, judged)
        at_frames = [body.distance(path.position_m.reshape(-1, 3)).reshape(path.position_m.shape[:2]) for body in bodies]
        judged_ns = int(path.time_ns[0]) + AFTER_START_NS, int(path.time_ns[-1]) - BEFORE_END_NS
        for latency_ns, onsets in found.items():
            acted = _acted(path, bodies, latency_ns, lead_ns, decision, prediction)
            for index in range(len(bodies)):
                held = held_acts(path.time_ns, at_frames[index] - path.radius_m, latency_ns, TICK_NS, lead_ns)
                for site in judged:
                    touched = truth.get((index, site), [])
                    onsets.add(touched, acted.get((index, site), []), judged_ns)
                    onsets.hold.add(touched, held[site], judged_ns)
    return found


def _truth(path: SitePath, bodies: Sequence[Placed], judged: Sequence[int]) -> dict[tuple[int, int], list[Touched]]:
    from scipy.interpolate import CubicSpline

    sites = list(judged)
    first_ns = int(path.time_ns[0])
    grid_ns = np.arange(first_ns, int(path.time_ns[-1]) + 1, TRUTH_STEP_NS)
    cubic = CubicSpline((path.time_ns - first_ns) / NS_PER_S, path.position_m[:, sites])
    places = cubic((grid_ns - first_ns) / NS_PER_S)
    found: dict[tuple[int, int], list[Touched]] = {}
    for index, body in enumerate(bodies):
        distance = body.distance(places.reshape(-1, 3)).reshape(places.shape[:2]) - path.radius_m[sites]
        for touch in touches_on(grid_ns, distance):
            found.setdefault((index, sites[touch.site]), []).append(touch)
    return found


def _acted(
    path: SitePath,
    bodies: Sequence[Placed],
    latency_ns: int,
    lead_ns: int,
    decision: DecisionParameters | None,
    prediction: PredictionParameters | None,
) -> dict[tuple[int, int], list[int]]:
    """When each device acted, by object and site."""
    decider = TouchDecider([body.distance for body in bodies], path.radius_m, lead_ns, decision=decision, prediction=prediction)
    acted: dict[tuple[int, int], list[int]] = {}
    for tick_ns, arrived in _ticks(path.time_ns, latency_ns):
        for frame in arrived:
            decider.observe(int(path.time_ns[frame]), path.position_m[frame], tick_ns)
        for decided in decider.due(tick_ns):
            if decided.begins:
                acted.setdefault((decided.object, decided.site), []).append(tick_ns + lead_ns)
    return acted


def _ticks(time_ns: NDArray[np.int64], latency_ns: int) -> Iterator[tuple[int, range]]:
    """Ticks in order, with the frames that have come since the one before."""
    arrives = time_ns + latency_ns
    first, last = int(arrives[0]) // TICK_NS, int(arrives[-1]) // TICK_NS + 2
    ticks = np.arange(first, last) * TICK_NS
    come = np.searchsorted(arrives, ticks, side="right").tolist()
    seen = 0
    for tick, upto in zip(ticks.tolist(), come, strict=True):
        yield tick, range(seen, upto)
        seen = upto
