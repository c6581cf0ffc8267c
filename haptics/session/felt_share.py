"""Whether a run was felt at all: how many requests failed on the line or the board, which reason dominates, and its cure.

A request that heat or another request kept from playing was denied by design; one that could not be timed, came too late, found
the queue full or was never answered was not felt although it should have been.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from haptics.link.connection import Link
from haptics.link.settings import FINER_LINE
from haptics.time import NS_PER_MS

BY_DESIGN = frozenset(("superseded", "heat", "hot", "company", "current", "contact", "ended", "stopped", "cut"))
"""Reasons to deny a request that are no fault of the line: the scheduler's own, and a board's coil that is hot."""
LARGEST_FAILED_SHARE = 0.2
"""Of the requests that were not denied by design; beyond it the run has failed. A pin that was late is tried again, so that
one request in five may fail and nearly every touch be felt, a little late; beyond that touches are missed (assumed)."""
_CURES = {
    "clock": FINER_LINE,
    "late": "the machine is too busy, or the line too slow: end other programs, or connect the board directly",
    "full": "the coil was already playing, or the board's queue was full: commands arrive in bunches",
    "unknown": "commands were not answered: check cable and power",
    "unarmed": "the board was not armed: the faults name the cause",
    "interlock": "the board was not armed, or a fault is latched",
}


@dataclass(frozen=True, slots=True)
class FeltShare:
    """Requests to one board.

    :param board: ``tactiles`` or ``brake``.
    :param played: how many played.
    :param failed: how many did not, by reason, for reasons that are not by design.
    """

    board: str
    played: int
    failed: Mapping[str, int]

    @property
    def share(self) -> float:
        """Failed ones, of those that were not denied by design; 0 if there were none."""
        failed = sum(self.failed.values())
        return failed / (self.played + failed) if failed else 0.0


def felt_share(board: str, played: int, denied: Mapping[str, int]) -> FeltShare:
    """The share of requests to a board that failed.

    :param board: ``tactiles`` or ``brake``.
    :param played: how many played.
    :param denied: how many did not, by reason.
    :return: without what was denied by design.
    """
    return FeltShare(board, played, {reason: count for reason, count in denied.items() if count and reason not in BY_DESIGN})


def fault_of(felt: FeltShare, link: Link | None) -> str | None:
    """Whether a run failed for its line or a busy machine.

    :param felt: of one board.
    :param link: with that board, for what is known of its clock.
    :return: the share, its dominant cause and the cure, in words; None if at most ``LARGEST_FAILED_SHARE`` failed.
    """
    if felt.share <= LARGEST_FAILED_SHARE:
        return None
    reason, count = Counter(felt.failed).most_common(1)[0]
    failed, total = sum(felt.failed.values()), felt.played + sum(felt.failed.values())
    what = f"{felt.board}: {failed} of {total} requests failed (limit {LARGEST_FAILED_SHARE:.0%}), {count} of them {reason}"
    cure = _CURES.get(reason, "the board refused them")
    if reason == "clock" and link is not None:
        what += f": {_known(link.session.counters.clock_refused_ms, link.session.settings.max_error_s)}"
    elif reason == "late" and link is not None and link.shift_ns:
        what += f": {_known(link.shift_ns / NS_PER_MS, link.session.settings.fine_error_s)}, and answers hold up later commands"
        cure = FINER_LINE
    return f"{what}; {cure}"


def _known(within_ms: float, needed_s: float) -> str:
    return f"clock known within {within_ms:.0f} ms only, {needed_s * 1e3:g} needed" if within_ms else "the clock was not measured"


def coarse_note(board: str, link: Link) -> str | None:
    """What a line whose clock is known coarsely cost.

    :param board: ``tactiles`` or ``brake``.
    :param link: with that board.
    :return: by how much everything plays later, in words; None if by nothing.
    """
    if link.shift_ns == 0:
        return None
    shift_ms = link.shift_ns / NS_PER_MS
    return (
        f"{board}: its clock is known within {shift_ms:g} ms only, so everything plays {shift_ms:g} ms later than it should, "
        f"{2 * shift_ms:g} ms at most; {FINER_LINE}"
    )
