"""What a recorded hand really did among the objects: the reference that the loop is judged by.

The hand moves on a cubic through *all* its poses, future ones too, which the loop never sees. On that path a touch is the first
moment at which a site's signed distance to an object reaches zero, and a grasp the geometric 5 mm condition, without any filter.
A grasped object follows the hand here as it does in the loop, but along the true path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from haptics.scene.geometry.shapes import Placed
from haptics.scene.grasp import GraspTracker
from haptics.scene.hands.frame import HandFrame
from haptics.scene.scene import Scene
from haptics.scene.sites import SITE, SiteMap
from haptics.time import NS_PER_MS, NS_PER_S

GRID_NS = NS_PER_MS
"""Spacing at which distances are looked at; crossings are interpolated between."""


@dataclass(frozen=True, slots=True)
class TrackTruth:
    """One track on its cubic.

    :param time_ns: (t,), the grid, every millisecond.
    :param frame_ns: (f,), when the track's poses were sampled.
    :param sites_m: (t, 15, 3), metres, the sites' centres on the cubic.
    :param distance_m: by object, (t, 15), metres: signed distance of each site's sphere; negative inside.
    :param grasp_ns: moments (ns) at which a grasp really began, each with its object.
    """

    time_ns: np.ndarray
    frame_ns: np.ndarray
    sites_m: np.ndarray
    distance_m: dict[str, np.ndarray]
    grasp_ns: tuple[tuple[int, str], ...]


def track_truths(scene: Scene, sites: SiteMap, frames: Sequence[HandFrame], objects: Sequence[str]) -> list[TrackTruth]:
    """The truth of each track with at least four poses, in order.

    :param scene: placed, so that every object has a place in the world.
    :param sites: where the hand's sites are.
    :param frames: of one hand, in time order.
    :param objects: names of the objects whose distances are wanted.
    :return: one for each track of four poses or more; shorter ones have no cubic.
    :raises InputError: an object that the scene does not have.
    """
    tracker = scene.grasp_tracker()
    grasped = {item.name for item in scene.objects if item.grasp is not None}
    return [_truth(scene, sites, track, objects, grasped, tracker) for track in _tracks(frames) if len(track) >= 4]


def _tracks(frames: Sequence[HandFrame]) -> Iterator[list[HandFrame]]:
    track: list[HandFrame] = []
    for frame in frames:
        if track and frame.track_id != track[-1].track_id:
            yield track
            track = []
        track.append(frame)
    if track:
        yield track


def _truth(
    scene: Scene,
    sites: SiteMap,
    track: list[HandFrame],
    objects: Sequence[str],
    grasped: set[str],
    tracker: GraspTracker,
) -> TrackTruth:
    from scipy.interpolate import CubicSpline

    first_ns = track[0].time_ns
    at_s = np.array([(frame.time_ns - first_ns) / NS_PER_S for frame in track])
    positions = np.stack([sites.positions(frame.position_m, frame.orientation_xyzw) for frame in track])
    grid_ns = np.arange(0, track[-1].time_ns - first_ns + 1, GRID_NS)
    path = CubicSpline(at_s, positions)(grid_ns / NS_PER_S)

    def distance_to(body: Placed, points: np.ndarray) -> np.ndarray:
        return body.distance(points.reshape(-1, 3)).reshape(points.shape[:-1]) - sites.radius_m

    still = [name for name in objects if name not in grasped and not _moves(scene, name)]
    distance = {name: distance_to(scene.object(name).body, path) for name in still}
    for name in (name for name in objects if _moves(scene, name)):
        item = scene.object(name)
        distance[name] = np.stack(
            [distance_to(item.body_at((first_ns + int(t)) / NS_PER_S), path[i]) for i, t in enumerate(grid_ns)]
        )
    wanted = [name for name in objects if name in grasped]
    for name in wanted:
        distance[name] = np.empty(path.shape[:2])
    begins: list[tuple[int, str]] = []
    if grasped:
        thumb, index = path[:, SITE["thumb_tip"]], path[:, SITE["index_tip"]]
        for i, t in enumerate(grid_ns):
            time_ns = first_ns + int(t)
            begins += [(e.time_ns, e.object) for e in tracker.update(time_ns, thumb[i], index[i]) if e.kind == "begin"]
            for name in wanted:
                distance[name][i] = distance_to(tracker.body(name), path[i])
        tracker.let_go(first_ns + int(grid_ns[-1]))
    return TrackTruth(first_ns + grid_ns, np.array([frame.time_ns for frame in track]), path, distance, tuple(begins))


def _moves(scene: Scene, name: str) -> bool:
    return scene.object(name).motion is not None
