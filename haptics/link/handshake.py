"""Identifying a board: what must match before it is used, and the diagnosis where nothing usable answers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple, Protocol

from haptics.errors import LinkLost, NotABoard
from haptics.link.clock import signed_ticks
from haptics.link.commands import NEVER_NS
from haptics.link.framing import DELIMITER, encode_frame
from haptics.link.messages import (
    BRAKE_CHANNELS,
    BY_NAME,
    COIL_CHANNELS,
    DEFAULT_BAUD,
    LIMIT_NAMES,
    MESSAGES,
    PROTOCOL_VERSION,
    TICK_HZ,
    Board,
    schema_hash,
)
from haptics.time import NS_PER_S

FLASH = "flash the firmware that belongs to this package: make firmware-flash BOARD=tactiles|brake PORT=..."
_CHANNELS: dict[int, int] = {Board.TACTILES: COIL_CHANNELS, Board.BRAKE: BRAKE_CHANNELS}
UNNUMBERED = ("identify", "sync", "keepalive")
"""Messages that a session sends itself, under number 0: they are no commands."""
_SCHEMA_HASH = schema_hash()
_TEXT = re.compile(rb"[\t\r\n -~]{8}")
_IDENTIFY = DELIMITER + encode_frame(BY_NAME["identify"].type, 0)  # the delimiter ends whatever noise came before


class Seen(Protocol):
    """The counters a diagnosis looks at."""

    bytes_in: int
    frames_in: int
    bad_frames: int
    echoes: int


class Before(NamedTuple):
    """The same counters, as they were when an inquiry began.

    :param bytes_in: bytes received.
    :param frames_in: whole frames received.
    :param bad_frames: pieces that were no frame.
    :param echoes: frames that only a host sends.
    """

    bytes_in: int
    frames_in: int
    bad_frames: int
    echoes: int


class Inquiry:
    """Asking for the board's identity at intervals, until it answers or the tries are used up.

    ``reason``: why it is being asked, None while it is not. ``before``: the counters as they were when it began.

    :param every_ns: time between two questions (ns).
    :param tries: questions before it is given up.
    """

    def __init__(self, every_ns: int, tries: int):
        self._every_ns, self._tries_allowed = every_ns, tries
        self.reason: str | None = None  # why it is being asked; None: it is not
        self.tries = 0
        self.due_ns = NEVER_NS
        self.before = Before(0, 0, 0, 0)

    def begin(self, reason: str, now_ns: int, seen: Seen) -> None:
        """Ask from now on; an inquiry that is under way goes on.

        :param reason: why, in words.
        :param now_ns: host time now (ns).
        :param seen: the session's counters; noted as they are now.
        """
        if self.reason is None:
            self.reason, self.tries, self.due_ns = reason, 0, now_ns
            self.before = Before(seen.bytes_in, seen.frames_in, seen.bad_frames, seen.echoes)

    def end(self) -> None:
        """End it: an answer came, or the session is over."""
        self.reason, self.due_ns = None, NEVER_NS

    @property
    def waited_s(self) -> float:
        """Time asked for so far (s)."""
        return self.tries * self._every_ns / NS_PER_S

    @property
    def exhausted(self) -> bool:
        """The last question was asked."""
        return self.tries >= self._tries_allowed

    def frame(self, now_ns: int) -> bytes:
        """Count one try and plan the next.

        :param now_ns: host time now (ns).
        :return: wire bytes of the question.
        """
        self.tries += 1
        self.due_ns = now_ns + self._every_ns
        return _IDENTIFY


def mismatch(identity: Any, expected: Board | None) -> tuple[str, str] | None:
    """What keeps this identity from being the board expected.

    :param identity: the ``identity`` message.
    :param expected: the board wanted, or None for any.
    :return: what differs and what to do about it, in words; None if the board can be used.
    """
    if identity.board in _CHANNELS and expected is not None and identity.board != expected:
        seen = f"this is the {Board(identity.board).name.lower()} board, not {expected.name.lower()}"
        return seen, "are the two ports swapped?"
    seen = _strange(identity)
    return None if seen is None else (seen, FLASH)


def different_limits(identity: Any, configured: Sequence[int]) -> str | None:
    """Where a board's limits differ from those configured.

    :param identity: the ``identity`` message sent after ``configure``.
    :param configured: the limits that were sent, in the order of ``identity.limits`` and its units.
    :return: each differing limit in words, or None if all are as configured.
    """
    names = LIMIT_NAMES[Board(identity.board)]
    rows = zip(names, identity.limits, configured, strict=True)
    wrong = [f"{name} {kept} {unit}, configured: {asked} {unit}" for (name, unit), kept, asked in rows if kept != asked]
    return f"the board answered ok to configure, but keeps {'; '.join(wrong)}" if wrong else None


def _strange(identity: Any) -> str | None:
    if identity.protocol != PROTOCOL_VERSION:
        return f"the board speaks protocol {identity.protocol}, this package {PROTOCOL_VERSION}"
    if identity.board not in _CHANNELS:
        return f"board kind {identity.board} is unknown; known: {', '.join(f'{int(b)} ({b.name.lower()})' for b in Board)}"
    if identity.schema_hash != _SCHEMA_HASH:
        return f"the board's message table is {identity.schema_hash:08x}, this package's {_SCHEMA_HASH:08x}"
    if identity.tick_hz != TICK_HZ:
        return f"the board ticks at {identity.tick_hz} Hz, expected {TICK_HZ}"
    if not 1 <= identity.channels <= _CHANNELS[identity.board]:
        return f"the board has {identity.channels} channels; expected 1 to {_CHANNELS[identity.board]}"
    return None


def diagnosis(port: str, seen: Seen, sample: bytes, tries: int, waited_s: float) -> NotABoard:
    """The likeliest reason why no board answered, and what to do about it.

    :param port: name of the port.
    :param seen: the session's counters.
    :param sample: the first bytes that came and were no frame; empty if there were none.
    :param tries: times ``identify`` was sent.
    :param waited_s: time that took (s).
    :return: the error to raise.
    """
    what, advice = _heard(seen.bytes_in, seen.frames_in, seen.bad_frames, seen.echoes, sample)
    return NotABoard(port, f"no identity in {tries} tries ({waited_s:g} s); {what}", "identify", advice)


def silence(port: str, seen: Seen, inquiry: Inquiry, sample: bytes) -> LinkLost:
    """Why a board that was known counts as lost: nothing comes from it any more, or nothing that can be read.

    :param port: name of the port.
    :param seen: the session's counters now.
    :param inquiry: the inquiry that went unanswered.
    :param sample: the first bytes since its beginning that were no frame.
    :return: the error to raise.
    """
    before = inquiry.before
    bytes_in, frames_in = seen.bytes_in - before.bytes_in, seen.frames_in - before.frames_in
    waited = f"{inquiry.waited_s:g} s ({inquiry.reason})"
    if bytes_in == 0:
        return LinkLost(port, f"no byte came from the board for {waited}", advice="check cable and power")
    what, advice = _heard(bytes_in, frames_in, seen.bad_frames - before.bad_frames, seen.echoes - before.echoes, sample)
    missing = "identity" if frames_in > 0 else "valid frame"
    return LinkLost(port, f"no {missing} for {waited}; {what}", advice=advice)


def _heard(bytes_in: int, frames_in: int, bad_frames: int, echoes: int, sample: bytes) -> tuple[str, str]:
    """What came instead of an identity, and what to do about it."""
    if bytes_in == 0:
        advice = f"check power, cable, that this is the board's port, and the baud rate (boards use {DEFAULT_BAUD})"
        return "no byte came back", advice
    if echoes > 0:
        return "what was sent came back unchanged", "this is a loop-back or an echoing terminal, not a board"
    quoted = f", beginning with {sample!r}" if sample else ""
    if frames_in > 0:
        what = f"{bytes_in} bytes came: {frames_in} valid frames, none an identity, and {bad_frames} damaged ones{quoted}"
        advice = "another device, or other firmware, uses this line"
    else:
        what = f"{bytes_in} bytes came that form no frame{quoted}"
        advice = f"the baud rate is probably wrong (boards use {DEFAULT_BAUD}), or another device uses this line"
    if _is_text(sample):
        advice = "that is text: does the firmware print messages on this line, or is this another device?"
    return what, advice


def _is_text(sample: bytes) -> bool:
    """At least eight printable characters in a row: noise has them once in a thousand times."""
    return _TEXT.search(sample) is not None


def after(ticks: int, other: int) -> bool:
    """Whether a tick comes after another, across the wrap.

    :param ticks: a u32 tick count.
    :param other: another one, less than 1073 s from it.
    :return: True if ``ticks`` is the later one.
    """
    return signed_ticks(ticks, other) > 0


@cache
def commands_for(board: Board | None) -> tuple[str, ...]:
    """Names of the commands that an owner may send.

    :param board: the board, or None for those of any board.
    :return: names in the order of the message table, without ``identify``, ``sync`` and ``keepalive``, which a session sends
        itself.
    """
    return tuple(
        m.name for m in MESSAGES if m.sender == "host" and m.name not in UNNUMBERED and (board is None or board in m.boards)
    )
