"""A calibration of a recorded hand that went through the routine."""

from __future__ import annotations

from datetime import date
from os import PathLike

from haptics.errors import InputError
from haptics.scene.calibration.hand_calibration import HandCalibration, check_name
from haptics.scene.calibration.poses import POSES
from haptics.scene.calibration.routine import CalibrationRoutine
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.motion import judge_motion
from haptics.scene.hands.synthetic_routine import NAME as ROUTINE, synthetic_routine


def calibrate(name: str, hand: str | PathLike[str], side: str = "auto", made_on: date | None = None) -> HandCalibration:
    """Play a recorded hand through the routine.

    :param name: whose hand it is; see ``HandCalibration``.
    :param hand: a recording's file, or ``routine`` for the motion that ships.
    :param side: ``left``, ``right``, or ``auto``: the hand seen most.
    :param made_on: the day, or None.
    :return: the calibration; not saved yet.
    :raises InputError: no such file or hand, or one that does not go through all poses; with the pose and what was wrong.
    """
    check_name(name)
    recording = synthetic_routine() if hand == ROUTINE else load_hand(hand)
    motion = judge_motion(recording, side, str(hand))
    routine = CalibrationRoutine("left" if motion.side == "left" else "right")
    for frame in motion.frames:
        routine.submit(frame)
    step = routine.step
    if not routine.done:
        why = step.waiting_for or "it ends while that pose is held"
        taken = [pose.name for pose in POSES].index(step.pose)
        raise InputError(
            f"hand {hand}: the pose {step.pose} is missing ({taken} of {len(POSES)} poses of the routine were found); "
            f"at its end {why}"
        )
    return routine.result(name, made_on, str(recording.source))
