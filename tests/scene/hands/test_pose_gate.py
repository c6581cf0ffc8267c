"""Poses one after another: what is refused, and that nothing refused or wrongly accepted shuts out what follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import JOINT
from haptics.scene.hands.pose_gate import PoseGate

MS = 1_000_000
HAND = next(load_hand("synthetic").frames("right"))


def pose(ms: float, shift_m: float = 0.0, track_id: int = 0, side: str = "right") -> HandFrame:
    position = HAND.position_m + np.array([shift_m, 0.0, 0.0])
    return HandFrame(round(ms * MS), side, track_id, position, HAND.orientation_xyzw)


def verdicts(*poses: HandFrame, side: str | None = None) -> list[bool]:
    gate = PoseGate(side)
    return [gate.judge(one, one.time_ns + 10 * MS) is None for one in poses]


def test_one_pose_out_of_place_is_refused_and_no_other():
    assert verdicts(pose(0), pose(9), pose(18, 0.3), pose(27), pose(36)) == [True, True, False, True, True]


def test_a_first_pose_out_of_place_yields_to_the_next_two():
    gate = PoseGate()
    found = [gate.judge(one) for one in (pose(0, 3.0), pose(9), pose(18))]
    assert [reason is None for reason in found] == [True, False, True]
    assert gate.starts_anew
    assert gate.overturned is not None
    assert gate.overturned.time_ns == 0
    assert all(gate.judge(pose(27 + 9 * i)) is None and not gate.starts_anew for i in range(50))


def test_a_pose_out_of_place_after_a_gap_yields_as_well():
    """Over 90 ms a joint may move 0.45 m, so the pose is taken; the next ones go with those before the gap and not with it."""
    assert verdicts(pose(0), pose(9), pose(99, 0.4), pose(108), pose(117), pose(126)) == [True, True, True, False, True, True]


def test_a_hand_that_is_elsewhere_all_at_once_is_refused_until_it_could_be_there():
    found = verdicts(pose(0), pose(9), *(pose(18 + 9 * i, 0.5) for i in range(20)))
    assert found[2:] == sorted(found[2:])
    first = 2 + found[2:].index(True)
    assert 0.5 / ((18 + 9 * (first - 2) - 0) * 1e-3) <= 5.0  # 5 m/s from the earlier of the two that were there


def test_two_wrong_poses_that_disagree_do_not_speak_for_each_other():
    assert verdicts(pose(0), pose(9, 1.0), pose(18, -1.0), pose(27, 0.0)) == [True, False, False, True]


def test_a_pose_from_the_future_is_refused_and_shuts_out_nothing():
    gate = PoseGate()
    assert gate.judge(pose(0), 10 * MS) is None
    assert "clock: its time lies 3600 s ahead of its arrival, more than 0.05 s" in str(gate.judge(pose(3_600_019), 19 * MS))
    assert "lies 0.051 s ahead" in str(gate.judge(pose(70), 19 * MS))
    assert gate.judge(pose(18), 28 * MS) is None
    assert gate.judge(pose(77), 28 * MS) is None  # predicted for display, 49 ms ahead


def test_a_pose_that_is_too_old_to_show_anything_is_refused_with_the_clock_for_a_reason():
    gate = PoseGate()
    assert gate.judge(pose(0), 250 * MS) is None
    assert "clock: its time lies 2.7 s behind its arrival, more than 0.25 s" in str(gate.judge(pose(9), 2709 * MS))


def test_poses_stamped_when_they_were_sent_may_bunch_up_and_one_that_jumps_may_not():
    """Sampled at 1 kHz from a hand at 2 m/s, stamped up to 0.9 ms early or late."""
    rng = np.random.default_rng(1)
    gate, last_ms = PoseGate(), -1.0
    for ms in range(300):
        last_ms = max(ms + rng.uniform(-0.9, 0.9), last_ms + 1e-3)
        assert gate.judge(pose(last_ms, 2e-3 * ms), round(last_ms * MS)) is None
    assert "jumped" in str(gate.judge(pose(last_ms + 0.1, 2e-3 * 300 + 0.03), round((last_ms + 0.1) * MS)))


def test_a_first_pose_from_the_future_is_refused_too():
    gate = PoseGate()
    assert gate.judge(pose(10_000), 0) is not None
    assert gate.judge(pose(0), 0) is None


def test_of_two_hands_the_first_is_followed_until_it_is_gone():
    both = [pose(0), pose(1, 0.3, 1, "left"), pose(9), pose(10, 0.3, 1, "left"), pose(111, 0.3, 1, "left"), pose(112)]
    assert verdicts(*both) == [True, False, True, False, True, False]
    gate = PoseGate()
    gate.judge(pose(0))
    gate.forget()
    assert gate.judge(pose(1, side="left")) is None


def test_the_hand_that_wears_the_glove_is_the_only_one():
    assert verdicts(pose(0), pose(1, side="left"), pose(500), side="left") == [False, True, False]


def test_another_track_starts_anew_and_the_same_does_not():
    gate = PoseGate()
    for one, anew in ((pose(0), False), (pose(9), False), (pose(18, 2.0, 1), True), (pose(27, 2.0, 1), False)):
        assert gate.judge(one) is None
        assert gate.starts_anew == anew


@pytest.mark.parametrize("frame", [None, {}, [1, 2], "pose", 3.0, object(), HandFrame])
def test_what_is_no_frame_at_all_is_an_error(frame):
    with pytest.raises(InputError, match=r"frame is .*; expected a HandFrame"):
        PoseGate().judge(frame)


WRONG = [
    ({"time_ns": None}, "time_ns is null"),
    ({"time_ns": 0.5}, "time_ns is 0.5"),
    ({"time_ns": float("nan")}, "time_ns is nan"),
    ({"time_ns": True}, "time_ns is True"),
    ({"time_ns": 2**70}, "time_ns is an integer of 71 bits"),
    ({"track_id": "7"}, "track_id is '7'"),
    ({"track_id": 2**40}, "track_id is 1099511627776"),
    ({"side": "Right"}, "side is 'Right'; allowed: left, right"),
    ({"side": None}, "side is null"),
    ({"side": ["left"]}, "side is a list of 1"),
    ({"valid": None}, "valid is null"),
    ({"valid": False}, "marks the pose as not valid"),
    ({"position_m": None}, "position_m is null; expected an array (26, 3) of numbers"),
    ({"position_m": [[0.0] * 3] * 26}, "position_m is a list of 26"),
    ({"position_m": np.full((26, 3), None)}, "position_m is an array (26, 3) of object"),
    ({"position_m": np.full((26, 3), "1")}, "position_m is an array (26, 3) of <U1"),
    ({"position_m": np.zeros((26, 3), complex)}, "position_m is an array (26, 3) of complex128"),
    ({"position_m": np.zeros((25, 3))}, "shapes (25, 3) and (26, 4)"),
    ({"position_m": np.zeros(())}, "shapes ()"),
    ({"position_m": np.zeros((26, 3))}, "the joints are in one point: all lie within 0 mm of the palm at 0, 0, 0 m"),
    ({"position_m": HAND.position_m * 100.0}, "10 m"),
    ({"position_m": HAND.position_m * 5.0}, "m from the palm; must be at most 0.5 m; is the unit metres?"),
    ({"position_m": HAND.position_m * 0.1}, "the joints are in one point"),
    ({"orientation_xyzw": None}, "orientation_xyzw is null"),
    ({"orientation_xyzw": np.zeros((26, 3))}, "shapes (26, 3) and (26, 3)"),
    ({"orientation_xyzw": np.zeros((26, 4))}, "the quaternion of palm has norm 0"),
    (
        {"orientation_xyzw": np.tile([0.0, 0.0, 0.0, 90.0], (26, 1))},
        "the quaternion of palm has norm 90, the worst of 26 such joints of 26; expected 1 within 0.01",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "words"), WRONG)
def test_a_frame_with_wrong_fields_is_refused_by_name_and_shuts_out_nothing(fields, words):
    gate = PoseGate()
    assert gate.judge(pose(0)) is None
    assert words in str(gate.judge(replace(pose(9), **fields)))
    assert gate.judge(pose(18)) is None


@pytest.mark.parametrize("joint", ["palm", "index_tip", "little_metacarpal"])
@pytest.mark.parametrize(("field", "number"), [("position_m", np.nan), ("position_m", np.inf), ("orientation_xyzw", np.nan)])
def test_a_number_that_is_none_is_named_with_its_joint(joint, field, number):
    array = getattr(HAND, field).copy()
    array[JOINT[joint], 1] = number
    assert f"of {joint} is not finite" in str(PoseGate().judge(replace(pose(0), **{field: array})))


FIELD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=3),
    st.lists(st.integers(), max_size=3),
    st.sampled_from([np.zeros((26, 3)), np.zeros((26, 4)), np.full((26, 3), np.nan), np.zeros(3, int), np.array("x")]),
)


@given(st.dictionaries(st.sampled_from([field for field in HandFrame.__slots__ if field != "radius_m"]), FIELD, max_size=4))
def test_nothing_in_a_frame_raises(fields):
    gate = PoseGate()
    gate.judge(pose(0))
    gate.judge(replace(pose(9), **fields), 20 * MS)
    assert gate.judge(pose(40), 50 * MS) is None or isinstance(fields.get("time_ns"), int) or "track_id" in fields
