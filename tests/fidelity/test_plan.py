"""The plan: what a scene cannot ask for does not exist."""

from __future__ import annotations

import pytest

from haptics.fidelity import plan_scene
from haptics.scene import load_scene, shipped_scenes
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, open_glove

TWO_TIPS = """
summary = "a ball that two fingertips can touch"
[[objects]]
name = "ball"
placement = "palm"
shape = { kind = "sphere", radius_m = 0.03 }
effects = [{ kind = "contact", sites = ["index_tip", "thumb_tip"] }]
"""


@pytest.fixture
def two_tips(tmp_path):
    path = tmp_path / "two_tips.toml"
    path.write_text(TWO_TIPS)
    return load_scene(path)


def test_a_scene_without_brakes_has_no_brake_and_opens_no_port_for_one():
    plan = plan_scene(load_scene("desk"))
    assert not plan.builds("brake")
    assert {"brake", "piezo"} <= {absence.device for absence in plan.absent}
    glove = open_glove(load_scene("desk"), plan, Configuration(), RunOptions())
    try:
        assert set(glove.links) == {"tactiles"}
    finally:
        glove.close()


def test_a_scene_with_two_fingertips_drives_two_sites(two_tips):
    plan = plan_scene(two_tips)
    row = next(row for row in plan.rows if row.device == "tactiles")
    assert row.why.startswith("2 sites driven")


@pytest.mark.parametrize("name", [name for name, _ in shipped_scenes()])
def test_every_device_is_either_planned_or_absent_with_a_sentence(name):
    plan = plan_scene(load_scene(name))
    planned, absent = {row.device for row in plan.rows}, {absence.device for absence in plan.absent}
    for device in ("tactiles", "brake", "piezo"):
        assert (device in planned) != (device in absent)
    assert all(len(row.why) > 20 for row in (*plan.rows, *plan.absent))
