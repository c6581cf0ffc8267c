"""What can go wrong on a serial line, as one line of text, and as a seeded player of frames.

``corrupt=0.01,drop=0.01,delay=0.005``: each frame of either direction meets each fault with that probability, whatever it met
before. Pure: no ports, no clock. Simulated cables play it in virtual time, ``FaultyPort`` around a real port.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Any, cast

from haptics.errors import InputError
from haptics.link.framing import DELIMITER, LONGEST_FRAME
from haptics.time import NS_PER_MS
from haptics.units import in_range

_PROBABILITIES = ("corrupt", "drop", "lose", "insert", "truncate", "duplicate", "delay")


@dataclass(frozen=True, slots=True)
class LineFaults:
    """What a line does. Frame faults are probabilities a frame, 0 to 1; times count from the opening of the port.

    ``corrupt``: one bit of one byte flipped. ``drop``: all of it lost. ``lose``: one byte lost. ``insert``: a random byte more.
    ``truncate``: its end lost, the delimiter with it. ``duplicate``: it comes twice. ``delay``: it, and all behind it, comes
    ``delay_ms`` late. ``unplug_s``: from then on reads and writes fail, and bytes on the wire are lost (-1: never).
    ``stall_s``: from then on the peer takes no bytes (-1: never). ``garbage``: random bytes the board sends when it is
    powered on. ``dtr_reset``: 1: opening the port resets the board, which is deaf and dumb for a second then.
    """

    corrupt: float = 0.0
    drop: float = 0.0
    lose: float = 0.0
    insert: float = 0.0
    truncate: float = 0.0
    duplicate: float = 0.0
    delay: float = 0.0
    delay_ms: float = 30.0
    unplug_s: float = -1.0
    stall_s: float = -1.0
    garbage: int = 0
    dtr_reset: int = 0

    @property
    def ends_the_link(self) -> bool:
        """Whether no link is meant to outlive these faults."""
        return self.unplug_s >= 0.0 or self.stall_s >= 0.0


_RANGES: dict[str, tuple[float, float, str]] = {
    **{name: (0.0, 1.0, "") for name in _PROBABILITIES},
    "delay_ms": (0.0, 10_000.0, "ms"),
    "unplug_s": (0.0, 1e6, "s"),
    "stall_s": (0.0, 1e6, "s"),
    "garbage": (0, 65_536, "bytes"),
    "dtr_reset": (0, 1, ""),
}
_COUNTS = {"garbage", "dtr_reset"}


def parse_faults(text: str) -> LineFaults:
    """Faults of ``key=value,key=value``; empty text is none.

    :raises InputError: no such fault, one named twice, no number, or one outside its range.
    """
    given: dict[str, Any] = {}
    for pair in filter(None, (piece.strip() for piece in text.split(","))):
        key, found, value = pair.partition("=")
        if not found or key not in _RANGES:
            raise InputError(f"faults: {pair!r} is not allowed; allowed: {', '.join(f'{name}=NUMBER' for name in _RANGES)}")
        if key in given:
            raise InputError(f"faults: {key} is given twice in {text!r}; allowed: once")
        low, high, unit = _RANGES[key]
        given[key] = in_range(f"faults: {key}", cast(float, value), low, high, unit)
    for key in _COUNTS & set(given):
        if given[key] != int(given[key]):
            raise InputError(f"faults: {key} = {given[key]:g} is not allowed; allowed: whole numbers")
        given[key] = int(given[key])
    return LineFaults(**given)


class FrameFaults:
    """Plays the frame faults of one direction. Same faults, seed and frames: same outcome.

    :param direction: "out" (to the board) or "in"; each has random numbers of its own.
    """

    def __init__(self, faults: LineFaults, seed: int, direction: str):
        self.faults = faults
        self._random = Random(f"{seed} {direction}")
        self._likely = [(name, getattr(faults, name)) for name in _PROBABILITIES if getattr(faults, name) > 0.0]
        self._delay_ns = round(faults.delay_ms * NS_PER_MS)

    def play(self, frame: bytes) -> list[tuple[int, bytes]]:
        """What arrives of a frame (its bytes up to and including the delimiter): each piece with how much later, in ns."""
        happens = {name for name, probability in self._likely if self._random.random() < probability}
        if not happens:
            return [(0, frame)]
        if "drop" in happens:
            return []
        random, data = self._random, bytearray(frame)
        if "corrupt" in happens:
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        if "lose" in happens:
            del data[random.randrange(len(data))]
        if "insert" in happens:
            data.insert(random.randrange(len(data) + 1), random.randrange(256))
        if "truncate" in happens and data:
            del data[random.randrange(len(data)) :]
        delay_ns = self._delay_ns if "delay" in happens else 0
        copies = 2 if "duplicate" in happens else 1
        return [(delay_ns, bytes(data))] * copies if data else []

    def noise(self, count: int) -> bytes:
        """Random bytes."""
        return self._random.randbytes(count)


class FrameCutter:
    """Cuts a stream behind each delimiter; what can no longer be a frame is handed on as it is."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def cut(self, data: bytes) -> list[bytes]:
        """Frames completed by ``data``, in order."""
        *whole, rest = (bytes(self._rest) + data).split(DELIMITER)
        frames = [piece + DELIMITER for piece in whole]
        if len(rest) > LONGEST_FRAME:
            frames.append(rest)
            rest = b""
        self._rest = bytearray(rest)
        return frames
