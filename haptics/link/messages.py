"""The one table of messages: what a host and a board may send each other (see ``docs/reference/protocol.md``).

Every other form of the protocol (Python structs here, the C header, the reference page, the hash checked in the
handshake) is derived from ``MESSAGES``. Integers are little endian; ``time`` fields are board ticks (u32, 2 MHz).
"""

from __future__ import annotations

import hashlib
import struct
from collections import namedtuple
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

from haptics.errors import InputError

PROTOCOL_VERSION = 1
TICK_HZ = 2_000_000
TICKS_PER_US = TICK_HZ // 1_000_000
COIL_CHANNELS = 15
BRAKE_CHANNELS = 5
DURATION_UNIT_US = 50
DEFAULT_BAUD = 500_000
MAX_PAYLOAD = 64
LIMITS = 5  # that a board reports in identity and takes in configure
HEAT_UNIT_MS = 20  # of a coil's on-time account, in telemetry
OPEN_COMMANDS = 8  # at most, counted in numbers from the oldest that has no answer
REMEMBERED_REPLIES = 16  # by a board: an open command may be overtaken by 7 later numbers and 7 repeated earlier ones


class Board(IntEnum):
    """Which board answers ``identify``."""

    TACTILES = 1
    BRAKE = 2


LIMIT_NAMES: dict[Board, tuple[tuple[str, str], ...]] = {
    Board.TACTILES: (
        ("longest pulse", "50 us"),
        ("coil current", "mA"),
        ("queue depth", "pulses"),
        ("min supply voltage", "mV"),
        ("on-time account", "ms"),
    ),
    Board.BRAKE: (
        ("amplitude", "V"),
        ("supply current", "uA"),
        ("frequency", "0.1 Hz"),
        ("longest ttl", "ms"),
        ("stored charge", "nC"),
    ),
}
"""Name and unit of each of ``identity.limits``, in their order."""


class Status(IntEnum):
    """What a board answers to a command."""

    OK = 0
    LATE = 1  # its time has passed; it was dropped
    FAR = 2  # its time lies too far ahead
    FULL = 3  # no place in the queue
    BAD_LENGTH = 4  # the payload does not fit its type
    UNKNOWN = 5  # no such message type for this board
    INTERLOCK = 6  # not armed, or a fault is latched
    BAD_VALUE = 7  # a field is outside its limit; ``detail`` is the field's index
    HOT = 8  # its coils were on for too long of late; ``detail`` is the mask of those coils


class State(IntEnum):
    """Where a board stands. Only ``ARMED`` and ``DRIVING`` may energise anything."""

    DISARMED = 0
    SELF_TEST = 1
    ARMED = 2
    DRIVING = 3
    DISCHARGING = 4
    FAULT = 5


class Fault(IntEnum):
    """Latched faults; each is bit ``1 << value`` of a telemetry ``faults`` field."""

    DEAD_MAN = 0  # no valid frame for the dead-man time while energised or armed
    COIL_ON_TIME = 1
    COIL_CURRENT = 2
    OVER_VOLTAGE = 3
    OVER_CURRENT = 4
    SHORT = 5
    OPEN = 6
    LEAK = 7
    BRIDGE_STUCK = 8
    SUPPLY = 9
    SELF_TEST = 10
    BROWN_OUT = 11


@dataclass(frozen=True)
class Field:
    """One field of a message.

    :param name: within its message.
    :param code: ``u8``, ``u16``, ``u32`` or ``char``.
    :param count: how often it is repeated.
    :param unit: for people; empty for a plain number.
    """

    name: str
    code: str
    count: int = 1
    unit: str = ""


@dataclass(frozen=True)
class Message:
    """One row of the table.

    :param type: first byte of its frame.
    :param name: as the protocol page has it.
    :param sender: ``host`` or ``board``.
    :param boards: those that know it.
    :param fields: of its payload, in order.
    :param meaning: in words, for the protocol page.
    """

    type: int
    name: str
    sender: str
    boards: tuple[Board, ...]
    fields: tuple[Field, ...]
    meaning: str


_BOTH = (Board.TACTILES, Board.BRAKE)
_COILS = (Board.TACTILES,)
_BRAKE = (Board.BRAKE,)

MESSAGES: tuple[Message, ...] = (
    Message(0x01, "identify", "host", _BOTH, (), "Who are you? Answered by identity, always."),
    Message(0x02, "sync", "host", _BOTH, (Field("token", "u32"),), "Clock exchange; answered by sync_reply."),
    Message(
        0x03,
        "configure",
        "host",
        _BOTH,
        (Field("limits", "u16", LIMITS),),
        "Lower this board's limits (same order as identity.limits); raising one is refused.",
    ),
    Message(0x04, "arm", "host", _BOTH, (Field("boot_id", "u32"),), "Arm the board that booted with this id."),
    Message(0x05, "disarm", "host", _BOTH, (), "Make safe and forget the queue; clears latched faults whose cause is gone."),
    Message(0x06, "stop", "host", _BOTH, (), "At once, past every queue: nothing energised, queue empty, disarmed."),
    Message(0x07, "keepalive", "host", _BOTH, (), "The host lives. Any valid frame says the same."),
    Message(
        0x10,
        "pulse",
        "host",
        _COILS,
        (
            Field("time", "u32", unit="tick"),
            Field("channels", "u16", unit="mask"),
            Field("toward_skin", "u16", unit="mask"),
            Field("duration", "u8", COIL_CHANNELS, "50 us"),
        ),
        "Energise the coils in the mask from `time`, each for its duration, toward the skin or back.",
    ),
    Message(0x11, "cancel", "host", _COILS, (Field("channels", "u16", unit="mask"),), "Forget pulses not yet begun."),
    Message(
        0x20,
        "drive",
        "host",
        _BRAKE,
        (
            Field("time", "u32", unit="tick"),
            Field("channels", "u8", unit="mask"),
            Field("amplitude", "u16", unit="V"),
            Field("frequency", "u16", unit="0.1 Hz"),
            Field("ttl", "u16", unit="ms"),
        ),
        "From `time`, for `ttl`: bipolar square wave on the outputs in the mask, all others shorted; replaces what ran. "
        "Amplitude or mask 0 discharges.",
    ),
    Message(
        0x21,
        "piezo",
        "host",
        _BRAKE,
        (Field("time", "u32", unit="tick"), Field("channels", "u8", unit="mask"), Field("duration", "u16", unit="ms")),
        "Vibrate the fingertip piezos in the mask.",
    ),
    Message(
        0x81,
        "identity",
        "board",
        _BOTH,
        (
            Field("protocol", "u8"),
            Field("board", "u8"),
            Field("channels", "u8"),
            Field("tick_hz", "u32", unit="Hz"),
            Field("schema_hash", "u32"),
            Field("boot_id", "u32"),
            Field("build", "char", 8),
            Field("dead_man", "u16", unit="ms"),
            Field("limits", "u16", LIMITS),
        ),
        "limits, tactiles: longest pulse (50 us), coil current (mA), queue depth, least voltage (mV), on-time account (ms); "
        "brake: amplitude (V), supply current (uA), frequency (0.1 Hz), longest ttl (ms), stored charge (nC).",
    ),
    Message(
        0x82,
        "sync_reply",
        "board",
        _BOTH,
        (Field("token", "u32"), Field("received", "u32", unit="tick"), Field("sent", "u32", unit="tick")),
        "Ticks when the last byte of sync came in and when the first byte of this went out.",
    ),
    Message(
        0x90,
        "reply",
        "board",
        _BOTH,
        (Field("status", "u8"), Field("time", "u32", unit="tick"), Field("detail", "u16")),
        "Outcome of the command with this sequence number. `late`: detail is the lateness in ticks/32, saturated.",
    ),
    Message(
        0xA0,
        "tactiles_telemetry",
        "board",
        _COILS,
        (
            Field("time", "u32", unit="tick"),
            Field("state", "u8"),
            Field("faults", "u16", unit="mask"),
            Field("played", "u16", COIL_CHANNELS, "pulses begun"),
            Field("heat", "u8", COIL_CHANNELS, f"{HEAT_UNIT_MS} ms of on-time account"),
            Field("supply", "u16", unit="mV"),
            Field("current", "u16", unit="mA"),
            Field("queued", "u16", unit="pulses"),
            Field("late", "u16", unit="commands"),
            Field("bad_frames", "u16", unit="frames"),
        ),
        "Every 20 ms while the line has room. Counters wrap and are never reset but by a reboot.",
    ),
    Message(
        0xA1,
        "brake_telemetry",
        "board",
        _BRAKE,
        (
            Field("time", "u32", unit="tick"),
            Field("state", "u8"),
            Field("faults", "u16", unit="mask"),
            Field("output", "u16", BRAKE_CHANNELS, "V amplitude"),
            Field("capacitance", "u16", BRAKE_CHANNELS, "pF"),
            Field("leakage", "u16", BRAKE_CHANNELS, "0.1 uA"),
            Field("bus", "u16", unit="V"),
            Field("supply_current", "u16", unit="uA"),
            Field("queued", "u16", unit="commands"),
            Field("late", "u16", unit="commands"),
            Field("bad_frames", "u16", unit="frames"),
        ),
        "Every 20 ms while the line has room.",
    ),
    Message(
        0xA2,
        "fault",
        "board",
        _BOTH,
        (Field("time", "u32", unit="tick"), Field("code", "u8"), Field("channel", "u8"), Field("value", "u16")),
        "A fault was latched. Repeated by telemetry's `faults` until cleared.",
    ),
)

BY_NAME: dict[str, Message] = {message.name: message for message in MESSAGES}
BY_TYPE: dict[int, Message] = {message.type: message for message in MESSAGES}

_CODES = {"u8": "B", "u16": "H", "u32": "I"}


def schema_hash() -> int:
    """The table in one number, so that a host and a board of different tables do not talk past each other.

    :return: first four bytes (little endian) of the SHA-256 over the table's canonical text.
    """
    lines = [f"protocol {PROTOCOL_VERSION}"]
    for m in MESSAGES:
        fields = ",".join(f"{f.name}:{f.code}*{f.count}" for f in m.fields)
        lines.append(f"{m.type:02x} {m.name} {m.sender} {'+'.join(b.name.lower() for b in m.boards)} {fields}")
    return int.from_bytes(hashlib.sha256("\n".join(lines).encode()).digest()[:4], "little")


@cache
def layout(name: str) -> tuple[struct.Struct, type, tuple[Field, ...]]:
    """How a message lies in its payload.

    :param name: of the message.
    :return: struct, named tuple class and fields.
    :raises InputError: no message has this name.
    """
    if name not in BY_NAME:
        raise InputError(f"message {name!r} is unknown; the table has: {', '.join(BY_NAME)}")
    fields = BY_NAME[name].fields
    parts = [f"{f.count}s" if f.code == "char" else _CODES[f.code] * f.count for f in fields]
    kind: type = namedtuple(name, [f.name for f in fields])  # pyright: ignore
    return struct.Struct("<" + "".join(parts)), kind, fields


def payload_size(name: str) -> int:
    """How long a payload is.

    :param name: of the message.
    :return: bytes.
    :raises InputError: no message has this name.
    """
    return layout(name)[0].size


def encode(name: str, *values: Any) -> bytes:
    """A message's payload.

    :param name: of the message.
    :param values: one for each field; a field with a count takes one sequence (``char``: bytes).
    :return: the payload's bytes.
    :raises InputError: wrong number of values, or one that does not fit its field.
    """
    structure, _, fields = layout(name)
    if len(values) != len(fields):
        raise InputError(f"message {name!r} has {len(fields)} fields, got {len(values)} values")
    flat: list[Any] = []
    for field, value in zip(fields, values, strict=True):
        if field.count > 1 and field.code != "char":
            if len(value) != field.count:
                raise InputError(f"{name}.{field.name} takes {field.count} values, got {len(value)}")
            flat.extend(value)
        else:
            flat.append(value)
    try:
        return structure.pack(*flat)
    except struct.error as error:
        raise InputError(f"message {name!r}: {error}; values were {values!r}") from error


def decode(name: str, payload: bytes) -> Any:
    """A payload's fields.

    :param name: of the message.
    :param payload: its bytes.
    :return: a named tuple, with the fields' names, as integers in the table's units.
    :raises InputError: the payload's length is not the message's.
    """
    structure, kind, fields = layout(name)
    if len(payload) != structure.size:
        raise InputError(f"message {name!r} has {structure.size} bytes of payload, got {len(payload)}")
    flat = structure.unpack(payload)
    values: list[Any] = []
    at = 0
    for field in fields:
        if field.count > 1 and field.code != "char":
            values.append(flat[at : at + field.count])
            at += field.count
        else:
            values.append(flat[at])
            at += 1
    return kind(*values)
