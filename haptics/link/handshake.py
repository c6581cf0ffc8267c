"""Who is there: what must agree before a board is spoken to, and what to say if nobody fits."""

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
_NOT_COMMANDS = ("identify", "sync", "keepalive")
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
    """The same counters, as they were when an inquiry began."""

    bytes_in: int
    frames_in: int
    bad_frames: int
    echoes: int


class Inquiry:
    """Asking who is there, every so often, until somebody answers or patience ends."""

    def __init__(self, every_ns: int, tries: int):
        self._every_ns, self._tries_allowed = every_ns, tries
        self.reason: str | None = None  # why it is being asked; None: nobody asks
        self.tries = 0
        self.due_ns = NEVER_NS
        self.before = Before(0, 0, 0, 0)

    def begin(self, reason: str, now_ns: int, seen: Seen) -> None:
        """Ask from now on; if that is so already, go on. ``seen``: the counters, which are noted as they are now."""
        if self.reason is None:
            self.reason, self.tries, self.due_ns = reason, 0, now_ns
            self.before = Before(seen.bytes_in, seen.frames_in, seen.bad_frames, seen.echoes)

    def end(self) -> None:
        """An answer came, or nobody wants to know any more."""
        self.reason, self.due_ns = None, NEVER_NS

    @property
    def waited_s(self) -> float:
        """Time asked for so far."""
        return self.tries * self._every_ns / NS_PER_S

    @property
    def exhausted(self) -> bool:
        """The last question was asked."""
        return self.tries >= self._tries_allowed

    def frame(self, now_ns: int) -> bytes:
        """The next question."""
        self.tries += 1
        self.due_ns = now_ns + self._every_ns
        return _IDENTIFY


def mismatch(identity: Any, expected: Board | None) -> tuple[str, str] | None:
    """What keeps this identity from being the board expected, and what to do about it, in words; or None."""
    if identity.board in _CHANNELS and expected is not None and identity.board != expected:
        seen = f"this is the {Board(identity.board).name.lower()} board, not {expected.name.lower()}"
        return seen, "are the two ports swapped?"
    seen = _strange(identity)
    return None if seen is None else (seen, FLASH)


def different_limits(identity: Any, configured: Sequence[int]) -> str | None:
    """Where a board's limits are not those configured, in words; None where all are."""
    names = LIMIT_NAMES[Board(identity.board)]
    rows = zip(names, identity.limits, configured, strict=True)
    wrong = [f"{name} {kept} {unit}, configured: {asked} {unit}" for (name, unit), kept, asked in rows if kept != asked]
    return f"it said ok, and keeps to {'; '.join(wrong)}" if wrong else None


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
        return f"the board has {identity.channels} channels; allowed: 1 to {_CHANNELS[identity.board]}"
    return None


def diagnosis(port: str, seen: Seen, sample: bytes, tries: int, waited_s: float) -> NotABoard:
    """The likeliest reason why nobody said who they are, and what to do about it. ``sample``: bytes that came."""
    what, advice = _heard(seen.bytes_in, seen.frames_in, seen.bad_frames, seen.echoes, sample)
    return NotABoard(port, f"no identity in {tries} tries ({waited_s:g} s); {what}", "identify", advice)


def silence(port: str, seen: Seen, inquiry: Inquiry, sample: bytes) -> LinkLost:
    """Why a board that was known counts as lost: it says nothing any more, or something that cannot be read."""
    before = inquiry.before
    bytes_in, frames_in = seen.bytes_in - before.bytes_in, seen.frames_in - before.frames_in
    waited = f"{inquiry.waited_s:g} s ({inquiry.reason})"
    if bytes_in == 0:
        return LinkLost(port, f"the board fell silent for {waited}", advice="check cable and power")
    what, advice = _heard(bytes_in, frames_in, seen.bad_frames - before.bad_frames, seen.echoes - before.echoes, sample)
    return LinkLost(port, f"no answer of the board for {waited}; {what}", advice=advice)


def _heard(bytes_in: int, frames_in: int, bad_frames: int, echoes: int, sample: bytes) -> tuple[str, str]:
    """What came instead of an identity, and what to do about it."""
    if bytes_in == 0:
        advice = f"check power, cable, that this is the board's port, and the baud rate (boards speak {DEFAULT_BAUD})"
        return "not one byte came back", advice
    if echoes > 0:
        return "what is sent comes back as it is", "this is a loop-back or an echoing terminal, not a board"
    quoted = f", beginning with {sample!r}" if sample else ""
    strange = f"{bytes_in} bytes came, {frames_in} whole frames and {bad_frames} bad ones{quoted}"
    if _is_text(sample):
        return strange, "that is text: does the firmware print messages on this line, or is this another device?"
    if frames_in > 0:
        return f"{strange}; none of them an identity", "another device, or another firmware, speaks here"
    what = f"{bytes_in} bytes came, never a whole frame ({bad_frames} bad ones){quoted}"
    return what, f"the baud rate is probably wrong (boards speak {DEFAULT_BAUD}), or another device speaks here"


def _is_text(sample: bytes) -> bool:
    """At least eight printable characters in a row: noise has them once in a thousand times."""
    return _TEXT.search(sample) is not None


def after(ticks: int, other: int) -> bool:
    """Whether u32 ``ticks`` come after ``other``."""
    return signed_ticks(ticks, other) > 0


@cache
def commands_for(board: Board | None) -> tuple[str, ...]:
    """Names of the commands an owner may send to a board (None: to any)."""
    return tuple(
        m.name for m in MESSAGES if m.sender == "host" and m.name not in _NOT_COMMANDS and (board is None or board in m.boards)
    )
