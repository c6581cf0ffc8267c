from __future__ import annotations

import pytest
from board_double import crc16_x25, frame, parse, stuff
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.link.framing import LONGEST_FRAME, Deframer, encode_frame
from haptics.link.messages import BY_NAME, decode, encode, layout

BYTE = st.integers(0, 255)


@given(BYTE, BYTE, st.binary(max_size=64))
def test_round_trip_agrees_with_an_independent_coder(type_, seq, payload):
    wire = encode_frame(type_, seq, payload)
    assert wire == frame(type_, seq, payload)
    assert wire.count(0) == 1
    assert len(wire) <= LONGEST_FRAME
    assert Deframer().feed(wire) == [(type_, seq, payload)]


@given(st.lists(st.tuples(BYTE, BYTE, st.binary(max_size=64)), max_size=6), st.lists(st.integers(1, 40), min_size=1))
def test_cuts_of_the_stream_do_not_matter(frames, cuts):
    stream = b"".join(encode_frame(*one) for one in frames)
    deframer, found = Deframer(), []
    at = 0
    while at < len(stream):
        step = cuts[at % len(cuts)]
        found += deframer.feed(stream[at : at + step])
        at += step
    assert found == frames
    assert deframer.bad_frames == 0


@given(st.binary(max_size=600))
def test_garbage_yields_nothing_but_valid_frames(noise):
    found = Deframer().feed(noise)
    possible = [parse(raw) for raw in noise.split(b"\0")[:-1] if raw]
    assert found == [one for one in possible if one is not None and len(one[2]) <= 64]


@given(st.binary(max_size=300), st.binary(max_size=64))
def test_in_step_again_after_any_noise(noise, payload):
    assert Deframer().feed(noise + b"\0" + encode_frame(3, 4, payload))[-1] == (3, 4, payload)


@given(BYTE, st.binary(max_size=60), st.integers(0, 10_000), st.integers(1, 255))
def test_a_changed_byte_is_noticed(seq, payload, where, flip):
    wire = bytearray(encode_frame(1, seq, payload))
    wire[where % (len(wire) - 1)] ^= flip
    assert (1, seq, payload) not in Deframer().feed(bytes(wire))


@given(st.binary(max_size=40), st.integers(1, 8))
def test_appended_zeros_are_noticed(payload, zeros):
    body = b"\x06\x04" + payload
    body += crc16_x25(body).to_bytes(2, "little") + bytes(zeros)
    assert Deframer().feed(stuff(body) + b"\0") == []


def test_without_final_xor_appended_zeros_would_pass():
    """Why the CRC is X-25: the remainder of a frame with its CRC is then no constant that zeros preserve."""
    body = b"\x06\x04"
    plain = (crc16_x25(body) ^ 0xFFFF).to_bytes(2, "little")
    longer = body + plain
    assert crc16_x25(longer) ^ 0xFFFF == 0
    assert crc16_x25(longer + b"\0\0") ^ 0xFFFF == 0


def test_endless_garbage_costs_no_memory_and_counts_once():
    deframer = Deframer()
    for _ in range(1000):
        assert deframer.feed(b"\x55" * 1000) == []
        assert len(deframer._buffer) <= LONGEST_FRAME
    assert deframer.feed(b"\0" + encode_frame(7, 0)) == [(7, 0, b"")]
    assert deframer.bad_frames == 1


def test_a_payload_of_65_bytes_is_no_frame():
    assert Deframer().feed(frame(1, 1, bytes(range(1, 66)))) == []


@pytest.mark.parametrize(("args", "named"), [((1, 1, bytes(65)), "65"), ((256, 1), "256"), ((1, -1), "-1")])
def test_what_fits_no_frame_is_refused(args, named):
    with pytest.raises(InputError, match=named):
        encode_frame(*args)


_LIMITS = {"u8": 2**8 - 1, "u16": 2**16 - 1, "u32": 2**32 - 1}


@given(st.data(), st.sampled_from(sorted(BY_NAME)))
def test_messages_round_trip(data, name):
    values = []
    for field in layout(name)[2]:
        if field.code == "char":
            values.append(data.draw(st.binary(min_size=field.count, max_size=field.count)))
            continue
        number = st.integers(0, _LIMITS[field.code])
        one = number if field.count == 1 else st.tuples(*[number] * field.count)
        values.append(data.draw(one))
    assert tuple(decode(name, encode(name, *values))) == tuple(values)


@pytest.mark.parametrize(
    ("name", "values", "named"),
    [("nonsense", (), "nonsense"), ("sync", (), "1 fields"), ("sync", (-1,), "-1"), ("configure", ((1, 2),), "takes 5")],
)
def test_what_fits_no_message_is_refused(name, values, named):
    with pytest.raises(InputError, match=named):
        encode(name, *values)
