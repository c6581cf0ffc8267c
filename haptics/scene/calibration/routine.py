"""The routine that calibrates a hand: a person goes through a few poses, each held still for a moment.

A state machine without a clock: poses in, what to do next out. Who shows it (a command, a script, a page), and where the poses
come from, is not its business.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import date

import numpy as np

from haptics.errors import InputError
from haptics.scene.calibration.estimate import bones, contradictions, tip_radii
from haptics.scene.calibration.hand_calibration import HandCalibration, check_name
from haptics.scene.calibration.measures import BONES, knuckle_breadth, thumb_to
from haptics.scene.calibration.poses import POSES
from haptics.scene.hands.frame import Floats, HandFrame
from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import FINGERS, SIDES, Side
from haptics.scene.hands.pose_gate import PoseGate
from haptics.scene.sites import SITES, nominal_sites
from haptics.time import NS_PER_MS
from haptics.units import an_instance, known_arguments, one_of

HOLD_NS = 800 * NS_PER_MS
"""So long a pose is held."""
FEWEST_FRAMES = 10
"""And at least so many frames of it are needed."""
APART_NS = 2 * NS_PER_MS
"""Frames that follow sooner add nothing, and are passed by: a pose is at most 400 of them."""
LOST_NS = 250 * NS_PER_MS
"""After a longer gap between poses the hand was lost, and the pose begins anew."""
STILL_M = 0.0015
"""A hand is still where no joint is farther than this, in the mean of the second half of the time, from that of the first
(assumed)."""
NOMINAL_BREADTH_M = 0.0614
"""Knuckles of index and little finger apart in the hand whose skin is nominally deep: the one that ships (assumed)."""
_DECIMALS = 5  # of metres: a hundredth of a millimetre, below what any tracker sees


@dataclass(frozen=True, slots=True)
class CalibrationStep:
    """Where the routine is.

    :param pose: what is waited for: ``flat``, ``fist``, ``thumb_to_index`` (``middle``, ``ring``, ``little``), or ``done``.
    :param instruction: what the person has to do now, in a sentence.
    :param progress: of the whole routine, 0 to 1.
    :param waiting_for: why the pose does not count yet, in words; empty while it is being held, and when all is done.
    """

    pose: str
    instruction: str
    progress: float
    waiting_for: str


class CalibrationRoutine:
    """Makes a calibration of a few seconds of poses: flat hand, fist, the thumb's tip on that of each finger.

    :param side: of the hand, ``left`` or ``right``.
    :raises InputError: another side.
    """

    @known_arguments
    def __init__(self, side: Side):
        self.side: Side = "left" if one_of("side", side, SIDES) == "left" else "right"
        self._gate = PoseGate()
        self._held: dict[str, Floats] = {}
        self._frames = deque[Floats]()
        self._times_ns = deque[int]()
        self._seen_ns: int | None = None
        self._why = "no pose has come yet"

    @property
    def done(self) -> bool:
        """Whether every pose was held."""
        return len(self._held) == len(POSES)

    @property
    def step(self) -> CalibrationStep:
        """What the person has to do now, how far the routine is, and what is not right yet."""
        if self.done:
            return CalibrationStep("done", "All poses are taken; you can move again.", 1.0, "")
        pose = POSES[len(self._held)]
        share = 0.0 if self._why else min(self._span_ns / HOLD_NS, 1.0)
        return CalibrationStep(pose.name, pose.instruction, (len(self._held) + share) / len(POSES), self._why)

    @property
    def _span_ns(self) -> int:
        return self._times_ns[-1] - self._times_ns[0] if self._times_ns else 0

    @known_arguments
    def submit(self, frame: HandFrame) -> None:
        """Hand in a pose. Poses of the other hand, and such as no hand can have, are passed by.

        :param frame: in the order of time, of either hand.
        :raises InputError: no ``HandFrame``.
        """
        an_instance("frame", frame, HandFrame, "such as HandFrame.from_joints makes")
        if self.done:
            return
        if isinstance(frame.side, str) and frame.side in SIDES and frame.side != self.side:
            if not self._frames:
                self._why = f"this is the {frame.side} hand; show the {self.side} one"
            return
        refusal = self._gate.judge(frame, frame.time_ns)
        if refusal is not None:
            self._why = f"the tracker's pose cannot be used: {refusal}"
            return
        if self._gate.starts_anew or (self._seen_ns is not None and frame.time_ns - self._seen_ns > LOST_NS):
            self._begin_anew()
        self._seen_ns = frame.time_ns
        pose = POSES[len(self._held)]
        wrong_hand = contradiction(self.side, apparent_side(frame.position_m, frame.orientation_xyzw))
        fault = wrong_hand or pose.fault(frame.position_m)
        if fault is not None:
            self._begin_anew()
            self._why = fault
            return
        if self._times_ns and frame.time_ns - self._times_ns[-1] < APART_NS:
            return
        self._hold(pose.name, frame)

    def _hold(self, pose: str, frame: HandFrame) -> None:
        self._frames.append(np.array(frame.position_m, float))
        self._times_ns.append(frame.time_ns)
        while len(self._times_ns) > 1 and frame.time_ns - self._times_ns[1] >= HOLD_NS:
            self._frames.popleft()
            self._times_ns.popleft()
        self._why = ""
        if self._span_ns < HOLD_NS or len(self._frames) < FEWEST_FRAMES:
            return
        held = np.array(self._frames)
        if _moved_m(held) > STILL_M:
            self._why = "the hand moves; keep it still"
            return
        self._held[pose] = held
        self._begin_anew()

    def hand_gone(self) -> None:
        """The tracker reports that it has lost the hand: the pose begins anew, those that were taken stay."""
        self._begin_anew()
        self._gate.forget()
        self._seen_ns = None
        self._why = "the tracker has lost the hand"

    def _begin_anew(self) -> None:
        self._frames.clear()
        self._times_ns.clear()
        self._why = ""

    @known_arguments
    def result(self, name: str, made_on: date | None = None, made_from: str = "") -> HandCalibration:
        """The calibration, when all poses were held.

        Bones are medians over all frames that were held. Fingertips follow from the touches (``estimate.tip_radii``). How deep
        the pads lie below the bones is not seen: the nominal depths are scaled by the hand's breadth (assumed).

        :param name: whose hand it is; the name of its file, see ``HandCalibration``.
        :param made_on: the day, or None.
        :param made_from: what hand it was made from, for people.
        :return: checked; poses that contradict each other are in its ``notes``.
        :raises InputError: poses are missing, or the hand is none that a calibration can be of.
        """
        check_name(name)
        if not self.done:
            step = self.step
            missing = ", ".join(pose.name for pose in POSES[len(self._held) :])
            why = f" ({step.waiting_for})" if step.waiting_for else ""
            raise InputError(f"the routine is not done: {missing} of {len(POSES)} poses are missing{why}")
        length_m, spread_m = bones(np.concatenate(list(self._held.values())))
        radius_m, sd_m = tip_radii({pose.finger: thumb_to(self._held[pose.name], pose.finger) for pose in POSES if pose.finger})
        breadth_m = float(np.median(knuckle_breadth(self._held["flat"])))
        return HandCalibration(
            name=name,
            side=self.side,
            tip_radius_m=_rounded(FINGERS, radius_m),
            tip_radius_sd_m=_rounded(FINGERS, sd_m),
            offset_m=_pads(breadth_m / NOMINAL_BREADTH_M),
            bone_m=_rounded(BONES, length_m),
            bone_sd_m=_rounded(BONES, spread_m),
            breadth_m=round(breadth_m, _DECIMALS),
            made_on=made_on,
            made_from=made_from,
            notes=tuple(contradictions(self._held)),
        )


def _moved_m(held_m: Floats) -> float:
    """How far the joint that moves most is in the second half of the frames from where it was in the first."""
    half = len(held_m) // 2
    return float(np.linalg.norm(held_m[half:].mean(axis=0) - held_m[:half].mean(axis=0), axis=-1).max())


def _pads(scale: float) -> dict[str, tuple[float, float, float]]:
    """Tactors on phalanges and palm moved as far from the bones as the skin of a hand of this scale is."""
    sites = nominal_sites()
    depth_m = sites.radius_m - sites.offset_m[:, 1]
    return {
        site: (0.0, round((1.0 - scale) * float(depth_m[index]), _DECIMALS) + 0.0, 0.0)
        for index, site in enumerate(SITES)
        if not site.endswith("_tip")
    }


def _rounded(names: tuple[str, ...], values_m: Floats) -> dict[str, float]:
    return dict(zip(names, np.round(values_m, _DECIMALS).tolist(), strict=True))
