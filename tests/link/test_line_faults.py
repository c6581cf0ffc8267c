"""Faults of a line: their text, their statistics, what they do to frames, and the wrapper that plays them on any port."""

from __future__ import annotations

import math

import pytest
from serial import SerialException, SerialTimeoutException

from haptics.errors import InputError
from haptics.link import open_port
from haptics.link.framing import Deframer, encode_frame
from haptics.link.line_faults import FrameCutter, FrameFaults, LineFaults, parse_faults
from haptics.link_trial.faulty_port import FaultyPort

MS = 1_000_000
FRAME = encode_frame(0x10, 5, bytes(range(23)))
KINDS = ("corrupt", "drop", "lose", "insert", "truncate", "duplicate", "delay")


def always(**faults: float) -> FrameFaults:
    return FrameFaults(LineFaults(**faults), 1, "out")


def test_text_becomes_faults():
    assert parse_faults("corrupt=0.01, drop=0.02,delay=0.005,delay_ms=12,garbage=40") == LineFaults(
        corrupt=0.01, drop=0.02, delay=0.005, delay_ms=12.0, garbage=40
    )
    assert parse_faults("") == LineFaults()
    assert parse_faults("unplug_s=2").ends_the_link
    assert not parse_faults("dtr_reset=1,drop=1").ends_the_link


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("corupt=0.01", ("unknown key 'corupt'", "did you mean corrupt?", "known keys: corrupt, drop")),
        ("corrupt", ("corrupt", "corrupt=NUMBER")),
        ("drop=2", ("drop = 2", "0 to 1")),
        ("drop=-0.1", ("drop = -0.1", "0 to 1")),
        ("drop=nan", ("drop = nan", "0 to 1")),
        ("drop=often", ("drop", "often", "0 to 1")),
        ("drop=0.1,drop=0.2", ("drop", "twice")),
        ("garbage=1.5", ("garbage = 1.5", "whole")),
        ("dtr_reset=2", ("dtr_reset = 2", "0 to 1")),
        ("unplug_s=-1", ("unplug_s = -1", "s")),
    ],
)
def test_what_is_no_fault_is_refused_by_name_with_what_is_allowed(text, named):
    with pytest.raises(InputError) as refused:
        parse_faults(text)
    for word in named:
        assert word in str(refused.value)


def test_a_sound_line_changes_nothing():
    assert always().play(FRAME) == [(0, FRAME)]


def test_each_fault_does_what_it_says_and_no_more():
    for _ in range(200):
        [(late, flipped)] = always(corrupt=1.0).play(FRAME)
        assert late == 0
        assert sum((a ^ b).bit_count() for a, b in zip(flipped, FRAME, strict=True)) == 1
    faults = always(lose=1.0)
    for _ in range(200):
        [(_, shorter)] = faults.play(FRAME)
        assert any(shorter == FRAME[:at] + FRAME[at + 1 :] for at in range(len(FRAME)))
    faults = always(insert=1.0)
    for _ in range(200):
        [(_, longer)] = faults.play(FRAME)
        assert any(longer[:at] + longer[at + 1 :] == FRAME for at in range(len(longer)))
    faults = always(truncate=1.0)
    for _ in range(200):
        for _, head in faults.play(FRAME):
            assert len(head) < len(FRAME)
            assert FRAME.startswith(head)
    assert always(drop=1.0).play(FRAME) == []
    assert always(duplicate=1.0).play(FRAME) == [(0, FRAME), (0, FRAME)]
    assert always(delay=1.0, delay_ms=7.5).play(FRAME) == [(7_500_000, FRAME)]


@pytest.mark.parametrize("kind", KINDS)
def test_each_fault_comes_as_often_as_it_is_said_to(kind):
    # 20 000 frames at 0.1: binomial, standard deviation 42; five of them either way
    faults, frames = FrameFaults(LineFaults(**{kind: 0.1}), 7, "in"), 20_000
    changed = sum(faults.play(FRAME) != [(0, FRAME)] for _ in range(frames))
    by_chance_equal = 1 - 1 / (256 * 31) if kind == "insert" else 1.0  # at most; within the bound below
    assert changed == pytest.approx(2000 * by_chance_equal, abs=5 * math.sqrt(frames * 0.1 * 0.9))


def test_same_seed_same_faults_and_the_two_directions_differ():
    faults = LineFaults(**dict.fromkeys(KINDS, 0.3))

    def played(seed: int, direction: str) -> list[list[tuple[int, bytes]]]:
        player = FrameFaults(faults, seed, direction)
        return [player.play(FRAME) for _ in range(50)]

    assert played(1, "in") == played(1, "in")
    assert played(1, "in") != played(1, "out")
    assert played(1, "in") != played(2, "in")


def test_a_stream_is_cut_into_frames_however_it_comes_in():
    stream = FRAME * 3 + b"\x00" + FRAME[:-1]
    for size in (1, 2, 7, 31, 200):
        cutter, frames = FrameCutter(), []
        for at in range(0, len(stream), size):
            frames += cutter.cut(stream[at : at + size])
        assert frames == [FRAME, FRAME, FRAME, b"\x00"]
    cutter = FrameCutter()
    endless = b"\x01" * 500
    assert b"".join(cutter.cut(endless)) == endless  # no frame: handed on, and not kept without end


# On any port.


class Wire:
    """A port that keeps what is written and gives what it was given."""

    def __init__(self):
        self.written, self.given, self.is_open = bytearray(), bytearray(), True

    @property
    def in_waiting(self) -> int:
        return len(self.given)

    def read(self, size: int = 1) -> bytes:
        data = bytes(self.given[:size])
        del self.given[:size]
        return data

    def write(self, data: bytes) -> int:
        self.written += data
        return len(data)

    def close(self) -> None:
        self.is_open = False


class Watch:
    now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


def wrapped(**faults: float) -> tuple[FaultyPort, Wire, Watch]:
    wire, watch = Wire(), Watch()
    return FaultyPort(wire, LineFaults(**faults), 1, watch), wire, watch


def test_without_faults_a_wrapped_port_is_the_port():
    port, wire, _ = wrapped()
    assert port.write(FRAME + FRAME[:3]) == len(FRAME) + 3
    assert bytes(wire.written) == FRAME + FRAME[:3]
    wire.given += FRAME
    assert port.in_waiting == len(FRAME)
    assert port.read(4) + port.read(100) == FRAME
    assert port.read(1) == b""
    assert port.is_open
    port.close()
    assert not wire.is_open


def test_late_frames_keep_their_order_both_ways():
    port, wire, watch = wrapped(delay=0.5, delay_ms=30)
    sent = [encode_frame(0x10, number, bytes(23)) for number in range(1, 101)]
    heard = bytearray()
    for frame in sent:
        port.write(frame)
        wire.given += frame
        heard += port.read(1000)
        watch.now_ns += MS
    assert len(wire.written) < 100 * len(sent[0])
    watch.now_ns += 31 * MS
    heard += port.read(10_000)
    assert bytes(heard) == b"".join(sent)
    assert [frame.seq for frame in Deframer().feed(bytes(wire.written))] == list(range(1, 101))


def test_an_unplugged_port_fails_in_the_middle_of_a_write_and_ever_after():
    port, wire, watch = wrapped(unplug_s=1.0)
    port.write(FRAME)
    watch.now_ns = 1000 * MS
    with pytest.raises(SerialException):
        port.write(FRAME)
    assert bytes(wire.written) == FRAME + FRAME[: len(FRAME) // 2]
    with pytest.raises(SerialException):
        port.write(FRAME)
    with pytest.raises(SerialException):
        port.read(1)
    with pytest.raises(SerialException):
        _ = port.in_waiting
    assert bytes(wire.written) == FRAME + FRAME[: len(FRAME) // 2]


def test_a_peer_that_stalls_times_writes_out_and_is_still_heard():
    port, wire, watch = wrapped(stall_s=0.5)
    watch.now_ns = 500 * MS
    with pytest.raises(SerialTimeoutException):
        port.write(FRAME)
    wire.given += FRAME
    assert port.read(100) == FRAME


def test_garbage_comes_first_and_a_reset_is_the_boards_own_affair():
    port, wire, _ = wrapped(garbage=40)
    wire.given += FRAME
    data = port.read(1000)
    assert len(data) == 40 + len(FRAME)
    assert data.endswith(FRAME)
    with pytest.raises(InputError, match="dtr_reset"):
        wrapped(dtr_reset=1)


# In a simulated cable.


def test_a_sim_port_names_what_it_cannot_play():
    with pytest.raises(InputError, match="drop = 3; allowed 0 to 1"):
        open_port("sim://tactiles?faults=drop=3")
    with pytest.raises(InputError, match=r"unknown key 'rats'; known keys: corrupt"):
        open_port("sim://tactiles?faults=rats=1")


def replies(url: str, frames: int = 200) -> list[tuple[int, bytes]]:
    """What comes back, and when, for many questions."""
    port = open_port(f"sim://tactiles?clock=virtual&seed=5{url}")
    heard: list[tuple[int, bytes]] = []
    for number in range(frames):
        port.write(encode_frame(0x02, 0, number.to_bytes(4, "little")))
        end_ns = (number + 1) * 2 * MS
        while port.now_ns < end_ns:
            port.advance(min(port.next_event() or end_ns, end_ns))
            data = port.read(port.in_waiting)
            if data:
                heard.append((port.now_ns, data))
    port.close()
    return heard


def test_a_line_whose_faults_never_come_is_the_line_itself_to_the_nanosecond():
    assert replies("&faults=drop=0") == replies("")
    assert replies("&faults=drop=0.1") == replies("&faults=drop=0.1")
    assert replies("&faults=drop=0.1") != replies("")


def test_a_late_frame_is_as_late_as_it_is_said_to_be_each_way():
    [*_, (on_time_ns, _)] = replies("", 1)
    port = open_port("sim://tactiles?clock=virtual&seed=5&faults=delay=1,delay_ms=10")
    port.write(encode_frame(0x02, 0, bytes(4)))
    while not port.in_waiting:
        port.advance(port.next_event())
    assert port.now_ns - on_time_ns == pytest.approx(20 * MS, abs=40_000)  # the board takes 20 to 60 us to turn around
    port.close()
