"""The protocol page, the message table and the frame coder say the same; golden bytes are checked by independent code."""

from __future__ import annotations

import re

import pytest
from board_double import PROTOCOL_PAGE, SCHEMA_HASH, crc16_x25, frame, parse

from haptics.link.framing import Deframer, encode_frame
from haptics.link.messages import BY_NAME, MESSAGES, Fault, State, Status, decode, encode, payload_size, schema_hash

PAGE = PROTOCOL_PAGE.read_text()
GOLDEN = [
    (row[0].strip(), bytes.fromhex(row[1]), bytes.fromhex(row[2]), bytes.fromhex(row[3]))
    for row in (line.split("|") for line in re.search(r"```golden\n(.*?)```", PAGE, re.S).group(1).splitlines())
]
VALUES = {
    "sync": (7,),
    "configure": ((200, 2000, 32, 4500, 2500),),
    "arm": (0xC0FFEE01,),
    "pulse": (0x01020304, 0b11, 0b01, (160, 120, *[0] * 13)),
    "cancel": (0x7FFF,),
    "drive": (2_000_000, 0b10, 1000, 300, 200),
    "piezo": (2_000_000, 0b1, 50),
    "identity": (1, 1, 15, 2_000_000, 0x89ABCDEF, 0xC0FFEE01, b"1.0.0\0\0\0", 100, (200, 2000, 32, 4500, 2500)),
    "sync_reply": (7, 1000, 1100),
    "reply": (Status.LATE, 0x01020384, 4),
    "tactiles_telemetry": (4_000_000, State.ARMED, 0, (1, 2, *[0] * 13), (50, 1, *[0] * 13), 5000, 0, 1, 0, 0),
    "brake_telemetry": (4_000_000, State.DRIVING, 0, (0, 1000, 0, 0, 0), (0, 1500, 0, 0, 0), (0, 12, 0, 0, 0), 1040, 90, 0, 0, 0),
    "fault": (4_000_000, Fault.DEAD_MAN, 255, 101),
}


def test_check_value_of_the_crc():
    assert crc16_x25(b"123456789") == 0x906E  # the published check value of CRC-16/X-25


@pytest.mark.parametrize(("name", "head", "payload", "wire"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_golden_frame(name, head, payload, wire):
    assert frame(head[0], head[1], payload) == wire
    assert parse(wire[:-1]) == (head[0], head[1], payload)
    assert encode_frame(BY_NAME[name].type, head[1], encode(name, *VALUES.get(name, ()))) == wire
    assert Deframer().feed(wire) == [(head[0], head[1], payload)]
    values = tuple(decode(name, payload))
    assert values == VALUES.get(name, ())


def test_every_message_has_a_golden_frame():
    assert [row[0] for row in GOLDEN] == [message.name for message in MESSAGES]


def test_published_sizes_on_the_wire():
    sizes = {row[0]: len(row[3]) for row in GOLDEN}
    assert (sizes["pulse"], sizes["reply"], sizes["tactiles_telemetry"]) == (29, 13, 68)


def test_tables_of_the_page_match_the_message_table():
    rows = re.findall(r"^\| (0x[0-9a-f]{2}) \| (\w+) \| (\w+) \| (\d+) \| (.*?) \|", PAGE, re.M)
    assert [(int(type_, 16), name, int(size)) for type_, name, _, size, _ in rows] == [
        (message.type, message.name, payload_size(message.name)) for message in MESSAGES
    ]
    for (_, _, boards, _, fields), message in zip(rows, MESSAGES, strict=True):
        assert boards == ("both" if len(message.boards) == 2 else message.boards[0].name.lower())
        written = (
            []
            if fields == "none"
            else [re.match(r"(\w+) (u8|u16|u32|char)(?: × (\d+))?", f).groups() for f in fields.split(", ")]
        )
        assert [(name, code, int(count or 1)) for name, code, count in written] == [
            (f.name, f.code, f.count) for f in message.fields
        ]


@pytest.mark.parametrize("codes", [Status, State, Fault])
def test_codes_of_the_page_match(codes):
    rows = {(int(number), name) for number, name in re.findall(r"^\| (\d+) \| (\w+) \|", PAGE, re.M)}
    assert {(int(code), code.name.lower()) for code in codes} <= rows


def test_schema_hash_of_the_page():
    assert schema_hash() == SCHEMA_HASH
