"""Frames made and read by the letter of the page, apart from the link's own coder, so that neither vouches for itself."""

from __future__ import annotations


def checksum(data: bytes) -> bytes:
    """CRC-16/X-25, bit by bit.

    :param data: type, number and payload.
    :return: two bytes, the low one first.
    """
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0x8408 if register & 1 else 0)
    return (register ^ 0xFFFF).to_bytes(2, "little")


def stuffed(data: bytes) -> bytes:
    """COBS: data without zeros, each run led by its length plus one.

    :param data: fewer than 254 bytes between two zeros.
    :return: one byte more than ``data``, none of them zero.
    """
    return b"".join(bytes((len(run) + 1,)) + run for run in data.split(b"\0"))


def frame(type_: int, seq: int, payload: bytes = b"") -> bytes:
    """Wire bytes of a frame.

    :param type_: message type, 0 to 255.
    :param seq: sequence number, 0 to 255.
    :param payload: encoded fields.
    :return: the bytes, delimiter included.
    """
    body = bytes((type_, seq)) + payload
    return stuffed(body + checksum(body)) + b"\0"


def unstuffed(data: bytes) -> bytes | None:
    """The inverse of ``stuffed``.

    :param data: bytes without their delimiter.
    :return: what was stuffed; None if ``data`` is not COBS.
    """
    runs: list[bytes] = []
    while data:
        length, data = data[0], data[1:]
        if length == 0 or length - 1 > len(data):
            return None
        runs.append(data[: length - 1])
        data = data[length - 1 :]
    return b"\0".join(runs)
