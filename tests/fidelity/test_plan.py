"""The plan: what a scene cannot ask for does not exist, and of what exists the cheapest level that nobody would notice."""

from __future__ import annotations

import pytest

from haptics.errors import InputError
from haptics.fidelity import plan_scene, shipped
from haptics.fidelity.notice import NOTICES, force_notice, rate_notice
from haptics.physics.brake import levels as brake
from haptics.physics.latch import pulse as latch
from haptics.scene import load_scene, shipped_scenes
from haptics.session.composition import open_planned, with_ports
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene

LADDERS = {"latch": latch.LEVELS, "brake": brake.LEVELS}
SCENES = [name for name, _ in shipped_scenes()]
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


def row_of(plan, model):
    return next(row for row in plan.rows if row.model == model)


def test_a_scene_without_brakes_has_no_brake_and_opens_no_port_for_one():
    plan = plan_scene(load_scene("desk"))
    assert not plan.builds("brake")
    assert {"brake", "piezo"} <= {absence.device for absence in plan.absent}
    glove = open_planned(load_scene("desk"), plan, Configuration())
    try:
        assert set(glove.links) == {"tactiles"}
    finally:
        glove.close()


def test_a_scene_with_two_fingertips_builds_two_actuators(two_tips):
    plan, whole = plan_scene(two_tips), plan_scene(load_scene("desk"))
    assert plan.sites == ("thumb_tip", "index_tip")
    assert row_of(plan, "latch").count == 2
    assert row_of(plan, "latch").cost_s_per_s == pytest.approx(row_of(whole, "latch").cost_s_per_s * 2 / 15)
    assert any(absence.device == "actuators" and "little_tip" in absence.why for absence in plan.absent)
    glove = open_planned(two_tips, plan, Configuration())
    try:
        truth = glove.plant("tactiles").truth()
        assert len(truth["fitted"]) == 2
    finally:
        glove.close()


@pytest.mark.slow
def test_the_report_speaks_of_the_actuators_that_exist(two_tips, tmp_path):
    report = run_scene(str(tmp_path / "two_tips.toml"), "synthetic", Configuration(), RunOptions(record=False))
    assert [row["site"] for row in report["actuators"]] == ["thumb_tip", "index_tip"]


@pytest.mark.parametrize("name", SCENES)
def test_every_device_is_either_planned_or_absent_with_a_sentence(name):
    plan = plan_scene(load_scene(name))
    planned, absent = {row.device for row in plan.rows}, {absence.device for absence in plan.absent}
    for device in ("tactiles", "brake", "piezo"):
        assert (device in planned) != (device in absent)
    assert all(len(row.why) > 20 for row in (*plan.rows, *plan.absent))


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("tolerance", [0.003, 0.05, 1 / 3, 1.0, 10.0])
def test_each_level_is_the_cheapest_whose_measured_error_is_within_the_limit(name, tolerance):
    scene = load_scene(name)
    for row in plan_scene(scene, tolerance).rows:
        if row.model not in LADDERS:
            continue
        ladder = LADDERS[row.model]
        assert row.error <= row.limit or row.level == ladder[-1]
        if row.level != ladder[0]:
            cheaper = ladder[ladder.index(row.level) - 1]
            again = row_of(plan_scene(scene, tolerance, levels={row.model: cheaper}), row.model)
            assert again.error > again.limit, "a cheaper level would have done"


def test_a_loose_tolerance_takes_the_cheapest_and_a_tight_one_the_finest():
    scene = load_scene("playground")
    assert plan_scene(scene, 10.0).levels == {"tactiles": "event", "brake": "static"}
    assert plan_scene(scene, 1e-3).levels["tactiles"] in ("dynamic", "reference")


def test_want_of_time_gives_up_what_is_felt_least_and_says_so_and_more_time_gives_it_back():
    scene = load_scene("playground")
    due = plan_scene(scene)
    tight = plan_scene(scene, budget_s_per_s=0.9 * sum(row.cost_s_per_s for row in due.rows))
    changed = [row for row in tight.rows if row.model in LADDERS and row.level != row_of(due, row.model).level]
    assert changed
    assert all("for want of time" in row.why and "would be noticed" in row.why for row in changed)
    starved = plan_scene(scene, budget_s_per_s=1e-6)
    assert "more than the" in starved.over_budget
    assert plan_scene(scene) == due


def test_a_level_that_is_asked_for_is_taken_and_reported_with_its_error():
    plan = plan_scene(load_scene("playground"), levels={"latch": "event", "brake": "reference"})
    assert plan.levels == {"tactiles": "event", "brake": "reference"}
    assert "asked for" in row_of(plan, "latch").why
    assert row_of(plan, "latch").error > row_of(plan, "latch").limit
    assert row_of(plan, "brake").error == 0.0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"tolerance_jnd": 0.0}, "tolerance_jnd"),
        ({"tolerance_jnd": float("nan")}, "tolerance_jnd"),
        ({"budget_s_per_s": 0.0}, "budget"),
        ({"levels": {"latch": "static"}}, "static"),
        ({"levels": {"heat": "exact"}}, "heat"),
    ],
)
def test_nonsense_is_refused_by_name(arguments, word):
    with pytest.raises(InputError, match=word):
        plan_scene(load_scene("desk"), **arguments)


def test_force_is_judged_by_the_nearest_published_step_through_the_laws_slope():
    # At 800 V the index law's slope d ln F / d ln V is 2 V^2 / (V^2 - V0^2), V0 = 172 V: 2.10; 7.8 % of volts (Table 4.2).
    at_800 = force_notice("index", 800.0)
    assert at_800.threshold == pytest.approx(7.8 * 2 / (1 - (172.3 / 800) ** 2), rel=2e-3)
    assert at_800.tolerance == pytest.approx(at_800.threshold / 3)
    assert force_notice("thumb", 390.0).threshold < at_800.threshold  # 4.6 % of volts at 400 V
    assert NOTICES["wrong final state"].limit(1.0) == 0.0
    assert rate_notice("radial").threshold == 3.2
    for wrong in (lambda: force_notice("little", 800.0), lambda: force_notice("index", 2e3), lambda: rate_notice("spiral")):
        with pytest.raises(InputError):
            wrong()


def test_the_users_own_url_wins_over_the_plan():
    scene = load_scene("desk")
    configuration = with_ports(Configuration(), "sim://tactiles?level=dynamic&fitted=32767", None)
    glove = open_planned(scene, plan_scene(scene), configuration)
    try:
        assert len(glove.plant("tactiles").truth()["fitted"]) == 15
    finally:
        glove.close()


def test_measured_costs_are_those_of_the_plan():
    table = shipped()
    row = row_of(plan_scene(load_scene("playground")), "latch")
    measured = table.row("latch", row.level, row.observable)
    assert row.cost_s_per_s == pytest.approx(15 * measured.cost_s_per_sim_s["1"])
    assert row.error == measured.worst
