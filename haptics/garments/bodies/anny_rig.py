"""From anny's own rest shape to a straight body: which bones are which joints, linear skinning, clefts that cloth spans.

anny (Apache-2.0, the shapes of MakeHuman) bends its elbows by 42 degrees at rest. Only its own topology is used: those of SMPL
would fetch data that is not free.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from haptics.extras import install
from haptics.folders import cache_folder
from haptics.garments.bodies.bending import rotation, smooth_step
from haptics.garments.bodies.body import PARTS
from haptics.garments.bodies.motions import ARM_DIRECTION, JOINTS, LEG_DIRECTION
from haptics.garments.cut.cutting import largest_piece
from haptics.garments.cut.fairing import spanned, spread
from haptics.garments.mesh import Floats, Ints

FORMAT = 1
"""Version of what ``straight_rig`` makes; another number discards kept bodies."""

ENDS = ("wrist_l", "wrist_r", "ankle_l", "ankle_r")
SEGMENTS = ("pelvis", *JOINTS)
"""What moves as one piece: the pelvis, and what lies beyond each joint until the next."""
_ABOVE = {
    **{"spine_1": "pelvis", "spine_2": "spine_1", "spine_3": "spine_2", "spine_4": "spine_3", "spine_5": "spine_4"},
    **{f"{joint}_{side}": "spine_5" for joint in ("shoulder",) for side in "lr"},
    **{f"{joint}_{side}": "pelvis" for joint in ("hip",) for side in "lr"},
    **{f"{joint}_{side}": f"{above}_{side}" for joint, above in (("elbow", "shoulder"), ("knee", "hip")) for side in "lr"},
    **{f"{end}_{side}": f"{above}_{side}" for end, above in (("wrist", "elbow"), ("ankle", "knee")) for side in "lr"},
}
"""The segment on which a joint, or a limb's end, sits."""
_BELOW = {"shoulder": "elbow", "elbow": "wrist", "hip": "knee", "knee": "ankle"}

_BONE = {
    **{f"spine_{i}": f"spine0{6 - i}" for i in range(1, 6)},
    **{
        f"{joint}_{side}": f"{bone}.{side.upper()}"
        for joint, bone in (
            *(("shoulder", "upperarm01"), ("elbow", "lowerarm01"), ("wrist", "wrist")),
            *(("hip", "upperleg01"), ("knee", "lowerleg01"), ("ankle", "foot")),
        )
        for side in "lr"
    },
}
"""The bone that begins at a joint, or at a limb's end."""
_PART_BEGINS = {
    **{"root": "pelvis", "spine05": "torso", "neck01": "head"},
    **{
        _BONE[f"{at}_{side}"]: f"{part}_{side}"
        for at, part in (
            *(("shoulder", "upper_arm"), ("elbow", "lower_arm"), ("wrist", "hand")),
            *(("hip", "upper_leg"), ("knee", "lower_leg"), ("ankle", "foot")),
        )
        for side in "lr"
    },
}
"""The bones at which a part begins; those below belong to it until the next."""
_SEAM_M = 0.12
"""Distance over which pelvis blends into torso."""
_SPREAD_ROUNDS = 40
"""Smoothing rounds of the weights of shoulders and hips: anny's change too fast for a turned thigh."""


@dataclass(frozen=True, eq=False)
class RestShape:
    """A phenotype at anny's own rest, skin only.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param weights: how far each vertex follows each of ``SEGMENTS``, rows sum to 1, ``(vertices, segments)``.
    :param parts: how far each vertex belongs to each of ``PARTS``, rows sum to 1, ``(vertices, parts)``.
    :param at_m: positions of the joints and of the limbs' ends by name, m, ``(3,)`` each.
    """

    vertices_m: Floats
    triangles: Ints
    weights: Floats
    parts: Floats
    at_m: Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class StraightRig:
    """The same phenotype, standing straight.

    :param vertices_m: positions, m, ``(vertices, 3)``.
    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param shares: how far each vertex follows each of ``JOINTS``, 0 to 1, ``(vertices, joints)``.
    :param parts: how far each vertex belongs to each of ``PARTS``, rows sum to 1, ``(vertices, parts)``.
    :param at_m: positions of the joints and of the limbs' ends by name, m, ``(3,)`` each.
    """

    vertices_m: Floats
    triangles: Ints
    shares: Floats
    parts: Floats
    at_m: Mapping[str, Floats]


def rest_shape(phenotype: Mapping[str, float]) -> RestShape:
    """A phenotype as anny shapes it. The first call prepares anny's own data, which takes minutes.

    :param phenotype: all of ``anny_body.ADULT``'s names, 0 to 1 each.
    :return: skin, weights and joints at anny's own rest, m.
    :raises InputError: anny or torch is missing.
    """
    try:
        import torch  # pyright: ignore[reportMissingImports]
        from anny import Anny, paths  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise missing(error.name or "anny") from error

    if "ANNY_CACHE_DIR" not in os.environ:
        paths.set_anny_cache_path(cache_folder() / "anny")
    if sys.stderr.isatty() and not any(paths.get_anny_cache_path().glob("*/*")):
        print("anny prepares its data, once: it takes some minutes, and 0.8 GB of the cache", file=sys.stderr)
    model = Anny(rig="anny", topology="anny", skinning_method="lbs")
    with torch.no_grad():
        shape = model(phenotype_kwargs=dict(phenotype))
    vertices = shape["rest_vertices"][0].double().numpy()
    bones, parents = list(model.bone_labels), list(model.bone_parents)
    heads = dict(zip(bones, shape["rest_bone_heads"][0].double().numpy(), strict=True))
    weights = np.zeros((len(vertices), len(bones)))
    np.add.at(weights, (np.arange(len(vertices))[:, None], model.vertex_bone_indices.numpy()), model.vertex_bone_weights.numpy())
    skin, triangles = _outer_skin(model)
    begins = {"root": "pelvis", **{_BONE[joint]: joint for joint in JOINTS}}
    parts = _gathered(weights[skin], bones, parents, _PART_BEGINS, PARTS)
    _split_at_waist(parts, vertices[skin, 2] - heads[_BONE["spine_2"]][2])
    return RestShape(
        vertices[skin],
        triangles,
        _gathered(weights[skin], bones, parents, begins, SEGMENTS),
        parts,
        {at: heads[_BONE[at]] for at in (*JOINTS, *ENDS)},
    )


def missing(package: str) -> InputError:
    """The error to raise where a package of the extra ``body`` is not installed.

    :param package: name of the package.
    :return: the error, with the command that installs it.
    """
    return InputError(f"body anny needs {package}; install it with: {install('body')}, or use body capsule")


def straightening(rest: RestShape) -> dict[str, Floats]:
    """How each segment moves from anny's rest to the straight pose with the soles on z = 0.

    Each limb's bone turns by the smallest rotation that brings it to the straight body's direction.

    :param rest: the phenotype at anny's rest.
    :return: by segment, the rigid motion as a homogeneous matrix, m, ``(4, 4)`` each.
    """
    moves = {"pelvis": np.eye(4)}
    moves["pelvis"][2, 3] = -rest.vertices_m[:, 2].min()
    for joint in JOINTS:
        above, turn = moves[_ABOVE[joint]], np.eye(3)
        kind, side = joint[:-2], joint[-1]
        if kind in _BELOW:
            wanted = ARM_DIRECTION[side] if kind in ("shoulder", "elbow") else LEG_DIRECTION[side]
            turn = _min_rotation(above[:3, :3] @ (rest.at_m[f"{_BELOW[kind]}_{side}"] - rest.at_m[joint]), wanted)
        moves[joint] = about(moved(above, rest.at_m[joint]), turn) @ above
    return moves


def skinned(rest: RestShape, moves: Mapping[str, Floats]) -> Floats:
    """Linear blend skinning: v = sum over segments of weight x move x v_rest.

    :param rest: the phenotype at anny's rest.
    :param moves: homogeneous matrix of each of ``SEGMENTS``, m, ``(4, 4)`` each.
    :return: positions, m, ``(vertices, 3)``.
    """
    blended = np.tensordot(rest.weights, np.stack([moves[segment][:3] for segment in SEGMENTS]), axes=1)
    return np.einsum("vij,vj->vi", blended[:, :, :3], rest.vertices_m) + blended[:, :, 3]


def straight_rig(rest: RestShape) -> StraightRig:
    """The body straightened, with clefts spanned and weights spread.

    :param rest: the phenotype at anny's rest.
    :return: the straight body with its joints, shares and parts.
    """
    moves = straightening(rest)
    clothed = sum(rest.parts[:, PARTS.index(part)] for part in PARTS if part.startswith(("torso", "pelvis", "upper", "lower")))
    vertices = spanned(skinned(rest, moves), rest.triangles, np.asarray(clothed) > 0.5)
    shares = {joint: rest.weights[:, SEGMENTS.index(joint)] for joint in JOINTS}
    for joint in reversed(JOINTS):  # what follows a joint follows all above it
        if _ABOVE[joint] != "pelvis":
            shares[_ABOVE[joint]] = shares[_ABOVE[joint]] + shares[joint]
    for joint in shares:
        if joint.startswith(("shoulder", "hip")):
            shares[joint] = spread(shares[joint], rest.triangles, _SPREAD_ROUNDS)
    at = {name: moved(moves[name if name in moves else _ABOVE[name]], point) for name, point in rest.at_m.items()}
    return StraightRig(vertices, rest.triangles, np.stack([shares[joint] for joint in JOINTS], axis=1), rest.parts, at)


def _outer_skin(model) -> tuple[Ints, Ints]:
    """Vertices kept, ``(vertices,)``, and triangles, without eyes, tongue, and the insides of mouth and eye sockets."""
    from anny.face_segmentation import get_face_segmentation_mask  # pyright: ignore[reportMissingImports]

    hidden = get_face_segmentation_mask(model, ["mouth_cavity", "eye_cavity.L", "eye_cavity.R"]).numpy()
    triangles = largest_piece(model.faces.numpy().astype(np.int64)[~hidden])
    skin, flat = np.unique(triangles, return_inverse=True)
    return skin, flat.reshape(triangles.shape).astype(np.int64)


def _gathered(
    weights: Floats, bones: list[str], parents: list[int], begins: Mapping[str, str], groups: tuple[str, ...]
) -> Floats:
    """Weights of bones summed over groups, ``(vertices, groups)``: a bone belongs where it begins, else where its parent does."""
    group: list[str] = []
    for bone, parent in zip(bones, parents, strict=True):  # parents come before their children
        group.append(begins[bone] if bone in begins else group[parent])
    total = np.zeros((len(weights), len(groups)))
    for column, name in enumerate(group):
        total[:, groups.index(name)] += weights[:, column]
    return total / total.sum(axis=1, keepdims=True)


def _split_at_waist(parts: Floats, height_m: Floats) -> None:
    """Trunk above the waist is torso, below it pelvis: anny's lowest bone of the spine moves the hips, too."""
    torso, pelvis = PARTS.index("torso"), PARTS.index("pelvis")
    trunk, above = parts[:, torso] + parts[:, pelvis], smooth_step(0.5 + height_m / _SEAM_M)
    parts[:, torso], parts[:, pelvis] = trunk * above, trunk * (1 - above)


def moved(move: Floats, point_m: Floats) -> Floats:
    """A point after a rigid motion.

    :param move: homogeneous matrix, m, ``(4, 4)``.
    :param point_m: the point, m, ``(3,)``.
    :return: where it ends, m, ``(3,)``.
    """
    return move[:3, :3] @ point_m + move[:3, 3]


def about(centre_m: Floats, turn: Floats) -> Floats:
    """A rotation about a centre as a homogeneous matrix.

    :param centre_m: the point that stays, m, ``(3,)``.
    :param turn: rotation matrix, ``(3, 3)``.
    :return: the motion, m, ``(4, 4)``.
    """
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = turn, centre_m - turn @ centre_m
    return move


def _min_rotation(a: Floats, b: Floats) -> Floats:
    """The smallest rotation that turns a's direction into b's."""
    axis = np.cross(a, b)
    size = np.linalg.norm(axis)
    return rotation(axis / size * np.arctan2(size, a @ b)) if size > 0 else np.eye(3)
