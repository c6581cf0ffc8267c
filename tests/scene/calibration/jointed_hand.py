"""A hand of rigid bones, posed by angles: its lengths and fingertips are known, and what is found can be held against them.

It shares nothing with the code under test but the names and the order of the joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import FINGERS, JOINT, Side

# A right hand in its palm's axes, mm: x to the little finger, y out of the back, z to the wrist.
BASES = {"thumb": (-22, -6, 32), "index": (-12, 0, 30), "middle": (-2, 2, 29), "ring": (8, 1, 29), "little": (17, -1, 30)}
KNUCKLES = {"index": (-24, 2, -34), "middle": (-2, 4, -36), "ring": (18, 2, -30), "little": (36, -3, -22)}
BONES = {"thumb": (46, 32, 22), "index": (40, 22, 16), "middle": (45, 26, 17), "ring": (41, 26, 17), "little": (33, 18, 16)}
FLAT, CURLED, CLOSED = (3, 5, 4), (60, 55, 30), (80, 95, 50)
"""Bends of the three outer joints of a finger, degrees."""


@dataclass(frozen=True)
class JointedHand:
    """One person's hand: how large, with which fingertips, and which bones are unlike the others."""

    side: Side = "right"
    scale: float = 1.0
    tip_mm: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(FINGERS, 7.0))

    def bones_mm(self, finger: str) -> np.ndarray:
        return self.scale * np.array(BONES[finger], float)

    def length_mm(self, bone: str) -> float:
        finger, _, part = bone.partition("_")
        if finger == "thumb":
            return float(self.bones_mm(finger)[("metacarpal", "proximal", "distal").index(part)])
        if part == "metacarpal":
            return self.scale * float(np.linalg.norm(np.subtract(KNUCKLES[finger], BASES[finger])))
        return float(self.bones_mm(finger)[("proximal", "intermediate", "distal").index(part)])

    def pose_m(self, bends: Mapping[str, tuple[float, float, float]], touches: str | None = None) -> np.ndarray:
        """Joints (26, 3), m, in the palm's axes; the thumb's tip touches a finger's, or the thumb lies beside the palm."""
        mm = np.zeros((26, 3))
        mm[JOINT["wrist"]] = self.scale * np.array([0.0, 0.0, 50.0])
        for finger in FINGERS[1:]:
            first = JOINT[f"{finger}_metacarpal"]
            mm[first], mm[first + 1] = self.scale * np.array(BASES[finger]), self.scale * np.array(KNUCKLES[finger])
            for joint, (length, bend) in enumerate(zip(self.bones_mm(finger), np.cumsum(bends[finger]), strict=True)):
                along = Rotation.from_euler("x", -bend, degrees=True).apply([0.0, 0.0, -1.0])
                mm[first + 2 + joint] = mm[first + 1 + joint] + length * along
        first = JOINT["thumb_metacarpal"]
        mm[first] = self.scale * np.array(BASES["thumb"])
        one, two, three = self.bones_mm("thumb")
        if touches is None:
            mm[first + 1 : first + 4] = mm[first] + np.outer([one, one + two, one + two + three], [-0.6, 0.0, -0.8])
        else:
            tip = mm[JOINT[f"{touches}_tip"]]
            back = mm[first] - tip
            target = tip + (self.tip_mm["thumb"] + self.tip_mm[touches]) * back / np.linalg.norm(back)
            reach, rest = target - mm[first], two + three
            far = np.linalg.norm(reach)
            assert abs(one - rest) < far < one + rest, (touches, far)
            ahead = reach / far  # the two outer bones in line: a triangle of known sides
            aside = np.cross(ahead, [0.0, 1.0, 0.0])
            aside /= np.linalg.norm(aside)
            share = (one**2 + far**2 - rest**2) / (2.0 * far)
            mm[first + 1] = mm[first] + share * ahead - np.sqrt(one**2 - share**2) * aside
            outer = (target - mm[first + 1]) / rest
            mm[first + 2], mm[first + 3] = mm[first + 1] + two * outer, mm[first + 1] + rest * outer
        return 1e-3 * mm * ((1.0, 1.0, 1.0) if self.side == "right" else (-1.0, 1.0, 1.0))

    def poses(self) -> dict[str, np.ndarray]:
        """The six poses of the routine."""
        flat = dict.fromkeys(FINGERS[1:], FLAT)
        poses = {"flat": self.pose_m(flat), "fist": self.pose_m(dict.fromkeys(FINGERS[1:], CLOSED))}
        return poses | {f"thumb_to_{f}": self.pose_m({**flat, f: CURLED}, f) for f in FINGERS[1:]}


@dataclass
class Tracker:
    """Frames of a hand somewhere in a room, turned somehow, with noise; it goes from pose to pose at a person's speed."""

    hand: JointedHand
    seed: int = 0
    noise_m: float = 1e-3
    rate_hz: float = 60.0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._turn = Rotation.random(rng=self._rng)
        self._place_m = self._rng.uniform(-0.5, 0.5, 3)
        self._time_ns = 1_000_000_000
        self._last_m: np.ndarray | None = None

    def goes_to(self, joints_m: np.ndarray, hold_s: float = 1.2, move_s: float = 0.4) -> Iterator[HandFrame]:
        last_m = joints_m if self._last_m is None else self._last_m
        for time_s in np.arange(0.0, move_s + hold_s, 1.0 / self.rate_hz):
            share = min(1.0, time_s / move_s)
            yield self.frame(last_m + share * (joints_m - last_m))
        self._last_m = joints_m

    def frame(self, joints_m: np.ndarray) -> HandFrame:
        self._time_ns += round(1e9 / self.rate_hz)
        position_m = self._place_m + self._turn.apply(joints_m) + self.noise_m * self._rng.standard_normal((26, 3))
        return HandFrame(self._time_ns, self.hand.side, 1, position_m, np.tile(self._turn.as_quat(), (26, 1)))
