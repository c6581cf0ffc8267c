import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haptics.garments.bodies.bending import Hinge, rotation, turned

RADIUS_M, REACH_M = 0.04, 0.16
HINGE = Hinge(
    centre_m=np.array([0.1, -0.2, 0.3]),
    direction=np.array([0.0, 0.0, -1.0]),
    radius_m=RADIUS_M,
    longest_m=1.0,
    belly_m=0.13,
    bulge_m=0.0,
)
ACROSS = np.array([1.0, 0.0, 0.0])  # the axis of flexion
INWARD = np.cross(ACROSS, HINGE.direction)


def limb(s, y, z=0.0):
    return HINGE.centre_m + np.multiply.outer(s, HINGE.direction) + np.multiply.outer(y, INWARD) + np.multiply.outer(z, ACROSS)


def test_rotation_vectors_become_the_matrices_of_another_implementation():
    vectors = np.array([[0, 0, 0], [1e-9, 0, 0], [0.3, -0.2, 0.5], [3.0, 0, 0.5], [np.pi, 0, 0]], dtype=float)
    assert rotation(vectors) == pytest.approx(Rotation.from_rotvec(vectors).as_matrix(), abs=1e-14)


def test_a_hand_bent_far_inward_is_still_rigid():
    vector = np.radians(120) * ACROSS
    far = limb(np.array([0.25, 0.3]), np.array([0.15, 0.2]))
    exact = HINGE.centre_m + Rotation.from_rotvec(vector).apply(far - HINGE.centre_m)
    assert HINGE.bent(far, vector) == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize("angle_deg", [1, 60, 120])
def test_beyond_the_reach_the_limb_is_rigid_and_before_it_at_rest(angle_deg):
    vector = np.radians(angle_deg) * ACROSS
    far = limb(np.linspace(REACH_M, 0.3, 7), np.linspace(-0.05, 0.05, 7), 0.02)
    exact = HINGE.centre_m + Rotation.from_rotvec(vector).apply(far - HINGE.centre_m)
    assert HINGE.bent(far, vector) == pytest.approx(exact, abs=1e-14)
    near = limb(np.linspace(-0.3, -REACH_M, 7), np.linspace(-0.05, 0.05, 7), 0.02)
    assert HINGE.bent(near, vector) == pytest.approx(near, abs=1e-15)


def test_the_outside_goes_round_the_joint_with_the_limbs_radius():
    angle = np.radians(120)
    offset = HINGE.bent(limb(np.linspace(-REACH_M, REACH_M, 4001), np.full(4001, -RADIUS_M)), angle * ACROSS) - HINGE.centre_m
    bearing = np.arctan2(offset @ HINGE.direction, -offset @ INWARD)
    round_joint = (bearing > 0.01) & (bearing < angle - 0.01)
    assert round_joint.sum() > 500
    assert np.linalg.norm(offset[round_joint], axis=1) == pytest.approx(RADIUS_M, abs=1e-9)


def test_the_outside_stretches_by_the_arc_and_the_inside_shortens():
    angle = np.radians(90)
    s = np.linspace(-REACH_M, REACH_M, 4001)
    lengths = {}
    for y in (-RADIUS_M, RADIUS_M):
        path = HINGE.bent(limb(s, np.full(len(s), y)), angle * ACROSS)
        lengths[y] = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert lengths[-RADIUS_M] == pytest.approx(2 * REACH_M + RADIUS_M * angle, rel=1e-5)
    fillet = 0.5 * RADIUS_M
    assert lengths[RADIUS_M] == pytest.approx(2 * REACH_M - 2 * (RADIUS_M + fillet) + fillet * angle, rel=1e-5)


@pytest.mark.parametrize("angle_deg", [10, 60, 90, 120])
def test_flesh_is_never_turned_inside_out(angle_deg):
    s, y = np.meshgrid(np.linspace(-0.99 * REACH_M, 0.99 * REACH_M, 301), np.linspace(-1.3 * RADIUS_M, 1.3 * RADIUS_M, 61))
    s, y, h = s.ravel(), y.ravel(), 1e-7
    vector = np.radians(angle_deg) * ACROSS
    ds = (HINGE.bent(limb(s + h, y), vector) - HINGE.bent(limb(s - h, y), vector)) / (2 * h)
    dy = (HINGE.bent(limb(s, y + h), vector) - HINGE.bent(limb(s, y - h), vector)) / (2 * h)
    assert (np.cross(ds, dy) @ np.cross(HINGE.direction, INWARD)).min() > 0.05


def test_no_angle_changes_nothing_and_a_small_one_little():
    points = limb(np.linspace(-0.2, 0.2, 50), np.linspace(-0.05, 0.05, 50))
    assert HINGE.bent(points, np.zeros(3)) == pytest.approx(points, abs=0)
    assert HINGE.bent(points, 1e-6 * ACROSS) == pytest.approx(points, abs=1e-6 * 0.25)


def test_a_turn_about_the_limb_twists_it():
    far = limb(np.array([0.2]), np.array([0.03]))
    assert HINGE.bent(far, 0.7 * HINGE.direction) == pytest.approx(
        HINGE.centre_m + Rotation.from_rotvec(0.7 * HINGE.direction).apply(far - HINGE.centre_m), abs=1e-15
    )


def test_swing_and_twist_together_are_exact_beyond_the_reach():
    vector = np.array([0.8, -0.5, 0.6])
    far = limb(np.linspace(REACH_M, 0.3, 5), np.linspace(-0.04, 0.04, 5), 0.01)
    exact = HINGE.centre_m + Rotation.from_rotvec(vector).apply(far - HINGE.centre_m)
    assert HINGE.bent(far, vector) == pytest.approx(exact, abs=1e-14)


def test_the_muscle_swells_on_the_inside_only_by_what_is_asked():
    strong = Hinge(HINGE.centre_m, HINGE.direction, RADIUS_M, 1.0, belly_m=0.2, bulge_m=0.012)
    s = np.array([-0.2, -0.2])
    y = np.array([RADIUS_M, -RADIUS_M])
    swollen = (strong.bent(limb(s, y), np.pi / 2 * ACROSS) - limb(s, y)) @ INWARD
    assert swollen == pytest.approx([0.006, 0.0], abs=1e-15)


def test_a_thick_limb_between_short_bones_is_deformed_no_farther_than_allowed():
    short = Hinge(HINGE.centre_m, HINGE.direction, 0.08, longest_m=0.1, belly_m=0.13, bulge_m=0.0)
    points = limb(np.array([-0.1, 0.1]), np.array([0.0, 0.0]))
    moved = short.bent(points, 2.0 * ACROSS)
    assert moved[0] == pytest.approx(points[0])
    assert moved[1] == pytest.approx(HINGE.centre_m + Rotation.from_rotvec(2.0 * ACROSS).apply(points[1] - HINGE.centre_m))


def test_each_point_turns_by_its_share():
    points = np.array([[1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])
    half_turn = np.array([0, 0, np.pi])
    result = turned(points, np.zeros(3), half_turn, np.array([0.0, 0.5, 1.0]))
    assert result == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0]]), abs=1e-15)
