"""Frames: ``COBS(type u8, seq u8, payload, crc16 LE) 0x00`` (see ``docs/reference/protocol.md``).

The CRC is CRC-16/X-25: its final XOR makes appended zero bytes visible. Length is checked against the type besides.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from cobs import cobs  # pyright: ignore[reportMissingTypeStubs]
from fastcrc import crc16

from haptics.errors import InputError
from haptics.link.messages import MAX_PAYLOAD

_stuff: Callable[[bytes], bytes] = cobs.encode  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
_unstuff: Callable[[bytes], bytes] = cobs.decode  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]

DELIMITER = b"\x00"
_OVERHEAD = 4
_SAMPLE = 32
FRAMING_BYTES = _OVERHEAD + 2
"""Of every frame beside its payload: type, number, checksum, stuffing, delimiter."""
LONGEST_FRAME = MAX_PAYLOAD + FRAMING_BYTES
BITS_PER_BYTE = 10
"""On the line: start bit, eight data bits, stop bit."""


class Frame(NamedTuple):
    """A frame whose checksum held.

    :param type: message type, 0 to 255; not necessarily one of the table.
    :param seq: sequence number, 0 to 255.
    :param payload: 0 to 64 bytes.
    """

    type: int
    seq: int
    payload: bytes


def encode_frame(type_: int, seq: int, payload: bytes = b"") -> bytes:
    """Wire bytes of a frame, delimiter included.

    :param type_: message type, 0 to 255.
    :param seq: sequence number, 0 to 255; 0 for messages that carry none.
    :param payload: encoded fields, at most 64 bytes.
    :return: 6 to 70 bytes that end with the delimiter 0x00.
    :raises InputError: payload longer than 64 bytes, or type or sequence number not a byte.
    """
    if len(payload) > MAX_PAYLOAD:
        raise InputError(f"payload = {len(payload)} bytes; must be 0 to {MAX_PAYLOAD}")
    if not (0 <= type_ <= 255 and 0 <= seq <= 255):
        raise InputError(f"type = {type_}, seq = {seq}; must be 0 to 255 each")
    body = bytes((type_, seq)) + payload
    return _stuff(body + crc16.ibm_sdlc(body).to_bytes(2, "little")) + DELIMITER


class Deframer:
    """Cuts a byte stream into frames and counts what was no frame. Never raises on bytes, never grows without bound.

    ``bad_frames`` counts what was dropped. ``sample`` is the beginning (at most 32 bytes) of the first bytes that were no frame,
    for a diagnosis; empty it to have a new one.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._overrun = False
        self.bad_frames = 0
        self.sample = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by ``data``; what is no frame is counted in ``bad_frames`` and dropped.

        :param data: the next bytes of the stream; frames may be cut anywhere between calls.
        :return: whole frames in the order they came.
        """
        frames: list[Frame] = []
        pieces = bytes(data).split(DELIMITER)
        for index, piece in enumerate(pieces):
            self._buffer += piece
            if len(self._buffer) >= LONGEST_FRAME:  # without its delimiter a frame is one byte shorter
                self._keep(self._buffer)
                self._overrun = True
                self._buffer.clear()
            if index < len(pieces) - 1:
                frame = self._close()
                if frame is not None:
                    frames.append(frame)
        return frames

    def _close(self) -> Frame | None:
        raw, self._buffer = bytes(self._buffer), bytearray()
        overrun, self._overrun = self._overrun, False
        if not raw and not overrun:
            return None  # idle delimiters are allowed between frames
        try:
            body = _unstuff(raw) if not overrun else b""
        except cobs.DecodeError:
            body = b""
        if len(body) < _OVERHEAD or crc16.ibm_sdlc(body[:-2]) != int.from_bytes(body[-2:], "little"):
            self.bad_frames += 1
            self._keep(raw)
            return None
        return Frame(body[0], body[1], body[2:-2])

    def _keep(self, garbage: bytes | bytearray) -> None:
        if not self.sample:
            self.sample = bytes(garbage[:_SAMPLE])
