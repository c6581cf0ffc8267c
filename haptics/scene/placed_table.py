"""Where the objects of a scene were when it began, as plain data, so that the scene's file and this give that scene again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from haptics.errors import InputError
from haptics.scene.geometry.mesh import TriangleMesh
from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Placed
from haptics.scene.objects import SceneObject
from haptics.scene.scene import Scene


def placed_table(scene: Scene) -> dict[str, dict[str, Any] | None]:
    """What placing decided.

    :param scene: placed, in part or not at all.
    :return: by object: its pose, the numbers of its shape (none of a mesh), offsets of its path; None for one without a place.
    """
    return {item.name: _row(item) if item.resolved else None for item in scene.objects}


def placed_again(scene: Scene, table: Mapping[str, Any]) -> Scene:
    """The scene as it was.

    :param scene: from its file, not placed.
    :param table: from :func:`placed_table`.
    :return: with the objects of the table alone.
    :raises InputError: an object that the scene does not have, or what no such table holds.
    """
    try:
        return replace(scene, objects=tuple(_again(scene.object(name), row) for name, row in table.items()))
    except (TypeError, KeyError, AttributeError) as error:
        raise InputError(f"placed objects = {str(table)[:60]}…; expected what a recorded session holds: {error!r}") from error


def _row(item: SceneObject) -> dict[str, Any]:
    shape = item.body.shape
    return {
        "position_m": item.body.pose.position_m,
        "orientation_xyzw": item.body.pose.orientation_xyzw,
        "shape": {} if isinstance(shape, TriangleMesh) else asdict(shape),  # type: ignore[call-overload]  # a dataclass
        "offset_m": None if item.motion is None else item.motion.offset_m,
    }


def _again(item: SceneObject, row: Mapping[str, Any] | None) -> SceneObject:
    if row is None:
        return item
    numbers = {name: tuple(value) if isinstance(value, list) else value for name, value in row["shape"].items()}
    shape = replace(item.body.shape, **numbers) if numbers else item.body.shape  # type: ignore[type-var]
    motion = item.motion
    if motion is not None:
        motion = replace(motion, offset_m=tuple(tuple(offset) for offset in row["offset_m"]))
    body = Placed(shape, Pose(row["position_m"], row["orientation_xyzw"]))
    return replace(item, body=body, motion=motion, resolved=True)
