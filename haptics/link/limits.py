"""The limits of a board: what is configured where a board is stricter than what is wanted of it.

A host may make a limit stricter, and never looser again while the board runs. A board may have been built stricter than a glove's
configuration says, or may still keep what an earlier host configured: what holds is then the board's
(``docs/reference/protocol.md``).
"""

from __future__ import annotations

from collections.abc import Sequence

from haptics.link.messages import LIMIT_NAMES, Board

Wanted = Sequence[int | None]
"""Limits as a configuration wants them, in the order of ``identity.limits``; None leaves the board's own."""
_STRICTER_UPWARD = LIMIT_NAMES[Board.TACTILES][3][0]
"""The minimum supply voltage: the only limit that is stricter where it is higher."""


def stricter(board: Board, wanted: Wanted, reported: Sequence[int]) -> tuple[int, ...]:
    """What is to be configured: of each limit the stricter of what is wanted and what the board reports.

    :param board: which board; its ``LIMIT_NAMES`` give the order and the units.
    :param wanted: limits as configured, None for the board's own.
    :param reported: ``identity.limits``.
    :return: limits for ``configure``, in the same order and units.
    """
    rows = zip(LIMIT_NAMES[board], wanted, reported, strict=True)
    return tuple(
        own if want is None else max(want, own) if name == _STRICTER_UPWARD else min(want, own) for (name, _), want, own in rows
    )


def kept_stricter(board: Board, wanted: Wanted, reported: Sequence[int]) -> list[str]:
    """Where the board's own limit is stricter than the one wanted.

    :param board: which board.
    :param wanted: limits as configured, None for the board's own.
    :param reported: ``identity.limits``.
    :return: one text a limit: name, what the board holds, what was configured.
    """
    rows = zip(LIMIT_NAMES[board], wanted, reported, strict=True)
    return [
        f"{name} {own} {unit} (configured: {want})"
        for (name, unit), want, own in rows
        if want is not None and (own > want if name == _STRICTER_UPWARD else own < want)
    ]
