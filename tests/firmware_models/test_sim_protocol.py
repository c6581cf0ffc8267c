"""What every simulated board does with frames: who it is, one reply each, never twice, never late, off when left alone."""

from __future__ import annotations

from itertools import pairwise

import pytest

from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, TICK_HZ, Board, Fault, State, Status, encode, schema_hash

MS = 1_000_000
BOTH = pytest.mark.parametrize("board", ["tactiles", "brake"])
STRICTER_UPWARD = {"tactiles": {3}, "brake": set()}  # the minimum supply voltage is made stricter by raising it
DURATIONS = [200] * 15


def crc16_x25(data: bytes) -> bytes:
    """Bit by bit: polynomial 0x1021 reflected, all ones at both ends, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return (crc ^ 0xFFFF).to_bytes(2, "little")


@BOTH
def test_identify_goes_out_and_comes_back_as_written_in_the_protocol(host, board) -> None:
    h = host(board, seed=3)
    body = bytes([0x01, 0x09])  # type and sequence number; no payload
    crc = crc16_x25(body)
    assert 0 not in body + crc  # so that stuffing is one leading byte
    h.port.write(bytes([5]) + body + crc[::-1] + b"\x00")  # checksum with its bytes swapped: not a frame
    h.run(5)
    assert h.raw == b""
    h.port.write(bytes([5]) + body + crc + b"\x00")
    h.run(5)
    identity = h.last("identity")
    assert h.heard[-1].seq == 9
    assert (identity.protocol, identity.board, identity.tick_hz) == (1, Board[board.upper()], TICK_HZ)
    assert (identity.channels, identity.dead_man) == ({"tactiles": 15, "brake": 5}[board], 100)
    assert identity.schema_hash == schema_hash()
    assert len(h.raw) == 4 + 35 + 2  # type, seq, checksum; payload; stuffing and delimiter
    h.run(100)
    assert h.all(f"{board}_telemetry")[-1].message.bad_frames == 1


@BOTH
def test_sync_stamps_arrival_and_departure_in_the_boards_own_ticks(host, board) -> None:
    h = host(board, ppm=0, tick_offset=2**32 - 500)
    sent_ns = h.now_ns
    reply = h.ask("sync", 99)
    frame_ns = 20_000 * len(encode_frame(2, 0, encode("sync", 99)))
    reply_ns = 20_000 * len(encode_frame(0x82, 0, encode("sync_reply", 99, 0, 0)))
    assert reply.token == 99
    assert reply.received == (2**32 - 500 + (sent_ns + frame_ns) // 500) % 2**32
    assert reply.sent == (2**32 - 500 + (h.heard[-1].time_ns - reply_ns) // 500) % 2**32


@BOTH
def test_the_clock_drifts_as_its_crystal_does(host, board) -> None:
    h = host(board, ppm=100, tick_offset=0)
    h.run(10_000)
    ticks = h.ask("sync", 1).received
    assert ticks == pytest.approx(h.now_ns / 500 * 1.0001, abs=1000)  # drift is 2000 ticks; the exchange lasts under 0.5 ms


@BOTH
def test_what_cannot_be_read_is_answered_and_does_nothing(host, board) -> None:
    h = host(board)
    boot_id = h.ask("identify").boot_id
    h.port.write(encode_frame(0x33, 201))
    h.port.write(encode_frame(BY_NAME["arm"].type, 202, b"abc"))
    h.port.write(encode_frame(BY_NAME["drive" if board == "tactiles" else "pulse"].type, 203))
    h.run(5)
    answers = [(heard.seq, heard.message.status, heard.message.detail) for heard in h.all("reply")]
    assert answers == [(201, Status.UNKNOWN, 0), (202, Status.BAD_LENGTH, 0), (203, Status.UNKNOWN, 0)]
    assert h.status("arm", boot_id ^ 1) == Status.BAD_VALUE
    assert h.port.truth()["state"] == State.DISARMED


@BOTH
def test_limits_may_only_be_made_stricter(host, board) -> None:
    h = host(board)
    limits = list(h.ask("identify").limits)
    for field in range(4):
        looser = list(limits)
        looser[field] += -1 if field in STRICTER_UPWARD[board] else 1
        assert h.status("configure", looser) == Status.BAD_VALUE
    lowered = [limit + 1 if field in STRICTER_UPWARD[board] else limit // 2 for field, limit in enumerate(limits)]
    assert h.status("configure", lowered) == Status.OK
    assert h.ask("identify").limits == tuple(lowered)
    assert h.status("configure", limits) == Status.BAD_VALUE
    h.arm()
    assert h.status("configure", lowered) == Status.INTERLOCK


def test_a_repeated_command_gets_its_first_reply_and_never_pulses_twice(host) -> None:
    h = host()
    h.arm()
    start = h.tick_in(5)
    first = h.ask("pulse", start, 1, 1, DURATIONS, seq=77)
    again = h.ask("pulse", start, 1, 1, DURATIONS, seq=77)
    assert again == first
    h.live(40)
    late = h.ask("pulse", start, 1, 1, DURATIONS, seq=77)  # long after: still the reply of then
    assert late == first
    h.live(40)
    assert h.last("tactiles_telemetry").played[0] == 1
    assert h.last("tactiles_telemetry").late == 0


def test_sixteen_replies_are_remembered_and_the_seventeenth_is_not(host) -> None:
    h = host()
    h.arm()
    start = h.tick_in(20)
    first = h.ask("pulse", start, 1, 1, DURATIONS, seq=100)
    for seq in range(101, 116):
        h.ask("cancel", 2, seq=seq)
    assert h.ask("pulse", start, 1, 1, DURATIONS, seq=100) == first
    h.ask("cancel", 2, seq=116)
    assert h.ask("pulse", start, 1, 1, DURATIONS, seq=100).status != Status.OK


def test_a_kept_number_makes_a_repetition_whatever_the_frame_says(host) -> None:
    h = host()
    h.arm()
    start = h.tick_in(30)
    first = h.ask("pulse", start, 1, 1, DURATIONS, seq=9)
    assert h.ask("pulse", start, 2, 2, DURATIONS, seq=9) == first
    assert h.ask("disarm", seq=9) == first
    assert h.port.truth()["state"] == State.ARMED
    h.port.write(encode_frame(0x33, 9))
    h.port.write(encode_frame(BY_NAME["arm"].type, 9, b"abc"))
    h.live(80)
    assert [heard.message for heard in h.all("reply") if heard.seq == 9] == [first] * 5
    assert h.last("tactiles_telemetry").played[:2] == (1, 0)


def test_number_zero_is_never_kept(host) -> None:
    h = host()
    h.arm()
    start = h.tick_in(30)
    assert h.status("pulse", start, 1, 1, DURATIONS, seq=0) == Status.OK
    reply = h.ask("pulse", start, 1, 1, DURATIONS, seq=0)
    assert (reply.status, reply.detail) == (Status.FULL, 1)  # it was asked for afresh, and the first stands in its place


@BOTH
def test_a_refusal_of_what_cannot_be_read_is_kept_like_any_reply(host, board) -> None:
    h = host(board)
    h.port.write(encode_frame(0x33, 7))
    h.run(5)
    h.port.write(encode_frame(BY_NAME["disarm"].type, 7))
    h.run(5)
    assert [heard.message.status for heard in h.all("reply")] == [Status.UNKNOWN] * 2


@BOTH
def test_a_keepalive_is_not_answered(host, board) -> None:
    h = host(board)
    h.send("keepalive", seq=0)
    h.send("keepalive", seq=5)
    h.run(20)
    assert not h.heard


def test_identify_forgets_old_replies_so_that_a_new_host_is_not_answered_from_the_past(host) -> None:
    h = host()
    boot_id = h.ask("identify").boot_id
    assert h.status("arm", boot_id, seq=1) == Status.OK
    h.run(150)
    assert h.port.truth()["state"] == State.FAULT
    h.ask("identify")
    assert h.status("arm", boot_id, seq=1) == Status.INTERLOCK


@BOTH
def test_dead_man_fires_after_a_tenth_of_a_second_of_silence_and_latches(host, board) -> None:
    h = host(board)
    h.arm()
    h.ask("sync", 1)
    fed_ns = h.now_ns
    h.listen(fed_ns + 98 * MS)
    assert h.port.truth()["state"] == State.ARMED
    h.listen(fed_ns + 101 * MS)
    assert h.port.truth()["state"] == State.FAULT
    fault = h.last("fault")
    assert (fault.code, fault.channel) == (Fault.DEAD_MAN, 255)
    h.run(30)
    assert h.last(f"{board}_telemetry").faults == 1 << Fault.DEAD_MAN
    boot_id = h.ask("identify").boot_id
    assert h.status("arm", boot_id) == Status.INTERLOCK  # traffic alone does not clear it
    assert h.status("stop") == Status.OK
    assert h.status("arm", boot_id) == Status.INTERLOCK
    assert h.status("disarm") == Status.OK
    assert h.port.truth()["state"] == State.DISARMED
    h.run(500)
    assert h.port.truth()["state"] == State.DISARMED  # nothing is armed, nothing to guard
    assert h.status("arm", boot_id) == Status.OK


@BOTH
def test_any_valid_frame_feeds_the_dead_man_and_garbage_does_not(host, board) -> None:
    h = host(board)
    h.arm()
    for _ in range(5):
        h.run(80)
        h.send("sync", 1)
    h.run(50)
    for nothing in (b"\x05\x01\x02\x03\x04\x00", encode_frame(0x33, 0), encode_frame(BY_NAME["arm"].type, 0, b"abc")):
        assert h.port.truth()["state"] == State.ARMED
        h.port.write(nothing)
        h.run(17)
    assert h.port.truth()["state"] == State.FAULT


@BOTH
def test_telemetry_waits_for_identify_and_comes_each_20_ms(host, board) -> None:
    h = host(board)
    h.send("keepalive")
    h.run(100)
    assert not h.all(f"{board}_telemetry")
    h.ask("identify")
    h.run(1000)
    times = [heard.time_ns for heard in h.all(f"{board}_telemetry")]
    assert len(times) in (49, 50)
    assert {b - a for a, b in pairwise(times)} == {20 * MS}


@pytest.mark.parametrize("baud", [9600, 38_400, 115_200])
def test_telemetry_keeps_to_its_share_of_a_slow_line(host, baud) -> None:
    h = host(baudrate=baud, baud=baud)
    h.send("identify")
    h.run(200)
    before = len(h.all("tactiles_telemetry"))
    h.run(5000)
    bits = 10 * 68 * (len(h.all("tactiles_telemetry")) - before)  # a tactiles telemetry frame has 68 bytes
    assert bits <= 0.4 * baud * 5 + 530
    assert bits > 0


def test_replies_are_never_dropped_when_the_line_is_full(host) -> None:
    h = host()
    h.ask("identify")
    for seq in range(1, 201):
        h.send("stop", seq=seq)
    h.run(500)
    assert [heard.seq for heard in h.all("reply")] == list(range(1, 201))


@BOTH
def test_the_same_seed_gives_the_same_bytes(host, board) -> None:
    def play(seed: int) -> bytes:
        h = host(board, seed=seed)
        h.arm()
        if board == "tactiles":
            h.ask("pulse", h.tick_in(3), 0b101, 0b001, DURATIONS)
        else:
            h.ask("drive", h.tick_in(3), 0b01, 1000, 200, 200)
        h.live(200)
        return bytes(h.raw)

    assert play(5) == play(5)
    assert play(5) != play(6)


def test_a_host_at_another_baud_hears_and_says_nothing_that_counts(host) -> None:
    h = host(baudrate=115_200)
    h.send("identify")
    h.run(50)
    assert not h.heard
    h.port.baudrate = 500_000
    h.port.write(b"\x00")  # ends the garbage
    h.ask("identify")
    assert h.heard[-1].name == "identity"


def test_noise_makes_no_frame_and_no_pulse(host) -> None:
    import numpy as np

    h = host()
    h.arm()
    rng = np.random.default_rng(7)
    for _ in range(50):
        h.port.write(rng.integers(0, 256, 400, dtype=np.uint8).tobytes())
        h.live(10)
    assert sum(h.port.truth()["switches"]) == 0
    assert sum(h.last("tactiles_telemetry").played) == 0
    assert h.last("tactiles_telemetry").bad_frames > 50


@BOTH
def test_stop_is_carried_out_whatever_its_number(host, board) -> None:
    h = host(board)
    h.arm()
    assert h.status("configure", h.ask("identify").limits, seq=60) == Status.INTERLOCK
    assert h.status("stop", seq=60) == Status.OK
    assert h.port.truth()["state"] == State.DISARMED
