"""The C core's common part: frames to the byte, one reply each, faults that latch, off when left alone, in time for ever."""

from __future__ import annotations

import ctypes
import random
import re
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest
from core_bench import BOOT_ID, BUILT, FEED, FIRMWARE, MS, WRAP, Bench, crc16_x25, frame, in_ticks, stuffed

from haptics.link.framing import Deframer
from haptics.link.messages import BY_NAME, BY_TYPE, MESSAGES, TICK_HZ, Board, Fault, State, Status, encode, schema_hash

BOTH = pytest.mark.parametrize("board", [Board.TACTILES, Board.BRAKE])
PAGE = FIRMWARE.parents[1] / "docs" / "reference" / "protocol.md"
TEN_MS = [200] * 15


@pytest.fixture
def bench(library) -> Iterator[Callable[..., Bench]]:
    opened: list[Bench] = []

    def open_bench(*args, **kwargs) -> Bench:
        opened.append(Bench(library, *args, **kwargs))
        return opened[-1]

    yield open_bench
    for one in opened:
        one.close()


def golden() -> list[tuple[str, int, int, bytes, bytes]]:
    block = re.search(r"```golden\n(.*?)```", PAGE.read_text(), re.S)
    assert block
    rows = []
    for line in block[1].strip().splitlines():
        name, head, payload, wire = (part.strip() for part in line.split("|"))
        type_, seq = bytes.fromhex(head)
        rows.append((name, type_, seq, bytes.fromhex(payload), bytes.fromhex(wire)))
    return rows


def test_the_golden_frames_are_made_to_the_byte(library) -> None:
    rows = golden()
    assert {name for name, *_ in rows} == set(BY_NAME)
    for name, type_, seq, payload, wire in rows:
        buffer = (ctypes.c_uint8 * 80)(*(b"\xaa" * 3 + payload))
        size = library.frame_finish(buffer, type_, seq, len(payload))
        assert bytes(buffer[:size]) == wire, name


def test_any_frame_is_made_as_another_coder_makes_it(library) -> None:
    rng = random.Random(1)
    for _ in range(2000):
        payload = bytes(rng.choice((0, 0, 1, 255, rng.randrange(256))) for _ in range(rng.randrange(65)))
        type_, seq = rng.randrange(256), rng.randrange(256)
        buffer = (ctypes.c_uint8 * 80)(*(b"\xaa" * 3 + payload))
        size = library.frame_finish(buffer, type_, seq, len(payload))
        assert bytes(buffer[:size]) == frame(type_, seq, payload)


def test_golden_frames_of_a_host_are_understood(bench) -> None:
    """Each is answered under its own number, none is unknown or of a bad length, and none counts as bad."""
    for board in Board:
        h = bench(board)
        for name, _, seq, _, wire in golden():
            message = BY_NAME[name]
            if message.sender == "host" and board in message.boards:
                h.feed(b"\x00" + wire)
                if name != "keepalive":
                    assert h.sent[-1].seq == seq
                    assert getattr(h.sent[-1].message, "status", 0) not in (Status.UNKNOWN, Status.BAD_LENGTH), name
        h.ask("identify", seq=0)
        assert h.telemetry().bad_frames == 0


def test_noise_is_cut_into_frames_as_by_another_receiver(bench) -> None:
    """Frames of every fate in a stream, cut anywhere: what is answered and what is counted is what the host's receiver finds."""
    rng = random.Random(5)
    h, other = bench(), Deframer()
    h.ask("identify", seq=0)
    understood = 0
    for _ in range(4000):
        good = frame(BY_NAME["sync"].type, 0, rng.randbytes(4))
        fate = rng.randrange(8)
        at = rng.randrange(len(good))
        data = {
            0: good,
            1: good[:at] + bytes([good[at] ^ 1 << rng.randrange(8)]) + good[at + 1 :],
            2: good[:at] + good[at + 1 :],
            3: good[:at] + rng.randbytes(1) + good[at:],
            4: rng.randbytes(rng.randrange(200)),
            5: b"\0" * rng.randrange(4),
            6: bytes(rng.randrange(1, 256) for _ in range(rng.randrange(60, 80))) + b"\0",
            7: frame(rng.randrange(256), 0, rng.randbytes(rng.randrange(60, 65))),
        }[fate]
        frames = other.feed(data)
        before = len(h.sent)
        h.feed(data)
        answers = [s for s in h.sent[before:] if s.name in ("identity", "sync_reply", "reply")]
        expected = [f for f in frames if f.type != BY_NAME["keepalive"].type or f.payload]
        assert len(answers) == len(expected)
        understood += sum(s.name == "sync_reply" for s in answers)
    assert understood > 400
    h.run(40 * MS)
    assert h.telemetry().bad_frames == other.bad_frames > 1000


@pytest.mark.parametrize(("length", "bad"), [(68, 0), (69, 1), (70, 1), (300, 1), (1000, 1)])
def test_the_longest_frame_passes_and_a_longer_one_counts_once_and_is_over_at_its_end(bench, length, bad) -> None:
    """68 bytes and two for checksum would be too long by two: the body here is as long as the length, checksum included."""
    h = bench()
    h.ask("identify", seq=0)
    body = bytes([0x33, 9]) + bytes(1 + k % 255 for k in range(length - 4))
    crc = crc16_x25(body).to_bytes(2, "little")
    assert 0 not in body
    pieces = [body[k : k + 200] for k in range(0, length - 2, 200)]
    raw = stuffed(body + crc) if length < 200 else b"".join(bytes([len(p) + 1]) + p for p in pieces)
    before = len(h.all("reply"))
    h.feed(raw + b"\0")
    assert len(h.all("reply")) - before == (0 if bad else 1)
    h.ask("sync", 7, seq=0)
    h.run(20 * MS)
    assert h.telemetry().bad_frames == bad


@BOTH
def test_a_board_says_who_it_is(bench, board) -> None:
    h = bench(board)
    identity = h.ask("identify", seq=0)
    assert identity == (1, board, {1: 15, 2: 5}[board], TICK_HZ, schema_hash(), BOOT_ID, b"host-c\0\0", 100, BUILT[board])


@BOTH
def test_settings_make_limits_stricter_and_never_looser(bench, board) -> None:
    greater_is_stricter = {3} if board == Board.TACTILES else set()
    looser = [limit + (-1 if k in greater_is_stricter else 1) for k, limit in enumerate(BUILT[board])]
    stricter = [limit + (1 if k in greater_is_stricter else -1) for k, limit in enumerate(BUILT[board])]
    for k in range(4):
        limits = (*stricter[:k], looser[k], *stricter[k + 1 :])
        assert bench(board, limits=limits).ask("identify").limits == (*stricter[:k], BUILT[board][k], *stricter[k + 1 :])


@BOTH
def test_a_host_may_make_limits_stricter_and_never_looser(bench, board) -> None:
    h = bench(board)
    greater_is_stricter = {3} if board == Board.TACTILES else set()
    stricter = [limit + (1 if k in greater_is_stricter else -1) for k, limit in enumerate(BUILT[board])]
    assert h.answer("configure", BUILT[board]) == (Status.OK, 0)
    assert h.answer("configure", stricter) == (Status.OK, 0)
    for k in range(4):
        mixed = (*stricter[:k], BUILT[board][k], *stricter[k + 1 :])
        assert h.answer("configure", mixed) == (Status.BAD_VALUE, 0)  # one field: limits
        assert h.ask("identify").limits == tuple(stricter)


def test_an_armed_board_takes_no_limits(bench) -> None:
    h = bench()
    h.arm()
    assert h.answer("configure", BUILT[Board.TACTILES]) == (Status.INTERLOCK, 0)
    assert h.answer("disarm") == (Status.OK, 0)
    assert h.answer("configure", BUILT[Board.TACTILES]) == (Status.OK, 0)


def test_sync_stamps_arrival_and_the_first_bit_of_the_answer(bench) -> None:
    h = bench(start=WRAP - 700)
    for _ in range(20):  # the later ones wait behind the answers before
        before = len(h.sent)
        reply = h.ask("sync", 99, seq=0)
        assert (reply.token, reply.received) == (99, h.now % WRAP)
        assert reply.sent == h.sent[before].tick % WRAP
        h.run(100)
    assert h.sent[-1].tick - h.now > 1000


@BOTH
def test_what_cannot_be_read_is_said_so_and_changes_nothing(bench, board) -> None:
    h = bench(board)
    for message in MESSAGES:
        known = message.sender == "host" and board in message.boards
        size = len(encode(message.name, *_zeros(message.name)))
        for length in {0, 1, size - 1, size + 1, 24, 25, 26, 64} - {size, -1}:
            h.feed(frame(message.type, 0, bytes(length)))
            assert h.sent[-1].message.status == (Status.BAD_LENGTH if known else Status.UNKNOWN)
            assert h.sent[-1].message.detail == 0
    for type_ in sorted(set(range(256)) - set(BY_TYPE)):
        h.feed(frame(type_, 0))
        assert h.sent[-1].message.status == Status.UNKNOWN
    assert h.state == State.DISARMED
    assert h.edges == []


def _zeros(name: str) -> list:
    return [b"" if f.code == "char" else [0] * f.count if f.count > 1 else 0 for f in BY_NAME[name].fields]


@BOTH
def test_a_repetition_is_known_by_its_number_alone_and_gets_the_first_reply(bench, board) -> None:
    h = bench(board)
    first = h.ask("configure", BUILT[board], seq=40)
    h.run(5 * MS)
    assert h.ask("configure", BUILT[board], seq=40) == first
    assert h.ask("arm", BOOT_ID ^ 1, seq=40) == first
    unknown = _ask_raw(h, frame(0x33, 41))
    bad_length = _ask_raw(h, frame(BY_NAME["arm"].type, 42, b"abc"))
    assert (unknown.status, bad_length.status) == (Status.UNKNOWN, Status.BAD_LENGTH)
    h.run(5 * MS)
    assert _ask_raw(h, frame(0x33, 41)) == unknown
    assert h.ask("disarm", seq=42) == bad_length
    assert _ask_raw(h, frame(0x33, 40)) == first  # whatever it is now


def _ask_raw(h: Bench, data: bytes):
    h.feed(data)
    return h.sent[-1].message


@BOTH
def test_sixteen_replies_are_kept_and_number_zero_never(bench, board) -> None:
    h = bench(board)
    replies = {}
    for seq in range(100, 116):
        h.run(MS)
        replies[seq] = h.ask("disarm", seq=seq)
    for seq in (115, 100, 107):  # repetitions push nothing out
        assert h.ask("disarm", seq=seq) == replies[seq]
    h.run(MS)
    assert h.ask("disarm", seq=0).time == h.now
    h.run(MS)
    assert h.ask("disarm", seq=0).time == h.now
    assert h.ask("disarm", seq=100) == replies[100]
    h.ask("disarm", seq=116)
    assert h.ask("disarm", seq=101) == replies[101]
    h.run(MS)
    assert h.ask("disarm", seq=100).time == h.now


@BOTH
def test_stop_is_carried_out_whatever_its_number_and_kept_once(bench, board) -> None:
    h = bench(board)
    kept = h.ask("configure", BUILT[board], seq=60)
    h.arm()
    h.run(MS)
    stopped = h.ask("stop", seq=60)  # the number of another command, whose reply is still kept
    assert (stopped.status, h.state) == (Status.OK, State.DISARMED)
    assert stopped.time != kept.time
    for seq in range(61, 76):
        h.ask("stop", seq=60)
        h.ask("disarm", seq=seq)
    h.run(MS)
    assert h.ask("disarm", seq=61).time != h.now  # fifteen others, and all are still there


def test_identify_empties_the_kept_replies_and_is_always_answered(bench) -> None:
    h = bench()
    h.ask("disarm", seq=9)
    h.run(MS)
    h.ask("identify", seq=9)
    assert h.sent[-1].name == "identity"
    assert h.ask("disarm", seq=9).time == h.now


def test_a_keepalive_is_not_answered(bench) -> None:
    h = bench()
    h.send("keepalive", seq=0)
    h.send("keepalive", seq=5)
    assert h.sent == []


def test_a_repeated_pulse_never_plays_twice(bench) -> None:
    h = bench()
    h.arm()
    start = in_ticks(h.now, 5)
    first = h.ask("pulse", start, 1, 1, TEN_MS, seq=77)
    for _ in range(5):
        h.run(7 * MS)
        assert h.ask("pulse", start, 1, 1, TEN_MS, seq=77) == first
    h.ask("identify", seq=0)
    assert h.telemetry().played[0] == 1
    assert h.telemetry().late == 0


def test_arming_needs_the_boot_id_and_is_explicit(bench) -> None:
    h = bench()
    assert h.answer("arm", BOOT_ID ^ 1) == (Status.BAD_VALUE, 0)
    assert (h.state, h.edges) == (State.DISARMED, [])
    h.arm()
    assert (h.state, h.edges) == (State.ARMED, [(h.now, FEED)])
    assert h.answer("arm", BOOT_ID ^ 1) == (Status.BAD_VALUE, 0)
    h.arm()  # again: changes nothing
    assert len(h.edges) == 1
    for command in ("stop", "disarm"):
        assert h.answer(command) == (Status.OK, 0)
        assert (h.state, h.word) == (State.DISARMED, 0)
        h.live(300 * MS)
        assert (h.state, h.word) == (State.DISARMED, 0)
        h.arm()


@pytest.mark.parametrize("start", [0, 1, WRAP - 100_000, WRAP - 200_000, WRAP - 1, 1 << 31])
def test_the_dead_man_fires_to_the_tick_across_any_wrap(bench, start) -> None:
    h = bench(start=start)
    h.arm()
    h.run(150_000)
    h.send("keepalive", seq=0)
    heard = h.now
    h.run(199_999)
    assert (h.state, h.word) == (State.ARMED, FEED)
    h.run(1)
    assert (h.state, h.word, h.faults) == (State.FAULT, 0, 1 << Fault.DEAD_MAN)
    fault = h.all("fault")[-1]
    assert fault.tick == heard + 200_000
    assert fault.message == (fault.tick % WRAP, Fault.DEAD_MAN, 255, 100)
    h.run(1000 * MS)
    assert len(h.all("fault")) == 1
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 1 << Fault.DEAD_MAN)
    assert h.answer("stop") == (Status.OK, 1 << Fault.DEAD_MAN)
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 1 << Fault.DEAD_MAN)
    assert h.state == State.FAULT
    assert h.answer("disarm") == (Status.OK, 0)
    assert h.state == State.DISARMED
    h.arm()


def test_a_frame_at_the_very_tick_of_the_dead_man_is_too_late(bench) -> None:
    h = bench()
    h.arm()
    h.run(199_999)
    h.send("keepalive", seq=0)
    h.now += 200_000  # the frame below is the first that the board sees of this tick
    h.send("keepalive", seq=0)
    assert h.state == State.FAULT


def test_only_a_frame_that_is_whole_and_known_and_of_right_length_feeds_the_dead_man(bench) -> None:
    no_frames = (
        b"",
        b"\0",
        b"\x05\x01\x02\x03\x04\0",
        frame(0x33, 0),
        frame(BY_NAME["stop"].type, 0, b"1"),
        frame(0x20, 0, bytes(11)),
    )
    for data in no_frames:
        h = bench()
        h.arm()
        h.run(150_000)
        h.feed(data)
        h.run(50_000)
        assert h.faults == 1 << Fault.DEAD_MAN
    for name, values in (("sync", (1,)), ("identify", ()), ("keepalive", ()), ("cancel", (1,)), ("configure", ((0,) * 5,))):
        h = bench()
        h.arm()
        h.run(150_000)
        h.send(name, *values, seq=0)
        h.run(50_000)
        assert h.state == State.ARMED


def test_a_repetition_feeds_the_dead_man_too(bench) -> None:
    h = bench()
    assert h.answer("arm", BOOT_ID, seq=5) == (Status.OK, 0)
    for _ in range(5):
        h.run(150_000)
        h.send("arm", BOOT_ID, seq=5)
    assert h.state == State.ARMED


LONG = pytest.param(5 * WRAP + 7, marks=pytest.mark.soak)  # three hours


@pytest.mark.parametrize("idle", [(1 << 31) - 1, 1 << 31, (1 << 31) + 12_345, WRAP - 1, WRAP + 5, LONG])
def test_nothing_is_confused_after_minutes_or_hours_of_silence(bench, idle) -> None:
    """A time stamp that is older than half the counter looks as if it were to come."""
    h = bench()
    h.ask("identify", seq=0)
    h.arm()
    assert h.answer("pulse", in_ticks(h.now, 20), 1, 0, TEN_MS) == (Status.OK, 0)
    h.live(60 * MS)
    assert h.answer("disarm") == (Status.OK, 0)
    while idle:  # a jump is shorter than the counter
        step = min(idle, WRAP - 1)
        h.jump(step)
        idle -= step
    assert h.state == State.DISARMED
    h.arm()
    start = in_ticks(h.now, 20)
    assert h.answer("pulse", start, 2, 0, TEN_MS) == (Status.OK, 0)
    h.edges.clear()
    armed = h.now
    h.run(250 * MS)
    assert h.edges == [(armed + 20 * MS, FEED | 2), (armed + 30 * MS, FEED), (armed + 100 * MS, 0)]
    ticks = [s.tick for s in h.all("tactiles_telemetry") if s.tick > armed]
    assert len(ticks) in (12, 13)


def test_stop_passes_every_queue_and_answers_what_is_latched(bench) -> None:
    h = bench()
    h.arm()
    for k in range(21):
        assert h.answer("pulse", in_ticks(h.now, 5 + 20 * k), 0b111, 0b101, TEN_MS) == (Status.OK, 0)
    h.run(8 * MS)
    assert h.word == FEED | 0b111 | 0b101 << 16
    assert h.answer("stop") == (Status.OK, 0)
    assert h.edges[-1] == (h.now, 0)
    h.arm()
    h.live(500 * MS)
    assert h.word == FEED
    assert len(h.edges) == 4  # armed, three coils on, off, armed


def test_a_brown_out_is_latched_until_disarm(bench) -> None:
    h = bench(brown_out=True)
    assert h.faults == 1 << Fault.BROWN_OUT
    assert h.answer("arm", BOOT_ID) == (Status.INTERLOCK, 1 << Fault.BROWN_OUT)
    assert h.answer("stop") == (Status.OK, 1 << Fault.BROWN_OUT)
    assert h.answer("disarm") == (Status.OK, 0)
    h.arm()


@BOTH
def test_telemetry_waits_for_identify_and_comes_each_20_ms(bench, board) -> None:
    h = bench(board, start=WRAP - 500 * MS)
    h.run(200 * MS)
    assert h.sent == []
    h.ask("identify", seq=0)
    asked = h.now
    h.run(1000 * MS)
    ticks = [s.tick for s in h.all(f"{board.name.lower()}_telemetry")]
    assert ticks == [asked + 20 * MS * k for k in range(1, 51)]
    assert [s.message.time for s in h.sent[1:]] == [tick % WRAP for tick in ticks]


@pytest.mark.parametrize("baud", [9600, 38_400, 57_600, 115_200, 500_000])
def test_telemetry_keeps_to_its_share_of_any_line(bench, baud) -> None:
    """Two frames are never closer than 5/2 of the time that one of 68 bytes takes."""
    h = bench(byte_ticks=10 * TICK_HZ // baud)
    h.ask("identify", seq=0)
    h.run(5000 * MS)
    ticks = [s.tick for s in h.all("tactiles_telemetry")]
    min_ticks = max(20 * MS, 68 * h.byte_ticks * 5 // 2)
    assert {b - a for a, b in pairwise(ticks)} == {min_ticks}


def test_telemetry_waits_while_the_line_is_busy_and_replies_never_do(bench) -> None:
    """Questions come faster than answers leave: all are answered, in order, and telemetry takes what is left: nothing."""
    h = bench()
    h.ask("identify", seq=0)
    h.run(1000)
    for seq in range(200):
        h.send("sync", seq, seq=0)
        h.run(600)  # its answer takes 720
    assert [s.message.token for s in h.all("sync_reply")] == list(range(200))
    assert h.all("tactiles_telemetry") == []
    busy_until = h.all("sync_reply")[-1].tick + 18 * 40
    h.run(100 * MS)
    assert [s.tick for s in h.all("tactiles_telemetry")][:2] == [busy_until, busy_until + 20 * MS]


def test_cutting_time_differently_changes_nothing(library, bench) -> None:
    """The same commands, run from event to event, in steps of any size, and asked for the next event in between."""

    def play(cut: Callable[[Bench, int], None]) -> tuple[list, list]:
        h = bench(start=WRAP - 100 * MS)
        rng = random.Random(3)
        h.ask("identify", seq=0)
        h.arm()
        for _ in range(60):
            start = in_ticks(h.now, rng.uniform(0, 30))
            h.send("pulse", start, 1 << rng.randrange(15), rng.randrange(1 << 15), [rng.randrange(1, 201)] * 15)
            cut(h, rng.randrange(1, 20 * MS))
        cut(h, 300 * MS)
        return h.sent, h.edges

    def in_pieces(h: Bench, ticks: int) -> None:
        rng = random.Random(ticks)
        while ticks:
            step = min(ticks, rng.choice((1, 7, 100, 1999, 2000, 2001)))
            h.run(step)
            assert h.next >= 1
            ticks -= step

    sent, edges = play(Bench.run)
    assert play(in_pieces) == (sent, edges)
    assert len(edges) > 60


def test_many_boards_live_in_one_process(bench) -> None:
    a, b = bench(), bench(start=5)
    a.arm()
    assert (a.state, b.state) == (State.ARMED, State.DISARMED)
    b.arm()
    a.answer("stop")
    assert (a.word, b.word) == (0, FEED)


def test_there_is_no_third_board(library) -> None:
    assert library.host_new(3, None, 0, 0, 0, None, None, None) is None
