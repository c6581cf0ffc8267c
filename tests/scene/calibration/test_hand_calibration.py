"""A calibration is checked when it is made, and puts the tactors where it says."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from datetime import date, datetime

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.hands.joints import JOINT
from haptics.scene.hands.synthetic import synthetic_hand
from haptics.scene.sites import SITE, nominal_sites


def test_what_is_left_out_is_nominal():
    sites, nominal = HandCalibration(name="anna", side="left").sites(), nominal_sites()
    np.testing.assert_array_equal(sites.offset_m, nominal.offset_m)
    np.testing.assert_array_equal(sites.radius_m, nominal.radius_m)
    track = synthetic_hand().tracks[0]
    pose = track.position_m[0], track.orientation_xyzw[0]
    np.testing.assert_array_equal(sites.positions(*pose), nominal.positions(*pose))


def test_tips_and_offsets_are_the_persons():
    own = HandCalibration(
        name="anna",
        side="right",
        tip_radius_m={"index": 0.01, "thumb": 0.008},
        offset_m={"palm_index": np.array([0.004, -0.002, 0.0])},
    )
    sites, nominal = own.sites(), nominal_sites()
    changed = np.zeros((15, 3))
    changed[SITE["palm_index"]] = 0.004, -0.002, 0.0
    np.testing.assert_allclose(sites.offset_m - nominal.offset_m, changed, atol=1e-15)
    assert sites.radius_m[[SITE["thumb_tip"], SITE["index_tip"], SITE["middle_tip"]]].tolist() == [0.008, 0.01, 0.007]
    assert sites.radius_m[5:].tolist() == nominal.radius_m[5:].tolist()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"name": "a/b"}, "name = 'a/b'; expected 1 to 64 letters"),
        ({"name": ""}, "name = ''"),
        ({"name": "é"}, "name = 'é'"),
        ({"name": "anna\n"}, "name = 'anna"),
        ({"name": "x" * 65}, "name = 'xxx"),
        ({"name": None}, "name = None"),
        ({"side": "both"}, "side = 'both' is not allowed; allowed: left, right"),
        ({"tip_radius_m": {"index": 0.0029}}, "tip_radius_m.index = 0.0029 m; allowed 0.003 to 0.015 m"),
        ({"tip_radius_m": {"index": 7.0}}, "tip_radius_m.index = 7 m; allowed 0.003 to 0.015 m"),
        ({"tip_radius_m": {"index": float("nan")}}, "tip_radius_m.index = nan m"),
        ({"tip_radius_m": {"index": "0.007"}}, "tip_radius_m.index = '0.007' is not a number"),
        ({"tip_radius_m": {"index": True}}, "tip_radius_m.index = True is not a number"),
        ({"tip_radius_m": {"index": 10**400}}, "tip_radius_m.index = "),
        ({"tip_radius_m": {"pinky": 0.007}}, "tip_radius_m has no finger 'pinky'; known fingers: thumb, index"),
        ({"tip_radius_m": 0.007}, "tip_radius_m = 0.007 is no table"),
        ({"tip_radius_sd_m": {"index": -1e-3}}, "tip_radius_sd_m.index = -0.001 m"),
        ({"offset_m": {"palm_indx": (0, 0, 0)}}, "offset_m has no site 'palm_indx'"),
        ({"offset_m": {"palm_indx": (0, 0, 0)}}, "did you mean palm_index?"),
        ({"offset_m": {3: (0, 0, 0)}}, "offset_m has no site 3"),
        ({"offset_m": {"palm_index": (0, 0)}}, "offset_m.palm_index = (0, 0) has 2 numbers; expected 3"),
        ({"offset_m": {"palm_index": 0.001}}, "offset_m.palm_index = 0.001 is no list"),
        ({"offset_m": {"palm_index": (0, 0, 0.051)}}, "offset_m.palm_index along z = 0.051 m; allowed -0.05 to 0.05 m"),
        ({"bone_m": {"index_tip": 0.01}}, "bone_m has no bone 'index_tip'"),
        ({"bone_m": {"index_distal": 16}}, "bone_m.index_distal = 16 m; allowed 0 to 0.15 m"),
        ({"breadth_m": 61.4}, "breadth_m = 61.4 m; allowed 0.03 to 0.12 m"),
        ({"made_on": datetime(2026, 1, 1)}, "made_on = datetime.datetime(2026, 1, 1, 0, 0) is no day"),
        ({"made_from": "two\nlines"}, "made_from = 'two\\nlines'; expected one line of text"),
        ({"notes": "one"}, "notes = 'one' is no list"),
        ({"notes": ["x" * 501]}, "at most 500 characters"),
    ],
)
def test_what_cannot_be_is_refused_by_name_value_and_range(given, said):
    with pytest.raises(InputError) as refused:
        HandCalibration(**{"name": "anna", "side": "right", **given})
    assert said in str(refused.value)


def test_it_is_frozen_and_apart_from_what_it_was_made_of():
    tips = {"index": 0.008}
    made = HandCalibration(name="anna", side="right", tip_radius_m=tips)
    tips["index"] = 1.0
    assert made.tip_radius_m == {"index": 0.008}
    with pytest.raises(FrozenInstanceError):
        made.side = "left"


def test_plain_data_and_back():
    made = HandCalibration(
        name="anna",
        side="left",
        tip_radius_m={"index": 0.008},
        offset_m={"palm_outer": (0.0, -0.001, 0.0)},
        made_on=date(2026, 3, 31),
        notes=("one",),
    )
    table = made.table()
    assert table == {
        "side": "left",
        "tip_radius_m": {"index": 0.008},
        "offset_m": {"palm_outer": [0.0, -0.001, 0.0]},
        "made_on": "2026-03-31",
        "notes": ["one"],
    }
    assert HandCalibration.of_table("anna", table) == made
    with pytest.raises(InputError, match="made_on = 'soon' is no day"):
        HandCalibration.of_table("anna", {**table, "made_on": "soon"})


def test_another_persons_hand_is_noticed_by_its_bones():
    position_m = synthetic_hand().tracks[0].position_m
    bones = {  # of the shipped skeleton (mm): what its own page of numbers has
        "index_proximal": 0.0398,
        "index_intermediate": 0.0224,
        "middle_proximal": 0.0446,
        "ring_proximal": 0.0414,
        "little_proximal": 0.0327,
    }
    own = HandCalibration(name="anna", side="right", bone_m=bones)
    assert own.other_hand(position_m) is None
    assert own.other_hand(1.08 * position_m) is None
    assert str(own.other_hand(1.2 * position_m)).startswith(
        "the hand's bones are 20% longer than those of the calibration 'anna': "
    )
    assert "15% shorter" in str(own.other_hand(0.85 * position_m))
    gone = HandCalibration(name="anna", side="right", bone_m={"index_proximal": 0.0})  # made up by a tracker
    assert gone.other_hand(position_m) is None
    assert position_m.shape[1] == len(JOINT)
