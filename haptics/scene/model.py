"""The scene file: TOML in, ``Scene`` out. Docs: ``docs/reference/scenes.md``.

Every table is read strictly: an unknown key, a text where a number belongs, an infinite number, each is refused with
file, line and key.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from haptics.errors import InputError
from haptics.scene.clutch_rules import ByGrasp, HeldPosture, OnContact, SelectiveResistance
from haptics.scene.effects import ContactEffect, FixedSetEffect, GraspEffect, PatternEffect, ProximityEffect
from haptics.scene.geometry.mesh import load_mesh
from haptics.scene.geometry.pose import IDENTITY_XYZW, Pose
from haptics.scene.geometry.shapes import Box, Capsule, Cylinder, Placed, Plane, Shape, Sphere
from haptics.scene.objects import Motion, SceneObject
from haptics.scene.scene import Clutch, Scene
from haptics.scene.signals import Signal
from haptics.table_faults import faults_in_words, line_of, read_toml
from haptics.units import brief

AnyEffect = Annotated[ContactEffect | FixedSetEffect | PatternEffect | ProximityEffect | GraspEffect, Field(discriminator="kind")]
IN_HAND_RADIUS_M = 0.03
"""Of a ball or cylinder placed in the hand, until a hand has sized it."""
Name = Annotated[
    str, Field(pattern=r"^[a-z][a-z0-9_]*$", description="lower-case letters, digits and underscores, beginning with a letter")
]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class MeshFile(_Table):
    """A closed triangle mesh in a file beside the scene file; see ``load_mesh``.

    :param kind: always ``mesh``.
    :param file: path relative to the scene file.
    :param scale: metres per unit of the file, above 0; None: by ``units``.
    :param units: the file's unit; None: by ``scale``, or metres.
    :param up: axis of the file that points up; None: y.
    :param repair: close holes by flat caps.
    """

    kind: Literal["mesh"]
    file: str
    scale: float | None = Field(default=None, gt=0.0, description="metres per unit of the file")
    units: Literal["m", "dm", "cm", "mm", "in", "ft"] | None = None
    up: Literal["x", "y", "z"] | None = None
    repair: bool = False


class ObjectTable(_Table):
    """One ``[[objects]]`` table.

    :param name: lower-case letters, digits and underscores, beginning with a letter.
    :param shape: a shape by its numbers, or a mesh file.
    :param position_m: relative to what ``placement`` names, metres.
    :param orientation_xyzw: unit quaternion.
    :param placement: ``world``, ``palm`` (relative to the hand's median palm) or ``in_hand`` (sized and placed by a closing
        stroke).
    :param effects: what the object does to a hand.
    :param owner: who moves it while the scene runs: ``scene``, by the grasp rule, or ``engine``, by its physics.
    :param motion: its path; None: it stays.
    :param summary: what it is, for people.
    """

    name: Name
    shape: Annotated[Sphere | Box | Capsule | Cylinder | Plane | MeshFile, Field(discriminator="kind")]
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation_xyzw: tuple[float, float, float, float] = IDENTITY_XYZW
    placement: Literal["world", "palm", "in_hand"] = "world"
    effects: tuple[AnyEffect, ...] = ()
    owner: Literal["scene", "engine"] = "scene"
    motion: Motion | None = None
    summary: str = ""

    def object(self, folder: Path | None) -> SceneObject:
        """The object, its mesh read if it has one.

        :param folder: where mesh files lie; None: the current folder.
        :return: with its pose relative to what ``placement`` names.
        :raises InputError: a pose, mesh or effect that cannot be used.
        """
        pose = Pose(self.position_m, self.orientation_xyzw)
        resolved = self.placement == "world"
        body = Placed(self._shape(folder), pose)
        return SceneObject(self.name, body, self.effects, self.placement, self.motion, self.summary, resolved, self.owner)

    def _shape(self, folder: Path | None) -> Shape:
        if not isinstance(self.shape, MeshFile):
            return self.shape
        mesh = self.shape
        return load_mesh((folder or Path()) / mesh.file, mesh.scale, mesh.units, mesh.up, mesh.repair)


class SceneFile(_Table):
    """A whole scene file.

    :param summary: what the scene is, for people; at least one character.
    :param source: where the scene comes from, such as a thesis section.
    :param grasp_rule: ``rearming`` or ``thesis``.
    :param objects: the ``[[objects]]`` tables.
    :param signals: body signals with profiles.
    :param clutches: of a garment.
    :param rules: which engage them.
    """

    summary: str = Field(min_length=1)
    source: str = ""
    grasp_rule: Literal["rearming", "thesis"] = "rearming"
    objects: tuple[ObjectTable, ...] = ()
    signals: tuple[Signal, ...] = ()
    clutches: tuple[Clutch, ...] = ()
    rules: tuple[Annotated[ByGrasp | HeldPosture | SelectiveResistance | OnContact, Field(discriminator="kind")], ...] = ()

    def scene(self, name: str, objects: tuple[SceneObject, ...]) -> Scene:
        """The scene, made from the objects that its tables gave.

        :param name: of the scene.
        :param objects: in the file's order.
        :return: not yet placed.
        :raises InputError: parts that do not go together, as ``Scene`` refuses them.
        """
        return Scene(
            name=name,
            objects=objects,
            signals=self.signals,
            clutches=self.clutches,
            rules=self.rules,
            grasp_rule=self.grasp_rule,
            summary=self.summary,
            source=self.source,
        )


def read_scene(text: str, name: str, place: str, folder: Path | None = None) -> Scene:
    """A scene from a file's text.

    :param text: TOML.
    :param name: of the scene.
    :param place: what to call the file in messages.
    :param folder: where its mesh files lie; None: the current folder.
    :return: not yet placed.
    :raises InputError: not TOML, or not a scene; with file, line and key.
    """
    data = read_toml(text, place)
    _size_by_hand(data, text, place)
    try:
        as_json = json.dumps(data)  # strict JSON mode takes an array for a tuple, and nothing else for what it is not
    except (TypeError, RecursionError) as error:
        raise InputError(f"{place}: {error}; expected texts, numbers, true, false, arrays and tables") from error
    try:
        file = SceneFile.model_validate_json(as_json, strict=True)
    except ValidationError as error:
        raise InputError(faults_in_words(error, SceneFile.model_json_schema(), data, place, text)) from error
    objects = tuple(_object(table, index, folder, text, place) for index, table in enumerate(file.objects))
    try:
        return file.scene(name, objects)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def _size_by_hand(data: dict, text: str, place: str) -> None:
    """What a hand decides of the objects placed in it, no file does: refused where it is given, filled in where it is not."""
    faults = []
    objects = data.get("objects")
    for index, table in enumerate(objects if isinstance(objects, list) else ()):
        if not isinstance(table, dict) or table.get("placement") != "in_hand":
            continue
        shape = table.get("shape")
        radius = shape if isinstance(shape, dict) and shape.get("kind") in ("sphere", "cylinder") else {}
        for *within, key in (("shape", "radius_m"), ("position_m",)):
            given = radius if within else table
            if key in given:
                line = line_of(text, ("objects", index, *within, key))
                name = table.get("name")
                faults.append(
                    f"{place}:{line}: {key} = {brief(given[key])} m of [[objects]] {name!r} would not count: placed in_hand, it "
                    "gets size and place from the hand's first closing stroke; "
                    f"leave {key} out, or choose placement world or palm"
                )
        radius["radius_m"] = IN_HAND_RADIUS_M
    if faults:
        raise InputError("\n".join(faults))


def _object(table: ObjectTable, index: int, folder: Path | None, text: str, place: str) -> SceneObject:
    try:
        return table.object(folder)
    except InputError as error:
        raise InputError(f"{place}:{line_of(text, ('objects', index))}: object {table.name!r}: {error}") from error
