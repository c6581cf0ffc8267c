"""Which poses may move things: each is checked against the last one that was accepted.

A pose that is accepted wrongly must not shut out those that follow:

- one from the future is refused, as every pose after it would seem late;
- one that is in the wrong place, because it came first or after a gap, makes the next good one seem to jump. Which of two that
  do not go together is wrong shows with a third: if the two after it go with each other and with the one before it, it was the
  wrong one, and what it moved must be let go.

A hand that really is somewhere else all at once stays refused until it could have moved there.
"""

from __future__ import annotations

from haptics.errors import InputError
from haptics.scene.hands.check import check_frame, jump_between
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.shown import shown
from haptics.time import NS_PER_MS, NS_PER_S

FUTURE_NS = 50 * NS_PER_MS
"""A pose may be stamped this far ahead of its arrival, as one predicted for display is; farther ahead its clock is another."""
PAST_NS = 250 * NS_PER_MS
"""What is older than this when it arrives shows no hand that is there: the line is too slow, or its clock is another."""
BUNCHED_NS = 4 * NS_PER_MS
"""Poses that arrive with times nearer than this are taken to be so far apart: stamped when they were sent, they bunch up."""
OTHER_HAND = "it is of the hand that wears no glove (`side` chooses which)"
"""Why a pose is refused that may be taken for the other hand."""
FORGOTTEN_NS = 100 * NS_PER_MS
"""After this long without a pose of the hand that was followed, the other hand may be."""


class PoseGate:
    """Judges poses in the order in which they come.

    :param side: of the only hand that may move anything; None follows the hand that comes first until it is gone.
    """

    def __init__(self, side: str | None = None):
        self._side = side
        self.starts_anew = False
        """Whether the pose accepted last does not go on from the one before: what that one moved is to be let go."""
        self.overturned: HandFrame | None = None
        """The pose accepted before, where the last verdict was that it had been wrong."""
        self.forget()

    @property
    def last(self) -> HandFrame | None:
        """The last pose accepted, while the hand is there."""
        return self._last

    def forget(self) -> None:
        """The hand is gone; the next pose is held against none."""
        self._last: HandFrame | None = None
        self._before: HandFrame | None = None
        self._doubted: HandFrame | None = None

    def judge(self, frame: HandFrame, now_ns: int | None = None) -> str | None:
        """Check a pose by itself and against those before it, and set ``starts_anew`` and ``overturned``.

        :param frame: the pose.
        :param now_ns: when it arrived, ns on the clock of its own times; None: not known, so that its time is only held against
            that of the last pose accepted.
        :return: why it must not move anything, in words; None if it may: then it is the last pose accepted. One refused for a
            jump is kept until the next, which may prove it right.
        :raises InputError: not a ``HandFrame``; one whose fields are wrong is refused instead.
        """
        if not isinstance(frame, HandFrame):
            raise InputError(f"frame is {shown(frame)}; expected a HandFrame (haptics.scene.HandFrame)")
        self.starts_anew, self.overturned = False, None
        reason = (
            check_frame(frame, None) or self._untimely(frame, now_ns) or self._of_other_hand(frame) or self._before_last(frame)
        )
        if reason is not None:
            return reason
        last = self._last
        if last is None or frame.side != last.side or frame.track_id != last.track_id:
            self.starts_anew = last is not None
            self._before, self._last, self._doubted = None, frame, None
            return None
        min_ns = 1 if now_ns is None else BUNCHED_NS
        jump = jump_between(last, frame, min_ns)
        if jump is None:
            self._before, self._last, self._doubted = last, frame, None
            return None
        doubted, before = self._doubted, self._before
        if (
            doubted is not None
            and _go_together(doubted, frame, min_ns)
            and (before is None or _go_together(before, doubted, min_ns))
        ):
            self.starts_anew, self.overturned = True, last
            self._before, self._last, self._doubted = doubted, frame, None
            return None
        self._doubted = frame
        return jump

    def _untimely(self, frame: HandFrame, now_ns: int | None) -> str | None:
        if now_ns is not None and frame.time_ns > now_ns + FUTURE_NS:
            ahead_s = (frame.time_ns - now_ns) / NS_PER_S
            return f"clock: its time lies {ahead_s:.6g} s ahead of its arrival, more than {FUTURE_NS / NS_PER_S:g} s"
        if now_ns is not None and frame.time_ns < now_ns - PAST_NS:
            behind_s = (now_ns - frame.time_ns) / NS_PER_S
            return f"clock: its time lies {behind_s:.6g} s behind its arrival, more than {PAST_NS / NS_PER_S:g} s"
        return None

    def _before_last(self, frame: HandFrame) -> str | None:
        if self._last is not None and frame.time_ns <= self._last.time_ns:
            return f"its time {frame.time_ns} ns does not follow {self._last.time_ns} ns"
        return None

    def _of_other_hand(self, frame: HandFrame) -> str | None:
        last = self._last
        followed = last is not None and frame.side != last.side and frame.time_ns - last.time_ns <= FORGOTTEN_NS
        return OTHER_HAND if followed or (self._side is not None and frame.side != self._side) else None


def _go_together(earlier: HandFrame, later: HandFrame, min_ns: int) -> bool:
    return later.time_ns > earlier.time_ns and jump_between(earlier, later, min_ns) is None
