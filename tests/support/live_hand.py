"""A hand before a session in virtual time: its poses sampled, delayed, lost, reordered and stamped as trackers and engines do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.frame import HandFrame
from haptics.scene.sites import SITES
from haptics.session.session import Session
from haptics.time import NS_PER_MS, NS_PER_S


class Arrival(NamedTuple):
    """A pose and when it arrives, on one clock."""

    arrives_ns: int
    frame: HandFrame


@dataclass(frozen=True)
class Line:
    """How poses come.

    :param rate_hz: of sampling.
    :param jitter_ms: sampling moments are off by up to so much, and the way takes up to so much longer.
    :param latency_ms: of the way, at least.
    :param loss: share of poses that never come.
    :param stamped: ``sampling`` or ``sending``: what a pose's time is.
    """

    rate_hz: float
    jitter_ms: float = 1.0
    latency_ms: float = 6.0
    loss: float = 0.02
    stamped: str = "sampling"


class Motion:
    """A track as a smooth motion that can be looked at whenever one wants."""

    def __init__(self, frames: Sequence[HandFrame]):
        self._like = frames[0]
        at_s = np.array([frame.time_ns for frame in frames]) / NS_PER_S
        self.first_ns, self.last_ns = frames[0].time_ns, frames[-1].time_ns
        self._position = CubicSpline(at_s, np.stack([frame.position_m for frame in frames]))
        turns = np.stack([frame.orientation_xyzw for frame in frames])
        self._turns = [Slerp(at_s, Rotation.from_quat(turns[:, joint])) for joint in range(turns.shape[1])]

    def at(self, time_ns: int) -> HandFrame:
        """The hand at a moment within the track."""
        time_s = time_ns / NS_PER_S
        turns = np.stack([turn(time_s).as_quat() for turn in self._turns])
        return replace(self._like, time_ns=time_ns, position_m=self._position(time_s), orientation_xyzw=turns)

    def arrivals(self, line: Line, seed: int) -> list[Arrival]:
        """Poses in the order in which they arrive, late ones after newer ones."""
        rng = np.random.default_rng(seed)
        spacing_ns, jitter_ns = NS_PER_S / line.rate_hz, line.jitter_ms * NS_PER_MS
        found = []
        for number in range(int((self.last_ns - self.first_ns) / spacing_ns)):
            off_ns = rng.uniform(-0.4, 0.4) * min(jitter_ns, spacing_ns)
            sampled_ns = min(max(self.first_ns + round(number * spacing_ns + off_ns), self.first_ns), self.last_ns)
            sent_ns = sampled_ns + round(rng.uniform(0.0, jitter_ns))
            arrives_ns = sent_ns + round(line.latency_ms * NS_PER_MS + rng.uniform(0.0, jitter_ns))
            frame = self.at(sampled_ns)
            if line.stamped == "sending":
                frame = replace(frame, time_ns=sent_ns)
            if rng.random() >= line.loss:
                found.append(Arrival(arrives_ns, frame))
        return sorted(found, key=lambda one: one.arrives_ns)


def shifted(arrivals: Sequence[Arrival], by_ns: int) -> Iterator[Arrival]:
    """The same later."""
    for arrival in arrivals:
        yield Arrival(arrival.arrives_ns + by_ns, replace(arrival.frame, time_ns=arrival.frame.time_ns + by_ns))


class Live:
    """A hand before one session on a glove in virtual time, as a program that hands in poses.

    :param session: begun, on an armed glove.
    """

    def __init__(self, session: Session, side: str = "right"):
        self.session = session
        self._frame = next(iter(load_hand("synthetic").frames("right")))
        if side == "left":
            self._frame = mirrored(self._frame)
        self.at_m = np.zeros(3)

    @property
    def now_ns(self) -> int:
        return self.session.devices.now_ns()

    def tip_m(self, site: str = "index_tip") -> np.ndarray:
        """Where a site is with the hand where it began."""
        positions = self.session.loop.sites.positions(self._frame.position_m, self._frame.orientation_xyzw)
        return positions[SITES.index(site)]

    def wait(self, seconds: float) -> None:
        """No pose comes."""
        end_ns = self.now_ns + round(seconds * NS_PER_S)
        while self.now_ns < end_ns:
            self.session.tick(self.now_ns + NS_PER_MS)

    def show(self, frame: HandFrame) -> str | None:
        """A pose of now."""
        return self.session.submit(replace(frame, time_ns=self.now_ns))

    def move(self, to_m: Sequence[float], seconds: float) -> None:
        """The open hand goes straight to a place, told from where it began, and is seen at 125 Hz on the way."""
        from_m, steps = self.at_m, round(seconds * 125)
        for step in range(1, steps + 1):
            self.wait(0.008)
            self.at_m = from_m + (np.asarray(to_m, float) - from_m) * step / steps
            self.seen()

    def seen(self) -> None:
        """A pose where it is."""
        refused = self.show(replace(self._frame, position_m=self._frame.position_m + self.at_m))
        assert refused is None, refused

    def stay(self, seconds: float) -> None:
        """It is seen where it is."""
        self.move(self.at_m, seconds)

    def play(self, frames: Sequence[HandFrame]) -> None:
        """A recorded motion, as it comes 5 ms late."""
        start_ns = self.now_ns + NS_PER_MS - frames[0].time_ns  # not at the moment of the last pose that was shown
        for frame in frames:
            self.wait(max(0.0, (start_ns + frame.time_ns + 5 * NS_PER_MS - self.now_ns) / NS_PER_S))
            refused = self.session.submit(replace(frame, time_ns=start_ns + frame.time_ns))
            assert refused is None, refused


def mirrored(frame: HandFrame) -> HandFrame:
    """The other hand, at x = 0 on the other side."""
    turned = frame.orientation_xyzw * (1.0, -1.0, -1.0, 1.0)
    return replace(frame, side="left", position_m=frame.position_m * (-1.0, 1.0, 1.0), orientation_xyzw=turned)


def told(session: Session, *kinds: str) -> list[tuple[str, str, str]]:
    """Kind, subject and object of the events of some kinds, in order."""
    return [(event.kind, event.subject, event.object) for event in session.events if event.kind in kinds]
