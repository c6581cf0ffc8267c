"""The proof of a plan: the same hand through the plan and through all references, every observable within its tolerance."""

from __future__ import annotations

from dataclasses import replace

import pytest
from shared_proofs import shared_proofs

from haptics.errors import InputError
from haptics.scene import shipped_scenes
from haptics.session.configuration import Configuration
from haptics.session.prove import prove_plan
from haptics.session.run import RunOptions

pytestmark = pytest.mark.slow


HANDS = ("grab", "wave", "waiting", "flapping")


def proof(scene, hand="synthetic", **options):
    return prove_plan(scene, hand, Configuration(), RunOptions(side="auto", **options))  # as the command does


@pytest.mark.parametrize("scene", ["playground", pytest.param("posture", marks=pytest.mark.slow)])
def test_nobody_would_tell_the_plan_from_the_reference(scene):
    with shared_proofs():
        found = proof(scene)
    assert found.kept
    assert found.rows
    assert "reference" not in found.levels.values()
    assert found.planned_cpu_s < found.reference_cpu_s


@pytest.mark.slow
def test_a_recorded_grasp_through_the_plan_and_through_the_reference(recordings):
    found = proof("playground", str(recordings / "grab.leap.json.gz"))
    assert found.kept, found.rows
    compared = {row.observable: row.n for row in found.rows}
    assert compared["arrival time"] > 10
    assert compared["response time"] == 4  # two grasps, both brakes
    assert {"plateau, index", "plateau, thumb", "temperature", "admission"} <= compared.keys()


def test_a_level_that_is_too_coarse_for_the_tolerance_is_found_out():
    with shared_proofs():
        found = proof("playground", levels={"latch": "event", "brake": "static"}, tolerance_jnd=0.01)
    assert not found.kept
    broken = {row.observable for row in found.rows if not row.kept}
    assert broken >= {"impact speed", "plateau, index"}


@pytest.mark.parametrize("change", [{"realtime": True}, {"port_tactiles": "sim://tactiles"}])
def test_only_the_simulated_glove_in_virtual_time_can_be_compared(change):
    with pytest.raises(InputError, match="simulated glove"):
        prove_plan("desk", "synthetic", Configuration(), replace(RunOptions(), **change))


@pytest.mark.soak
@pytest.mark.parametrize("scene", [name for name, _ in shipped_scenes()])
@pytest.mark.parametrize("hand", ["synthetic", *HANDS])
def test_every_shipped_scene_with_every_hand(scene, hand, recordings):
    found = proof(scene, hand if hand == "synthetic" else str(recordings / f"{hand}.leap.json.gz"))
    assert found.kept, found.rows
