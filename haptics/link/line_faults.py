"""What can go wrong on a serial line, as one line of text, and as a seeded player of frames.

``corrupt=0.01,drop=0.01,delay=0.005``: each frame of either direction meets each fault with that probability, whatever it met
before. Pure: no ports, no clock. Simulated cables play it in virtual time, ``FaultyPort`` around a real port.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Any, cast

from haptics.errors import InputError, nearest
from haptics.link.framing import DELIMITER, LONGEST_FRAME
from haptics.time import NS_PER_MS
from haptics.units import in_range

_PROBABILITIES = ("corrupt", "drop", "lose", "insert", "truncate", "duplicate", "delay")


@dataclass(frozen=True, slots=True)
class LineFaults:
    """What a line does wrong. Probabilities are per frame, 0 to 1; times count from the opening of the port.

    :param corrupt: one bit of one byte is flipped.
    :param drop: the whole frame is lost.
    :param lose: one byte is lost.
    :param insert: a random byte is added.
    :param truncate: its end is lost, the delimiter with it.
    :param duplicate: it arrives twice.
    :param delay: it, and all behind it, arrives ``delay_ms`` late.
    :param delay_ms: 0 to 10 000 ms.
    :param unplug_s: from then on reads and writes fail, and bytes on the wire are lost (s; -1: never).
    :param stall_s: from then on the peer takes no bytes (s; -1: never).
    :param garbage: random bytes that the board sends when it is powered on, 0 to 65 536.
    :param dtr_reset: 1: opening the port resets the board, which neither hears nor answers for a second; 0: it does not.
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
        """Whether these faults end every link."""
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

    :param text: such as ``drop=0.01,delay=0.005``; keys and ranges as in ``LineFaults``.
    :return: the faults.
    :raises InputError: no such fault, one named twice, no number, or one outside its range.
    """
    given: dict[str, Any] = {}
    for pair in filter(None, (piece.strip() for piece in text.split(","))):
        key, found, value = pair.partition("=")
        if key not in _RANGES:
            raise InputError(f"faults: unknown key {key!r}; known keys: {', '.join(_RANGES)}{nearest(key, tuple(_RANGES))}")
        if not found:
            raise InputError(f"faults: {key} has no number; expected {key}=NUMBER")
        if key in given:
            raise InputError(f"faults: {key} is given twice in {text!r}")
        low, high, unit = _RANGES[key]
        given[key] = in_range(f"faults: {key}", cast(float, value), low, high, unit)
    for key in _COUNTS & set(given):
        if given[key] != int(given[key]):
            raise InputError(f"faults: {key} = {given[key]:g}; expected a whole number")
        given[key] = int(given[key])
    return LineFaults(**given)


class FrameFaults:
    """Plays the frame faults of one direction. Same faults, seed and frames: same outcome.

    :param faults: which faults, and how likely.
    :param seed: of the random numbers.
    :param direction: "out" (to the board) or "in"; each has random numbers of its own.
    """

    def __init__(self, faults: LineFaults, seed: int, direction: str):
        self.faults = faults
        self._random = Random(f"{seed} {direction}")
        self._likely = [(name, getattr(faults, name)) for name in _PROBABILITIES if getattr(faults, name) > 0.0]
        self._delay_ns = round(faults.delay_ms * NS_PER_MS)

    def play(self, frame: bytes) -> list[tuple[int, bytes]]:
        """What arrives of a frame.

        :param frame: its bytes up to and including the delimiter.
        :return: pieces as ``(delay in ns, bytes)``; none if it was dropped.
        """
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
        """Random bytes.

        :param count: how many.
        :return: that many bytes.
        """
        return self._random.randbytes(count)


class FrameCutter:
    """Cuts a stream behind each delimiter; what has grown too long to be a frame is handed on as it is."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def cut(self, data: bytes) -> list[bytes]:
        """Frames completed by ``data``.

        :param data: the next bytes of the stream.
        :return: pieces in order, each with its delimiter unless it was too long.
        """
        *whole, rest = (bytes(self._rest) + data).split(DELIMITER)
        frames = [piece + DELIMITER for piece in whole]
        if len(rest) > LONGEST_FRAME:
            frames.append(rest)
            rest = b""
        self._rest = bytearray(rest)
        return frames
