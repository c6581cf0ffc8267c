"""Rules of bytes: what a board cannot read it does not answer, and what it can read and does not know it refuses."""

from __future__ import annotations

from haptics.link.messages import (
    BY_NAME,
    BY_TYPE,
    MESSAGES,
    Status,
    payload_size,
)
from haptics.link_trial.raw_frames import checksum, frame, stuffed
from haptics.link_trial.raw_host import RawHost, need, reply_in_words
from haptics.link_trial.rules.rule import Rules

RULES = Rules()


@RULES.rule("unknown", "A message that the table lacks, or that is not for this board, is unknown")
def _unknown(host: RawHost) -> str:
    mine = {message.type for message in MESSAGES if message.sender == "host" and host.board in message.boards}
    beside = {message.type + 1 for message in MESSAGES} - set(BY_TYPE)  # the first number behind each run
    others = sorted({0x00, 0x33, 0x7F, 0xFF, *beside, *BY_TYPE} - mine)
    for type_ in others:
        for payload in (b"", bytes(range(1, 12)), bytes(64)):
            found = host.answers(frame(type_, 0, payload))
            need(len(found) == 1 and found[0].name == "reply", f"type {type_:#04x} brought {found}")
            need(
                (found[0].message.status, found[0].message.detail) == (Status.UNKNOWN, 0),
                f"{type_:#04x}: {reply_in_words(found[0].message)}",
            )
    return f"{len(others)} types"


@RULES.rule("bad-length", "A payload that does not fit its type is bad_length, and does nothing")
def _bad_length(host: RawHost) -> str:
    tried = 0
    for message in MESSAGES:
        if message.sender != "host" or host.board not in message.boards:
            continue
        size = payload_size(message.name)
        for length in {0, size - 1, size + 1, 64} - {size, -1}:
            found = host.answers(frame(message.type, 0, bytes(length)))
            need(len(found) == 1 and found[0].name == "reply", f"{message.name} with {length} bytes brought {found}")
            reply = found[0].message
            need(
                (reply.status, reply.detail) == (Status.BAD_LENGTH, 0),
                f"{message.name} with {length} bytes: {reply_in_words(reply)}",
            )
            tried += 1
    return f"{tried} frames"


@RULES.rule("keepalive", "keepalive is not answered")
def _keepalive(host: RawHost) -> str:
    for seq in (0, 5):
        found = host.answers(frame(BY_NAME["keepalive"].type, seq), wait_ms=10)
        need(not found, f"number {seq} brought {found}")
    return "silence"


def _ignored(host: RawHost, data: bytes, counted: int) -> str:
    """Bytes that are no frame: never answered, counted so often, and over at the next delimiter."""
    before = host.telemetry().bad_frames
    found = host.answers(data, wait_ms=10 if host.simulated is not None else 50)
    need(not found, f"it was answered: {found[0].name if found else ''}")
    host.ask("sync", 7)
    bad = (host.telemetry().bad_frames - before) % 65536
    need(bad == counted, f"bad_frames rose by {bad}; expected {counted}")
    return f"no answer, bad_frames rose by {bad}, the next frame was understood"


_DISARM = bytes((BY_NAME["disarm"].type, 9))


@RULES.rule("bad-frames.crc", "A frame with a wrong checksum is not answered, but counted")
def _wrong_crc(host: RawHost) -> str:
    crc = checksum(_DISARM)
    wrong = (crc[::-1], bytes((crc[0] ^ 1, crc[1])), bytes((crc[0], crc[1] ^ 0x80)), bytes(byte ^ 0xFF for byte in crc))
    return _ignored(host, b"".join(stuffed(_DISARM + one) + b"\0" for one in wrong), len(wrong))


@RULES.rule("bad-frames.zeros", "Zeros appended to a frame make it invalid")
def _appended_zeros(host: RawHost) -> str:
    whole = _DISARM + checksum(_DISARM)
    return _ignored(host, b"".join(stuffed(whole + bytes(count)) + b"\0" for count in (1, 2, 3)), 3)


@RULES.rule("bad-frames.cobs", "Bytes that are not COBS are not answered, but counted")
def _bad_cobs(host: RawHost) -> str:
    return _ignored(host, b"\x09\x05\x03\x64\x43\0" + b"\x05\x05\x03\x64\0" + b"\x01\0", 3)


@RULES.rule("bad-frames.truncated", "A frame cut short ends at the next delimiter")
def _truncated(host: RawHost) -> str:
    return _ignored(host, frame(BY_NAME["configure"].type, 9, bytes(range(1, 9)))[:7] + b"\0", 1)


@RULES.rule("bad-frames.long", "An overlong frame counts once, however long, and ends at the next delimiter")
def _too_long(host: RawHost) -> str:
    body = bytes((0x33, 9)) + bytes(range(1, 66))
    long = stuffed(body + checksum(body)) + b"\0"
    return _ignored(host, long + b"\x55" * 300 + b"\0", 2)


@RULES.rule("bad-frames.longest", "The longest frame is understood")
def _longest(host: RawHost) -> str:
    found = host.answers(frame(0x33, 0, bytes(range(1, 65))))
    need([one.message.status for one in found] == [Status.UNKNOWN], f"64 bytes of payload brought {found}")
    return "64 bytes of payload answered"


@RULES.rule("bad-frames.idle", "Empty frames are ignored")
def _idle(host: RawHost) -> str:
    return _ignored(host, b"\0" * 20, 0)


@RULES.rule("frames.whole", "A board sends only whole frames of its own messages")
def _whole(host: RawHost) -> str:
    before = len(host.strange)
    host.ask("sync", 0)  # zeros in the answer too
    numbers = host.flood("disarm", count=64)
    host.run(100)
    strange = host.strange[before:]
    need(not strange, f"{len(strange)} pieces were none, the first {strange[0].hex(' ') if strange else ''}")
    return f"{len(numbers)} replies and telemetry, and nothing else"
