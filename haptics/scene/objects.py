"""One object of a scene: its body, its effects, how it moves, and where a hand puts it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from haptics.errors import InputError
from haptics.scene.effects import Effect, GraspEffect
from haptics.scene.geometry.pose import Array, Pose, shortest_turn_xyzw
from haptics.scene.geometry.shapes import Box, Cylinder, Placed, Sphere
from haptics.scene.placement import InHand
from haptics.scene.signals import check_times, locate
from haptics.units import one_of

PLACEMENTS = ("world", "palm", "in_hand")
OWNERS = ("scene", "engine")
IN_HAND_SHAPES = (Sphere, Cylinder, Box)


@dataclass(frozen=True)
class Motion:
    """A path of an object: straight from keyframe to keyframe, added to where it is placed, in world axes.

    :param time_s: increasing, from 0 up, s.
    :param offset_m: one for each time, three numbers each, metres.
    :param repeat: start over after the last keyframe.
    :raises InputError: times not increasing, or not as many offsets.
    """

    __pydantic_config__: ClassVar[dict] = {"extra": "forbid", "allow_inf_nan": False}
    time_s: tuple[float, ...]
    offset_m: tuple[tuple[float, float, float], ...]
    repeat: bool = False

    def __post_init__(self) -> None:
        check_times("motion", self.time_s, len(self.offset_m), "offset_m")

    def at(self, time_s: float) -> Array:
        """The offset at a moment.

        :param time_s: from the start of the run, s.
        :return: (3,), metres.
        """
        index, along, _ = locate(self.time_s, time_s, self.repeat)
        start, end = self.offset_m[index], self.offset_m[min(index + 1, len(self.offset_m) - 1)]
        return np.asarray(start, float) * (1.0 - along) + np.asarray(end, float) * along


@dataclass(frozen=True)
class SceneObject:
    """One object, as ``load_scene(file).object(name)`` gives it.

    Until ``resolved``, its body's pose is relative to what ``placement`` names.

    :param name: unique in its scene.
    :param body: shape and pose.
    :param effects: what it does to a hand; one grasp effect at most.
    :param placement: ``world``, ``palm`` or ``in_hand``.
    :param motion: its path, added to the pose; None: it stays where it is.
    :param summary: what it is, for people.
    :param resolved: whether the body's pose is in world coordinates.
    :param owner: who moves it while a scene runs: ``scene``, by the grasp rule, or ``engine``, by its physics, with
        ``Session.move_object``; then a grasp of it is felt, and moves it no further.
    """

    name: str
    body: Placed
    effects: tuple[Effect, ...] = ()
    placement: Literal["world", "palm", "in_hand"] = "world"
    motion: Motion | None = None
    summary: str = ""
    resolved: bool = True
    owner: Literal["scene", "engine"] = "scene"

    def check_movable(self) -> None:
        """Refuse to be moved along a path of its own.

        :raises InputError: it has a motion.
        """
        if self.motion is not None:
            raise InputError(f"object {self.name!r} follows a motion of its own; only an object without one can be moved")

    def body_at(self, time_s: float) -> Placed:
        """The body at a moment, moved along its path.

        :param time_s: from the start of the run, s.
        :return: shape and pose.
        """
        return self.body if self.motion is None else self.body.at(self.body.pose.shifted(self.motion.at(time_s)))

    @property
    def grasp(self) -> GraspEffect | None:
        """How it is grasped, if it can be."""
        return next((effect for effect in self.effects if isinstance(effect, GraspEffect)), None)


def place_by_palm(item: SceneObject, palm_m: Array, mirror: bool) -> SceneObject:
    """The object shifted to a palm; mirrored to the other side first for a left hand.

    :param item: an object with its pose relative to the palm.
    :param palm_m: the palm's position, (3,), metres.
    :param mirror: whether the hand is a left one.
    :return: the object in world coordinates.
    """
    pose, motion = item.body.pose, item.motion
    if mirror:
        x, y, z = pose.position_m
        qx, qy, qz, qw = pose.orientation_xyzw
        pose = Pose((-x, y, z), (qx, -qy, -qz, qw))
        if motion is not None:
            motion = replace(motion, offset_m=tuple((-x, y, z) for x, y, z in motion.offset_m))
    return replace(item, body=item.body.at(pose.shifted(palm_m)), motion=motion, resolved=True)


def size_in_hand(item: SceneObject, found: InHand) -> SceneObject:
    """The object sized and turned so that both tips touch it at ``found.time_ns``, with as little turning as that takes.

    :param item: an object with a sphere, a cylinder or a box.
    :param found: where the tips meet it.
    :return: the object in world coordinates.
    """
    shape, turn = item.body.shape, item.body.pose
    ray = np.asarray(found.axis, float)
    if isinstance(shape, Box):
        shape = replace(shape, size_m=(2.0 * found.radius_m, *shape.size_m[1:]))
        now, wanted = turn.rotation[:, 0], ray
    else:
        shape = replace(shape, radius_m=found.radius_m)  # type: ignore[type-var]  # a sphere or a cylinder: checked with the scene
        now = turn.rotation[:, 1]
        wanted = now - (now @ ray) * ray
        if np.linalg.norm(wanted) < 1e-6:  # the axis lies along the ray: any direction across it is as near
            wanted = np.cross(ray, np.eye(3)[int(np.argmin(np.abs(ray)))])
    turned = turn.turned_about(turn.origin_m, shortest_turn_xyzw(now, wanted), np.asarray(found.centre_m, float))
    return replace(item, body=Placed(shape, turned), resolved=True)


def check_object(item: SceneObject) -> None:
    """Refuse what an object cannot be, whoever made it.

    :param item: the object.
    :raises InputError: an unknown placement, two grasps, a grasp with a motion, or a shape that cannot be sized in the hand.
    """
    one_of("placement", item.placement, PLACEMENTS)
    one_of("owner", item.owner, OWNERS)
    if item.owner == "engine":
        item.check_movable()
    kinds = [effect.kind for effect in item.effects]
    if kinds.count("grasp") > 1:
        raise InputError(f"object {item.name!r} has {kinds.count('grasp')} grasp effects; must be at most one")
    if item.grasp is not None and item.motion is not None:
        raise InputError(
            f"object {item.name!r} has a grasp effect and a motion; give one of them, as a grasped object follows the hand"
        )
    if item.placement == "in_hand" and not isinstance(item.body.shape, IN_HAND_SHAPES):
        allowed = ", ".join(shape.__name__.lower() for shape in IN_HAND_SHAPES)
        raise InputError(f"object {item.name!r} is placed in_hand, its shape is a {item.body.shape.kind}; allowed: {allowed}")  # type: ignore[attr-defined]
