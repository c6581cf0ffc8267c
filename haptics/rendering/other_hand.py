"""The hand that wears no glove: it grasps and carries objects of the scene, and drives nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from haptics.rendering.events import LoopEvent
from haptics.rendering.grasping import Grasping
from haptics.rendering.world import World
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.pose_gate import FORGOTTEN_NS, PoseGate
from haptics.scene.sites import SiteMap


class OtherHand:
    """Follows a hand without devices.

    :param world: where objects are; those that this hand carries are moved there.
    :param sites: where the hand's sites are.
    :param report: takes each grasp as it begins and ends, with the hand's side as its subject.
    """

    def __init__(self, world: World, sites: SiteMap, report: Callable[[LoopEvent], None]):
        self._world, self._sites, self._tell = world, sites, report
        self._gate = PoseGate()
        self._heard_ns = 0
        self.frame: HandFrame | None = None
        """Its last pose that was taken; None while it is not there."""
        self.change()

    @property
    def held(self) -> str | None:
        """The object in this hand."""
        return self._grasps.held

    def change(self) -> None:
        """The world has another scene."""
        self._grasps = Grasping(self._world, None, 0.0, 0, 0, self._report)

    def submit(self, frame: HandFrame, now_ns: int) -> str | None:
        """Take a pose that has arrived.

        :param frame: of the side without a glove.
        :param now_ns: when it arrived.
        :return: why it was refused, or None if it was taken.
        """
        reason = self._gate.judge(frame, now_ns)
        if reason is not None:
            return reason
        if self._gate.starts_anew:
            self._grasps.let_go(now_ns, quiet=True)
        self.frame, self._heard_ns = frame, now_ns
        if self._grasps.names:
            positions = self._sites.positions(frame.position_m, frame.orientation_xyzw)
            self._grasps.observe(frame.time_ns, positions, now_ns, quiet=True)
        return None

    def tick(self, now_ns: int) -> None:
        """Notice that no pose comes any more.

        :param now_ns: the tick's time.
        """
        if self.frame is not None and now_ns - self._heard_ns > FORGOTTEN_NS:
            self.gone(now_ns)

    def gone(self, now_ns: int) -> None:
        """It is no longer there: what it held stays where it is.

        :param now_ns: when that was known.
        """
        self._grasps.let_go(now_ns, quiet=True)
        self._gate.forget()
        self.frame = None

    def _report(self, event: LoopEvent) -> None:
        self._tell(replace(event, subject="" if self.frame is None else self.frame.side))
