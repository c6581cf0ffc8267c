"""The routine finds the hand that went through it, and says what is not right yet."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from jointed_hand import CLOSED, CURLED, FLAT, JointedHand, Tracker

from haptics.errors import InputError
from haptics.scene.calibration.estimate import tip_radii
from haptics.scene.calibration.from_recording import calibrate
from haptics.scene.calibration.routine import CalibrationRoutine
from haptics.scene.hands.frame import HandFrame, mirrored
from haptics.scene.hands.joints import FINGERS, JOINT

HANDS = (
    JointedHand("right", 1.0, dict(zip(FINGERS, (9.0, 8.0, 8.2, 7.6, 6.8), strict=True))),
    JointedHand("left", 0.85, dict(zip(FINGERS, (7.5, 6.2, 6.3, 5.9, 5.2), strict=True))),
    JointedHand("right", 1.15, dict.fromkeys(FINGERS, 8.5)),
)


def shown(routine: CalibrationRoutine, frames: Iterable[HandFrame]) -> CalibrationRoutine:
    for frame in frames:
        routine.submit(frame)
    return routine


def after(hand: JointedHand, *poses: str, noise_m: float = 1e-3) -> tuple[CalibrationRoutine, Tracker]:
    """A routine that has taken these poses."""
    routine, tracker = CalibrationRoutine(hand.side), Tracker(hand, noise_m=noise_m)
    for pose in poses:
        shown(routine, tracker.goes_to(hand.poses()[pose]))
    return routine, tracker


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("hand", HANDS, ids=lambda hand: f"{hand.side}-{hand.scale}")
def test_a_hand_that_goes_through_the_poses_is_found_within_the_stated_uncertainty(hand, seed):
    routine, tracker = CalibrationRoutine(hand.side), Tracker(hand, seed)
    for joints_m in hand.poses().values():
        shown(routine, tracker.goes_to(joints_m))
    found = routine.result("anna", date(2026, 3, 31), "a test")
    assert (found.side, found.made_on, found.made_from, found.notes) == (hand.side, date(2026, 3, 31), "a test", ())
    assert len(found.bone_m) == 19
    for bone, length_m in found.bone_m.items():
        sd_m = found.bone_sd_m[bone]
        assert sd_m == pytest.approx(2**0.5 * 1e-3, rel=0.2)  # of two ends with 1 mm each
        assert abs(length_m - 1e-3 * hand.length_mm(bone)) < 0.25 * sd_m, bone
    for finger in FINGERS:
        error_m = found.tip_radius_m[finger] - 1e-3 * hand.tip_mm[finger]
        assert abs(error_m) < found.tip_radius_sd_m[finger] < 1.5e-3, finger
    for finger in FINGERS[1:]:
        both_m = found.tip_radius_m["thumb"] + found.tip_radius_m[finger]
        assert both_m == pytest.approx(1e-3 * (hand.tip_mm["thumb"] + hand.tip_mm[finger]), abs=0.5e-3)


def test_pads_lie_as_much_deeper_as_the_hand_is_broader():
    hand = JointedHand(scale=1.2)
    routine, _ = after(hand, *hand.poses(), noise_m=0.0)
    found = routine.result("anna")
    assert found.breadth_m == pytest.approx(
        1.2 * 0.0614, abs=5e-5
    )  # knuckles (-24, 2, -34) and (36, -3, -22) mm, and their scale
    assert found.offset_m["index_phalanx"] == pytest.approx((0.0, -0.2 * 0.008, 0.0), abs=2e-5)
    assert found.offset_m["palm_outer"] == pytest.approx((0.0, -0.2 * 0.012, 0.0), abs=2e-5)
    assert not [site for site in found.offset_m if site.endswith("_tip")]


def test_radii_are_the_least_squares_of_touches_and_guess_by_hand():
    """Tips 2 mm farther apart than nominal; standard deviations of 1.5 mm in the guess, of all and of each, and 1 mm of a touch.

    The thumb t and a finger f minimise 4 (t + f - 2)² + (t² + 4 f² - (t + 4 f)² / 6) / 1.5²: 108/193 and 81/193 of the 2 mm.
    """
    touch_m = {finger: np.tile([0.0, 0.016, 0.0], (5, 1)) for finger in FINGERS[1:]}
    radius_m, sd_m = tip_radii(touch_m)
    assert radius_m == pytest.approx([0.007 + 0.002 * 108 / 193, *[0.007 + 0.002 * 81 / 193] * 4], abs=1e-12)
    nominal_m, _ = tip_radii({finger: np.tile([0.014, 0.0, 0.0], (5, 1)) for finger in FINGERS[1:]})
    assert nominal_m == pytest.approx([0.007] * 5, abs=1e-15)
    assert (sd_m < np.hypot(1.5e-3, 1.5e-3)).all()  # every touch adds to what was guessed


def test_noise_does_not_make_fingertips_larger():
    rng = np.random.default_rng(4)
    noisy = {f: np.array([0.014, 0.0, 0.0]) + 4e-3 * rng.standard_normal((400, 3)) for f in FINGERS[1:]}
    assert tip_radii(noisy)[0] == pytest.approx([0.007] * 5, abs=0.3e-3)  # the mean length would be 2 mm more


def test_steps_are_said_one_after_another_and_progress_grows():
    hand = JointedHand()
    routine, tracker = CalibrationRoutine("right"), Tracker(hand)
    assert (routine.step.pose, routine.step.progress, routine.step.waiting_for) == ("flat", 0.0, "no pose has come yet")
    for number, (name, joints_m) in enumerate(hand.poses().items()):
        assert routine.step.pose == name
        assert routine.step.instruction.endswith("still.")
        assert not routine.done
        shown(routine, tracker.goes_to(joints_m, hold_s=0.4, move_s=0.2))
        assert number / 6 < routine.step.progress < (number + 1) / 6
        assert routine.step.waiting_for == ""
        shown(routine, tracker.goes_to(joints_m, hold_s=1.0, move_s=0.1))
    assert routine.done
    assert (routine.step.pose, routine.step.progress, routine.step.waiting_for) == ("done", 1.0, "")
    before = routine.result("anna")
    shown(routine, tracker.goes_to(hand.poses()["fist"]))
    assert routine.result("anna") == before


def test_a_hand_that_drifts_is_not_still():
    hand = JointedHand()
    routine, tracker = CalibrationRoutine("right"), Tracker(hand, noise_m=0.0)
    for step in range(120):
        routine.submit(tracker.frame(hand.poses()["flat"] + [0.0, 1e-3 * step / 4, 0.0]))
    assert routine.step.waiting_for == "the hand moves; keep it still"
    assert (routine.step.pose, routine.step.progress) == ("flat", 0.0)
    shown(routine, tracker.goes_to(hand.poses()["flat"] + [0.0, 0.03, 0.0]))
    assert routine.step.pose == "fist"


@pytest.mark.parametrize(
    ("taken", "bends", "touches", "said"),
    [
        ((), {"ring": CURLED}, None, r"the ring finger is stretched to \d\d%: it is not flat; expected 92% or more"),
        (("flat",), {f: CLOSED for f in ("middle", "ring", "little")}, None, r"the index finger .* not in a fist; expected 65%"),
        (("flat", "fist"), {}, None, "the thumb is nearer to|thumb and index finger do not touch"),
        (("flat", "fist"), {"middle": CURLED}, "middle", "the thumb is nearer to the middle finger than to the index finger"),
    ],
)
def test_a_pose_that_is_another_is_said_to_be(taken, bends, touches, said):
    hand = JointedHand()
    routine, tracker = after(hand, *taken)
    step = routine.step.pose
    shown(routine, tracker.goes_to(hand.pose_m({**dict.fromkeys(FINGERS[1:], FLAT), **bends}, touches)))
    assert routine.step.pose == step
    with pytest.raises(InputError, match=said):
        routine.result("anna")


@pytest.mark.parametrize(("apart_mm", "said"), [(30.0, "do not touch: their tips are 30 mm apart"), (4.0, "4.0 mm apart, less")])
def test_tips_that_cannot_be_touching_do_not_count(apart_mm, said):
    far = JointedHand(tip_mm=dict.fromkeys(FINGERS, apart_mm / 2.0))
    routine, tracker = after(far, "flat", "fist", noise_m=0.0)
    shown(routine, tracker.goes_to(far.poses()["thumb_to_index"]))
    assert said in routine.step.waiting_for


def test_the_other_hand_is_passed_by_and_a_mislabelled_one_found_out():
    right, left = JointedHand(), JointedHand("left")
    routine = shown(CalibrationRoutine("right"), Tracker(left).goes_to(left.poses()["flat"]))
    assert routine.step.waiting_for == "this is the left hand; show the right one"
    frames = Tracker(right).goes_to(right.poses()["flat"])
    both = [hand for frame in frames for hand in (frame, replace(mirrored(frame), time_ns=frame.time_ns))]
    assert shown(CalibrationRoutine("right"), both).step.pose == "fist"  # interleaved, as trackers give them
    wrong = (replace(frame, side="right") for frame in Tracker(left).goes_to(left.poses()["flat"]))
    assert "labelled right looks like a left one" in shown(CalibrationRoutine("right"), wrong).step.waiting_for


def test_a_hand_that_the_tracker_loses_begins_the_pose_anew():
    hand = JointedHand()
    flat = hand.poses()["flat"]
    routine, tracker = CalibrationRoutine("right"), Tracker(hand)
    shown(routine, (tracker.frame(flat) for _ in range(40)))
    routine.hand_gone()
    assert (routine.step.progress, routine.step.waiting_for) == (0.0, "the tracker has lost the hand")
    shown(routine, (tracker.frame(flat) for _ in range(40)))  # 0.7 s and 0.7 s are not 0.8 s
    assert routine.step.pose == "flat"
    lost = [replace(tracker.frame(flat), valid=False) for _ in range(30)]
    shown(routine, lost[:1])
    assert "marks the pose as not valid" in routine.step.waiting_for
    shown(routine, lost)
    shown(routine, (tracker.frame(flat) for _ in range(40)))
    assert routine.step.pose == "flat"


def test_poses_that_contradict_each_other_are_flagged():
    hand = JointedHand()
    routine, tracker = CalibrationRoutine("right"), Tracker(hand, noise_m=0.2e-3)
    for name, joints_m in hand.poses().items():
        if name == "fist":  # a tracker that guesses what it does not see
            joints_m[JOINT["middle_tip"]] += 0.25 * (joints_m[JOINT["middle_tip"]] - joints_m[JOINT["middle_distal"]])
        shown(routine, tracker.goes_to(joints_m))
    (note,) = routine.result("anna").notes
    assert re.search(r"the bone middle_distal is 1[67]\.\d mm in thumb_to_\w+ and 21\.\d mm in fist; 1 of 19 bones change", note)


@pytest.mark.parametrize(
    "spoilt",
    [
        {"position_m": np.full((26, 3), np.nan)},
        {"position_m": np.full((26, 3), 1e300)},
        {"position_m": np.zeros((26, 3))},
        {"position_m": np.zeros((25, 3))},
        {"position_m": "joints"},
        {"orientation_xyzw": np.zeros((26, 4))},
        {"time_ns": -(2**70)},
        {"time_ns": None},
        {"side": np.array(["left", "right"])},
        {"side": 3},
        {"track_id": "one"},
    ],
    ids=lambda spoilt: next(iter(spoilt)),
)
def test_a_frame_that_is_none_is_passed_by_and_named(spoilt):
    hand = JointedHand()
    routine, tracker = CalibrationRoutine("right"), Tracker(hand)
    shown(routine, (tracker.frame(hand.poses()["flat"]) for _ in range(20)))
    routine.submit(replace(tracker.frame(hand.poses()["flat"]), **spoilt))
    assert routine.step.waiting_for.startswith("the tracker's pose cannot be used: ")
    shown(routine, (tracker.frame(hand.poses()["flat"]) for _ in range(40)))
    assert routine.step.pose == "fist"  # one bad frame costs nothing


def test_what_is_no_frame_side_or_name_is_refused():
    routine = CalibrationRoutine("left")
    with pytest.raises(InputError, match="frame = None is of type NoneType; expected a HandFrame"):
        routine.submit(None)
    with pytest.raises(InputError, match="side = 'both' is not allowed; allowed: left, right"):
        CalibrationRoutine("both")
    with pytest.raises(InputError, match=r"flat, fist, .*thumb_to_little of 6 poses are missing \(no pose has come yet\)"):
        routine.result("anna")
    with pytest.raises(InputError, match=r"name = '\.\./anna'"):
        routine.result("../anna")
    with pytest.raises(InputError, match=r"no argument 'hand'; known arguments: side"):
        CalibrationRoutine(hand="left")


def test_a_kilohertz_tracker_is_held_as_long_and_no_longer():
    hand = JointedHand()
    routine, tracker = CalibrationRoutine("right"), Tracker(hand, rate_hz=1000.0)
    flat = hand.poses()["flat"]
    shown(routine, (tracker.frame(flat) for _ in range(800)))
    assert routine.step.pose == "flat"
    shown(routine, (tracker.frame(flat) for _ in range(2)))
    assert routine.step.pose == "fist"


def test_the_motion_that_ships_gives_the_hand_that_it_was_made_of():
    """Bones after the table of the shipped skeleton, tips of 7 mm."""
    found = calibrate("anna", "routine")
    assert (found.side, found.notes) == ("right", ())
    assert [found.bone_m[f"index_{part}"] for part in ("proximal", "intermediate", "distal")] == pytest.approx(
        [0.0398, 0.0224, 0.0158], abs=5e-5
    )
    assert list(found.tip_radius_m.values()) == pytest.approx([0.007] * 5, abs=0.3e-3)
    assert max(abs(part) for offset in found.offset_m.values() for part in offset) < 2e-5


def test_a_recording_without_the_poses_says_which_is_missing():
    with pytest.raises(
        InputError, match=r"hand synthetic: the pose flat is missing \(0 of 6 poses of the routine were found\); at its end"
    ):
        calibrate("anna", "synthetic")
    with pytest.raises(InputError, match="no pose of the left hand"):
        calibrate("anna", "routine", "left")
    with pytest.raises(InputError, match="does not exist"):
        calibrate("anna", "nowhere.h5")


def test_the_stated_uncertainty_of_fingertips_covers_hands_as_they_are_guessed():
    """Hands drawn from the guess, touches off by 1 mm: errors in stated deviations have a mean square of one (sd 0.06)."""
    rng, ratios = np.random.default_rng(5), []
    for _ in range(500):
        true_m = 7e-3 + 1.5e-3 * rng.standard_normal() + 1.5e-3 * rng.standard_normal(5)
        apart_m = true_m[0] + true_m[1:] + 1e-3 * rng.standard_normal(4)
        radius_m, sd_m = tip_radii({f: np.tile([apart_m[n], 0.0, 0.0], (3, 1)) for n, f in enumerate(FINGERS[1:])})
        ratios.append((radius_m - true_m) / sd_m)
    assert np.square(ratios).mean(axis=0) == pytest.approx(np.ones(5), abs=0.2)
