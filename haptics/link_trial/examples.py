"""One example of each message: what the golden frames of the protocol page carry, and what conformance sends.

A message that is added to the table gets its example here; ``tools/protocol_page.py`` writes its golden frame.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from haptics.link.messages import BY_NAME, Fault, State, Status, encode
from haptics.link_trial.raw_frames import frame


class Example(NamedTuple):
    """Sequence number and fields of one frame.

    :param seq: 0 where the message carries no number.
    :param values: its fields in the order of the message table.
    """

    seq: int
    values: tuple[Any, ...] = ()


EXAMPLES: dict[str, Example] = {
    "identify": Example(0),
    "sync": Example(0, (7,)),
    "configure": Example(1, ((200, 2000, 32, 4500, 2500),)),
    "arm": Example(2, (0xC0FFEE01,)),
    "disarm": Example(3),
    "stop": Example(4),
    "keepalive": Example(0),
    "pulse": Example(5, (0x01020304, 0b11, 0b01, (160, 120, *[0] * 13))),
    "cancel": Example(6, (0x7FFF,)),
    "drive": Example(7, (2_000_000, 0b10, 1000, 300, 200)),
    "piezo": Example(8, (2_000_000, 0b1, 50)),
    "identity": Example(0, (1, 1, 15, 2_000_000, 0x89ABCDEF, 0xC0FFEE01, b"1.0.0\0\0\0", 100, (200, 2000, 32, 4500, 2500))),
    "sync_reply": Example(0, (7, 1000, 1100)),
    "reply": Example(5, (Status.LATE, 0x01020384, 4)),
    "tactiles_telemetry": Example(0, (4_000_000, State.ARMED, 0, (1, 2, *[0] * 13), (50, 1, *[0] * 13), 5000, 0, 1, 0, 0)),
    "brake_telemetry": Example(
        0, (4_000_000, State.DRIVING, 0, (0, 1000, 0, 0, 0), (0, 1500, 0, 0, 0), (0, 12, 0, 0, 0), 1040, 90, 0, 0, 0)
    ),
    "fault": Example(0, (4_000_000, Fault.DEAD_MAN, 255, 101)),
}


def example_payload(name: str) -> bytes:
    """Encoded fields of a message's example.

    :param name: in the message table.
    :return: its payload.
    """
    return encode(name, *EXAMPLES[name].values)


def example_frame(name: str) -> bytes:
    """Wire bytes of a message's example, by the coder that is written from the protocol page alone.

    :param name: in the message table.
    :return: the frame, delimiter included.
    """
    return frame(BY_NAME[name].type, EXAMPLES[name].seq, example_payload(name))
