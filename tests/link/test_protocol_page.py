"""The protocol page, the message table and the frame coder say the same; golden bytes are checked by independent code."""

from __future__ import annotations

import re
import runpy

import pytest
from board_double import PROTOCOL_PAGE, SCHEMA_HASH, crc16_x25, frame, parse

from haptics.link.framing import Deframer, encode_frame
from haptics.link.messages import BY_NAME, MESSAGES, Fault, State, Status, decode, encode, payload_size, schema_hash
from haptics.link.session import LinkSession
from haptics.link_trial.examples import EXAMPLES

PAGE = PROTOCOL_PAGE.read_text()
TOOL = PROTOCOL_PAGE.parents[2] / "tools" / "protocol_page.py"
GOLDEN = [
    (row[0].strip(), bytes.fromhex(row[1]), bytes.fromhex(row[2]), bytes.fromhex(row[3]))
    for row in (line.split("|") for line in re.search(r"```golden\n(.*?)```", PAGE, re.S).group(1).splitlines())
]


def test_check_value_of_the_crc():
    assert crc16_x25(b"123456789") == 0x906E  # the published check value of CRC-16/X-25


@pytest.mark.parametrize(("name", "head", "payload", "wire"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_golden_frame(name, head, payload, wire):
    assert frame(head[0], head[1], payload) == wire
    assert parse(wire[:-1]) == (head[0], head[1], payload)
    assert encode_frame(BY_NAME[name].type, head[1], encode(name, *EXAMPLES[name].values)) == wire
    assert Deframer().feed(wire) == [(head[0], head[1], payload)]
    values = tuple(decode(name, payload))
    assert values == EXAMPLES[name].values


def test_every_message_has_a_golden_frame():
    assert list(EXAMPLES) == [message.name for message in MESSAGES], "haptics/link_trial/examples.py has one of each message"
    assert [row[0] for row in GOLDEN] == [message.name for message in MESSAGES], "run make protocol"


def test_a_session_handles_all_that_a_board_sends():
    """``LinkSession`` has a handler for each; a message without one would end the thread that reads the port."""
    handled = set(LinkSession(None, "a port")._handlers)
    assert handled == {message.type for message in MESSAGES if message.sender == "board"}


def test_the_page_is_what_its_tool_writes():
    assert runpy.run_path(str(TOOL))["up_to_date"](PAGE) == PAGE, "run make protocol"


def test_the_tool_writes_the_row_and_the_frame_of_a_new_message():
    """A message that the page lacks appears in both; all other lines stay."""
    lines = PAGE.splitlines(keepends=True)
    without = "".join(line for line in lines if not re.match(r"\| 0x11 \| cancel|cancel \| 11", line))
    assert len(without) < len(PAGE)
    assert runpy.run_path(str(TOOL))["up_to_date"](without) == PAGE


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
