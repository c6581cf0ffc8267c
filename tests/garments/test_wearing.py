"""A worn motion: energy, and torque as its exact slope."""

from __future__ import annotations

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.garments.bodies import open_body
from haptics.garments.bodies.motions import MOTIONS
from haptics.garments.equilibrium.wearing import evaluate_motion, wear
from haptics.garments.garment import cut_garment

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sleeve():
    body = open_body("capsule")
    return body, cut_garment(body, "sleeve", "coarse")


@pytest.fixture(scope="module")
def flexion(sleeve):
    worn = wear(*sleeve, MOTIONS["elbow_flexion"], 60.0)
    return worn, evaluate_motion(worn, worn.simulation.designable, worn.motion.path(60.0, 20))


def test_all_converge_and_energy_and_torque_rise(flexion):
    _, found = flexion
    assert found.converged
    assert found.energy_j[0] < 1e-15
    assert abs(found.torque_n_m[0]) < 1e-3
    assert (np.diff(found.energy_j) > 0).all()
    assert (np.diff(found.torque_n_m) > 0).all()


def test_the_torque_is_the_slope_of_what_is_stored(flexion):
    """Independent of how the torque is taken (cloth held, body turned): differences of whole equilibria, 3 degrees apart."""
    _, found = flexion
    turn = np.radians(found.angles_deg)
    slope = (found.stored_j[2:] - found.stored_j[:-2]) / (turn[2:] - turn[:-2])
    # central differences are off by h^2/6 of the third derivative; the path's own jumps are 1e-4 J
    assert slope == pytest.approx(found.torque_n_m[1:-1], rel=0.02, abs=5e-3)


def test_the_work_of_the_torque_is_what_is_stored(flexion):
    _, found = flexion
    work = np.trapezoid(found.torque_n_m, np.radians(found.angles_deg))
    assert work == pytest.approx(found.stored_j[-1] - found.stored_j[0], rel=3e-3)


def test_followed_and_cold_equilibria_differ_by_less_than_a_hundredth(flexion):
    """Equilibria depend on the path by about 1 %: cloth that slides does not slide all the way back."""
    worn, found = flexion
    assert worn.simulation.solve(worn.simulation.designable).energy_j == pytest.approx(found.energy_j[-1], rel=0.01)


def test_a_motion_that_straightens_has_its_torque_in_its_own_direction(sleeve):
    worn = wear(*sleeve, MOTIONS["elbow_extension"], 40.0)
    *path, end = worn.motion.path(40.0, 4)
    found = evaluate_motion(worn, worn.simulation.designable, [*path, 0.01, end])
    assert found.angles_deg.tolist() == [40.0, 30.0, 20.0, 10.0, 0.01, 0.0]
    assert found.converged
    assert found.energy_j[0] < 1e-15
    assert found.energy_j[-1] > 0.01
    assert (found.torque_n_m[1:] > 0).all()
    assert found.torque_n_m[-1] == pytest.approx(found.torque_n_m[-2], rel=0.01)  # one-sided at the end, central beside it


def test_less_reinforcement_stores_less(flexion, sleeve):
    worn, found = flexion
    half = worn.simulation.rest.centres_m[:, 2] > np.median(worn.simulation.rest.centres_m[:, 2])
    assert worn.simulation.solve(half).energy_j < found.energy_j[-1]
    assert worn.simulation.solve(np.zeros_like(half)).energy_j < worn.simulation.solve(half).energy_j


def test_wrong_angles_are_refused(sleeve, flexion):
    with pytest.raises(InputError, match="angle of elbow_flexion = 400 deg"):
        wear(*sleeve, MOTIONS["elbow_flexion"], 400.0)
    worn, _ = flexion
    with pytest.raises(InputError, match="angles_deg is empty"):
        evaluate_motion(worn, worn.simulation.designable, [])
    with pytest.raises(InputError, match="angle of elbow_flexion = -1 deg"):
        evaluate_motion(worn, worn.simulation.designable, [-1.0])
