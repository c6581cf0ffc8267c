"""The session against a board written from the protocol page, over wires that lose, delay, repeat and change what is sent."""

from __future__ import annotations

import itertools
import random
import struct

import pytest
from board_double import (
    ARM,
    CONFIGURE,
    DISARM,
    IDENTIFY,
    KEEPALIVE,
    MS,
    PULSE,
    STOP,
    SYNC,
    Bench,
    BoardDouble,
    frame,
    parse,
)
from hypothesis import given, settings, strategies as st

from haptics.errors import (
    ClockUncertain,
    CommandRefused,
    InputError,
    LinkError,
    LinkLost,
    NotABoard,
    ReplyTimeout,
    WrongFirmware,
)
from haptics.link import (
    Board,
    ClockFit,
    Disarmed,
    Failed,
    Fault,
    FaultReported,
    Identified,
    LinkSession,
    LinkSettings,
    Lost,
    Ready,
    Rebooted,
    Status,
    Telemetry,
)
from haptics.link.settings import LinkCounters
from haptics.link.sync import ClockExchanges

DURATIONS = (100, *[0] * 14)


def pulse(bench: Bench, in_ms: float = 10.0):
    at = bench.session.to_ticks(bench.now_ns + round(in_ms * MS))
    return bench.session.send("pulse", at, 1, 1, DURATIONS, now_ns=bench.now_ns)


def losing(which, times: int = 1, delay_ns: int = 300_000):
    """A wire that loses the first `times` frames of a type."""
    left = [times]

    def wire(now_ns, data):
        parsed = parse(data[:-1])
        if parsed is not None and parsed[0] == which and left[0] > 0:
            left[0] -= 1
            return None
        return delay_ns, data

    return wire


# Handshake


def test_handshake_identifies_measures_the_clock_and_arms_nothing(bench):
    bench.session.start(0)
    bench.run(50)
    assert bench.session.ready
    assert not bench.session.armed
    assert len(bench.happened(Identified)) == len(bench.happened(Ready)) == 1
    order = [type(event) for event in bench.events]
    assert order[: order.index(Ready)] == [Identified, *[ClockFit] * 8]
    heard = [type_ for type_, _, _ in bench.board.heard]
    assert heard.count(IDENTIFY) == 1
    assert heard.count(SYNC) >= 8
    assert ARM not in heard
    true_ticks = bench.board.ticks(bench.now_ns)
    error_s = (bench.session.to_ticks(bench.now_ns) - true_ticks) / 2e6
    assert abs(error_s) <= bench.session.clock.error_bound_s(bench.now_ns) < 1e-3


def test_a_board_silent_for_two_seconds_after_opening_is_found(bench):
    bench.board.silent = True
    bench.session.start(0)
    bench.run(2000)
    bench.board.silent = False
    bench.run(200)
    assert bench.session.ready


def test_identify_is_repeated_every_100_ms_and_given_up_in_words(bench):
    bench.board.silent = True
    bench.session.start(0)
    bench.run(10_000)
    assert len(bench.board.heard) == 40
    error = bench.session.error
    assert isinstance(error, NotABoard)
    assert "40 tries" in str(error)
    assert "no byte came" in str(error)
    assert "baud rate" in str(error)  # a board that hears garbage keeps silent
    assert bench.happened(Failed)[0].error is error
    assert bench.session.next_deadline_ns is None


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"\x9a\x81\xff\x12" * 10, "baud rate is probably wrong"),
        (frame(0x90, 1, bytes(7)), "none an identity"),
        (None, "what was sent came back"),
    ],
)
def test_what_answers_instead_is_told_apart(bench, answer, said):
    session = bench.session
    session.start(0)
    for now_ns in range(0, 5000 * MS, 10 * MS):
        session.poll(now_ns)
        sent = session.outgoing()
        if sent:
            session.receive(sent if answer is None else answer, now_ns)
    assert isinstance(session.error, NotABoard)
    assert said in str(session.error)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema_hash": 0xDEADBEEF}, "deadbeef"),
        ({"protocol": 9}, "protocol 9"),
        ({"kind": 2}, "brake board, not tactiles"),
        ({"kind": 77}, "board kind 77"),
    ],
)
def test_wrong_firmware_is_identified_and_nothing_more(bench, change, said):
    for name, value in change.items():
        setattr(bench.board, name, value)
    bench.session.start(0)
    bench.run(1000)
    assert isinstance(bench.session.error, WrongFirmware)
    assert said in str(bench.session.error)
    assert ("swapped" if change == {"kind": 2} else "make firmware-flash") in str(bench.session.error)
    assert {type_ for type_, _, _ in bench.board.heard} == {IDENTIFY}
    assert bench.session.stop(bench.now_ns).error is not None
    assert bench.session.outgoing() == b""


def test_any_board_is_taken_if_none_is_named():
    bench = Bench(LinkSession(None, "any"), BoardDouble())
    bench.board.kind = 2
    bench.session.start(0)
    bench.run(50)
    assert bench.session.ready
    assert bench.session.board is Board.BRAKE
    with pytest.raises(InputError, match="drive"):
        bench.session.send("pulse", 0, 1, 1, DURATIONS, now_ns=bench.now_ns)


def test_stricter_limits_are_configured_before_ready():
    bench = Bench(LinkSession(Board.TACTILES, "double", limits=(160, 2000, 32, 4500, 2500)), BoardDouble())
    bench.session.start(0)
    bench.run(50)
    assert bench.session.ready
    assert [(t, p) for t, _, p in bench.board.carried_out] == [(CONFIGURE, struct.pack("<5H", 160, 2000, 32, 4500, 2500))]


def test_looser_limits_fail_the_handshake_in_words():
    bench = Bench(LinkSession(Board.TACTILES, "double", limits=(201, 2000, 32, 4500, 2500)), BoardDouble())
    bench.session.start(0)
    bench.run(50)
    assert isinstance(bench.session.error, CommandRefused)
    assert "stricter" in str(bench.session.error)


def test_a_board_that_says_ok_to_limits_and_keeps_to_others_is_not_used():
    class Deaf(BoardDouble):
        def _carry_out(self, type_, payload, now_ns):
            kept = self.limits
            answer = super()._carry_out(type_, payload, now_ns)
            self.limits = kept
            return answer

    bench = Bench(LinkSession(Board.TACTILES, "double", limits=(200, 2000, 32, 4600, 2000)), Deaf())
    bench.session.start(0)
    bench.run(1000)
    assert isinstance(bench.session.error, LinkError)
    assert "min supply voltage 4500 mV, configured: 4600 mV" in str(bench.session.error)
    assert "on-time account 2500 ms, configured: 2000 ms" in str(bench.session.error)
    assert "coil current" not in str(bench.session.error)
    assert bench.happened(Failed)
    assert not bench.happened(Ready)
    assert bench.session.arm(bench.now_ns).error is not None


def test_an_old_identity_that_comes_late_is_not_held_against_a_board_that_was_configured():
    bench = Bench(LinkSession(Board.TACTILES, "double", limits=(200, 2000, 32, 4500, 2000)), BoardDouble())
    old: list[bytes] = []

    def twice(now_ns, data):
        """The first identity comes a second time, behind the answer to configure."""
        kind = parse(data[:-1])[0] if parse(data[:-1]) else 0
        if kind == 0x81 and not old:
            old.append(data)
        return 300_000, data + (old[0] if kind == 0x90 else b"")

    bench.down = twice
    bench.session.start(0)
    bench.run(400)
    assert bench.session.ready
    assert bench.session.identity.limits == (200, 2000, 32, 4500, 2000)


def test_a_board_that_reboots_while_its_limits_are_verified_is_configured_anew():
    bench = Bench(LinkSession(Board.TACTILES, "double", limits=(200, 2000, 32, 4500, 2000)), BoardDouble())
    bench.session.start(0)
    while bench.board.limits[4] != 2000:
        bench.run(0.1)
    bench.board.limits = (200, 2000, 32, 4500, 2500)
    bench.board.reboot(0xB0070002, bench.now_ns)
    bench.run(300)
    assert bench.session.ready
    assert bench.board.limits[4] == bench.session.identity.limits[4] == 2000


def test_firmware_whose_identity_has_another_length_is_named_as_such(bench):
    bench.board.handle = lambda data, now_ns: frame(0x81, 0, bytes(33))
    bench.session.start(0)
    bench.run(50)
    assert isinstance(bench.session.error, WrongFirmware)
    assert "its identity has 33 bytes, this package's 35" in str(bench.session.error)
    assert "make firmware-flash" in str(bench.session.error)


def test_before_ready_commands_fail_and_say_so(bench):
    assert "still idle" in str(bench.session.send("cancel", 1, now_ns=0).error)
    bench.session.start(0)
    assert "still identifying" in str(bench.session.arm(0).error)
    with pytest.raises(ClockUncertain):
        bench.session.to_ticks(0)
    with pytest.raises(ClockUncertain):
        bench.session.to_host_ns(0)


@pytest.mark.parametrize(("name", "values"), [("drive", (0, 1, 1, 1, 1)), ("sync", (1,)), ("reply", (0, 0, 0)), ("pulse", (1,))])
def test_wrong_arguments_raise(ready, name, values):
    with pytest.raises(InputError):
        ready.session.send(name, *values, now_ns=ready.now_ns)


# Commands


def test_a_pulse_is_carried_out_once_and_answered(armed):
    pending = pulse(armed)
    assert not pending.done
    armed.run(5)
    assert pending.ok
    assert pending.result() is pending
    assert armed.board.types().count(PULSE) == 1
    assert abs(pending.board_time_ns - armed.now_ns) < 5 * MS


@pytest.mark.parametrize("direction", ["up", "down"])
@pytest.mark.parametrize("times", [1, 2, 3])
def test_a_lost_command_or_reply_is_repeated_and_carried_out_once(armed, direction, times):
    setattr(armed, direction, losing(PULSE if direction == "up" else 0x90, times))
    pending = pulse(armed, in_ms=100)
    armed.run(70)
    assert pending.ok
    assert armed.board.types().count(PULSE) == 1
    assert armed.session.counters.retries == times


def test_a_repetition_is_byte_for_byte_the_same(armed):
    armed.down = losing(0x90, 2)
    pulse(armed, 100)
    armed.run(60)
    copies = [heard for heard in armed.board.heard if heard[0] == PULSE]
    assert len(copies) == 3
    assert len(set(copies)) == 1


def test_giving_up_says_that_the_outcome_is_unknown(armed):
    armed.down = losing(0x90, 99)
    pending = pulse(armed)
    armed.run(100)
    assert isinstance(pending.error, ReplyTimeout)
    assert "unknown" in str(pending.error)
    assert "pulse" in str(pending.error)
    assert pending.status is None
    with pytest.raises(ReplyTimeout):
        pending.result()
    assert [heard[0] for heard in armed.board.heard].count(PULSE) == 4
    assert armed.board.types().count(PULSE) == 1


def test_a_repetition_whose_time_has_passed_is_sent_and_answered_late(armed):
    armed.up = losing(PULSE, 2)
    pending = pulse(armed, in_ms=5)
    armed.run(60)
    assert pending.status is Status.LATE
    assert pending.detail > 0
    assert PULSE not in armed.board.types()
    with pytest.raises(CommandRefused, match="late"):
        pending.result("port")


def test_at_most_eight_commands_are_open_and_the_rest_wait_in_order(armed):
    armed.board.silent = True
    pendings = [pulse(armed, 50 + i) for i in range(20)]
    sent = armed.session.outgoing()
    assert sent.count(b"\0") == 8
    armed.put("up", sent, armed.now_ns)
    armed.run(2)
    armed.board.silent = False
    armed.run(60)
    assert all(pending.ok for pending in pendings)
    numbers = [seq for type_, seq, _ in armed.board.carried_out if type_ == PULSE]
    assert len(numbers) == 20
    assert [(b - a) % 255 for a, b in itertools.pairwise(numbers)] == [1] * 19


def test_no_command_is_sent_beyond_what_the_board_remembers(armed):
    """Replies to one number are lost while others get through: its repetition must still meet the board's memory."""
    first = armed.session.send("cancel", 1, now_ns=armed.now_ns)
    number = parse(armed.session._out[0][:-1])[1]
    armed.down = lambda now, data: None if parse(data[:-1])[:2] == (0x90, number) and now < 100 * MS else (300_000, data)
    others = [armed.session.send("cancel", 1 << i % 15, now_ns=armed.now_ns) for i in range(1, 30)]
    armed.run(40)
    assert not first.done
    assert sum(pending.done for pending in others) == 7
    armed.run(100)
    assert all(pending.ok for pending in [first, *others])
    assert armed.board.types().count(0x11) == 30


def test_nothing_is_repeated_to_a_board_that_was_asked_again_who_it_is(armed):
    """`identify` empties the board's memory, so a repetition would be carried out a second time."""
    armed.down = losing(0x90, 1)
    pending = pulse(armed, in_ms=200)
    armed.run(2)
    armed.put("down", armed.board.telemetry(armed.now_ns, state=0), armed.now_ns)  # untrue, but the session must ask
    armed.run(150)
    assert [type_ for type_, _, _ in armed.board.heard].count(IDENTIFY) == 2
    assert armed.board.types().count(PULSE) == 1
    assert isinstance(pending.error, ReplyTimeout)
    assert "unknown" in str(pending.error)


def test_numbers_wrap_and_skip_zero(armed):
    for _ in range(300):
        pending = armed.session.send("cancel", 1, now_ns=armed.now_ns)
        armed.run(2)
        assert pending.ok
    numbers = {seq for type_, seq, _ in armed.board.heard if type_ == 0x11}
    assert numbers == set(range(1, 256))
    assert {seq for type_, seq, _ in armed.board.heard if type_ in (IDENTIFY, SYNC, KEEPALIVE)} == {0}


def test_a_full_queue_refuses(armed):
    armed.board.silent = True
    pendings = [armed.session.send("cancel", 1, now_ns=armed.now_ns) for _ in range(257)]
    assert pendings[255].error is None
    assert "256 commands are waiting" in str(pendings[256].error)


def test_stray_replies_resolve_nothing(armed):
    pending = pulse(armed)
    armed.session.receive(frame(0x90, 200, bytes(7)) + frame(0x90, 0, bytes(7)), armed.now_ns)
    assert not pending.done
    assert armed.session.counters.stray_replies == 2


def test_keepalive_only_when_nothing_else_was_sent(ready):
    before = len(ready.board.heard)
    ready.run(90)
    quiet = [type_ for type_, _, _ in ready.board.heard[before:]]
    assert quiet.count(KEEPALIVE) >= 2
    before = len(ready.board.heard)
    for _ in range(10):
        ready.session.send("cancel", 1, now_ns=ready.now_ns)
        ready.run(20)
    assert KEEPALIVE not in [type_ for type_, _, _ in ready.board.heard[before:]]


def test_the_board_hears_something_at_least_every_31_ms(ready):
    times = []
    ready.up = lambda now_ns, data: times.append(now_ns) or (300_000, data)
    ready.run(3000)
    assert max(b - a for a, b in itertools.pairwise(times)) <= 31 * MS


def test_deadlines_lie_in_the_future(ready):
    for _ in range(200):
        deadline_ns = ready.session.next_deadline_ns
        assert deadline_ns > ready.now_ns
        ready.run_until(deadline_ns)


# Stop


def test_stop_goes_first_and_fails_what_was_not_sent(armed):
    pendings = [pulse(armed, 50) for _ in range(12)]
    stop = armed.session.stop(armed.now_ns)
    sent = armed.session.outgoing()
    assert parse(sent.split(b"\0")[0])[0] == STOP
    assert sent.count(b"\0") == 1
    assert all("stopped" in str(pending.error) for pending in pendings)
    assert not armed.session.armed
    armed.put("up", sent, armed.now_ns)
    armed.run(5)
    assert stop.ok
    assert PULSE not in armed.board.types()
    assert not armed.board.armed


def test_nothing_sent_before_a_stop_is_repeated_after_it(ready):
    """A lost `arm` must not arm the board after the stop that followed it."""
    ready.up = losing(ARM, 1)
    arming = ready.session.arm(ready.now_ns)
    ready.flush()
    stop = ready.session.stop(ready.now_ns)
    ready.run(100)
    assert stop.ok
    assert "stopped" in str(arming.error)
    assert "unknown" in str(arming.error)
    assert not ready.board.armed
    assert not ready.session.armed
    assert ARM not in [h[0] for h in ready.board.heard]


def test_a_late_answer_to_arm_does_not_arm_after_stop(ready):
    ready.down = lambda now_ns, data: (10 * MS, data)
    ready.session.arm(ready.now_ns)
    ready.run(5)
    ready.session.stop(ready.now_ns)
    ready.run(50)
    assert not ready.session.armed
    assert not ready.board.armed


def test_stop_is_repeated_alone_until_answered(armed):
    armed.up = losing(STOP, 10)
    sent = []
    wire = armed.up
    armed.up = lambda now_ns, data: sent.append(parse(data[:-1])[0]) or wire(now_ns, data)
    stop = armed.session.stop(armed.now_ns)
    later = armed.session.send("cancel", 1, now_ns=armed.now_ns)
    armed.run(100)
    assert not stop.done
    assert set(sent) == {STOP}
    armed.run(80)
    assert stop.ok
    assert later.ok


def test_a_stop_that_is_never_answered_ends_the_session_in_silence(armed):
    """So that the board's dead-man does what the stop could not."""
    armed.up = lambda now_ns, data: None
    stop = armed.session.stop(armed.now_ns)
    armed.run(400)
    assert isinstance(stop.error, ReplyTimeout)
    assert isinstance(armed.session.error, LinkLost)
    quiet = []
    armed.up = lambda now_ns, data: quiet.append(data)
    armed.run(2000)
    assert quiet == []


def test_a_second_stop_joins_the_first(armed):
    armed.up = losing(STOP, 3)
    first = armed.session.stop(armed.now_ns)
    waiting = armed.session.send("cancel", 1, now_ns=armed.now_ns)
    assert armed.session.send("stop", now_ns=armed.now_ns) is first
    assert "stopped" in str(waiting.error)
    armed.run(100)
    assert first.ok


def test_stop_works_before_the_board_is_known(bench):
    bench.session.start(0)
    stop = bench.session.stop(0)
    bench.run(200)
    assert stop.ok
    assert bench.session.ready


# Reboots and other news


def reboot(bench: Bench) -> None:
    bench.board.reboot(0xB0070002, bench.now_ns)


def check_rebooted(bench: Bench) -> None:
    assert [(e.old_boot_id, e.new_boot_id) for e in bench.happened(Rebooted)] == [(0xB0070001, 0xB0070002)]
    assert bench.session.ready
    assert not bench.session.armed
    assert not bench.board.armed
    assert bench.session.identity.boot_id == 0xB0070002
    error_s = (bench.session.to_ticks(bench.now_ns) - bench.board.ticks(bench.now_ns)) / 2e6
    assert abs(error_s) <= bench.session.clock.error_bound_s(bench.now_ns) + 1e-6


def test_a_reboot_is_noticed_by_an_interlock(armed):
    reboot(armed)
    refused = armed.session.send("pulse", armed.session.to_ticks(armed.now_ns), 1, 1, DURATIONS, now_ns=armed.now_ns)
    armed.run(200)
    assert refused.status is Status.INTERLOCK
    assert len(armed.happened(Disarmed)) == 1
    check_rebooted(armed)
    assert ARM in armed.board.types()
    armed.session.arm(armed.now_ns)
    armed.run(5)
    assert armed.session.armed


@pytest.mark.parametrize("fixture", ["ready", "armed"])
def test_a_reboot_is_noticed_by_telemetry(fixture, request):
    bench = request.getfixturevalue(fixture)
    bench.run(5000)
    reboot(bench)
    bench.put("down", bench.board.telemetry(bench.now_ns), bench.now_ns)
    bench.run(200)
    check_rebooted(bench)


def test_a_reboot_is_noticed_by_the_clock(ready):
    reboot(ready)
    ready.run(1000)
    check_rebooted(ready)


def test_a_reboot_is_noticed_by_an_unasked_identity(armed):
    reboot(armed)
    armed.put("down", armed.board.handle(frame(IDENTIFY, 0), armed.now_ns), armed.now_ns)
    armed.run(100)
    check_rebooted(armed)


def test_a_reboot_fails_everything_open(armed):
    pendings = [pulse(armed, 100) for _ in range(12)]
    armed.up = lambda now_ns, data: None
    armed.run(1)
    reboot(armed)
    armed.put("down", armed.board.handle(frame(IDENTIFY, 0), armed.now_ns), armed.now_ns)
    armed.up = lambda now_ns, data: (300_000, data)
    armed.run(100)
    assert all(isinstance(p.error, LinkLost) and "rebooted" in str(p.error) for p in pendings)
    assert PULSE not in armed.board.types()
    check_rebooted(armed)


def test_a_reboot_in_mid_stop_is_no_loss(armed):
    armed.up = losing(STOP, 99)
    armed.session.stop(armed.now_ns)
    reboot(armed)
    armed.put("down", armed.board.handle(frame(IDENTIFY, 0), armed.now_ns), armed.now_ns)
    armed.run(100)
    check_rebooted(armed)


@pytest.mark.parametrize("news", ["telemetry", "fault"])
def test_a_fault_disarms_here_as_it_did_there(armed, news):
    armed.run(1)
    armed.board.armed = False
    data = armed.board.telemetry(armed.now_ns, 5, 1) if news == "telemetry" else armed.board.fault(armed.now_ns, 0)
    armed.put("down", data, armed.now_ns)
    armed.run(50)
    assert not armed.session.armed
    assert armed.session.ready
    assert len(armed.happened(Disarmed)) == 1
    assert armed.happened(Rebooted) == []
    if news == "fault":
        assert armed.happened(FaultReported)[0].fault is Fault.DEAD_MAN


def test_telemetry_from_before_arming_does_not_disarm(ready):
    old = ready.board.telemetry(ready.now_ns)
    ready.session.arm(ready.now_ns)
    ready.run(5)
    ready.put("down", old, ready.now_ns)
    ready.run(5)
    assert ready.session.armed
    assert ready.happened(Disarmed) == []


def test_disarming_by_hand_is_no_news(armed):
    armed.session.send("disarm", now_ns=armed.now_ns)
    assert not armed.session.armed
    armed.run(5)
    armed.put("down", armed.board.telemetry(armed.now_ns), armed.now_ns)
    armed.run(5)
    assert armed.happened(Disarmed) == []


def test_what_was_sent_before_a_disarm_is_not_sent_again_after_it(armed):
    """A pulse for later is lost on the line; its repetition would find the board armed again, and play."""
    armed.up = losing(PULSE, 1)
    lost = pulse(armed, in_ms=200)
    armed.session.send("disarm", now_ns=armed.now_ns)
    armed.session.arm(armed.now_ns)
    armed.run(100)
    assert armed.session.armed
    assert armed.board.types().count(PULSE) == 0
    assert isinstance(lost.error, LinkError)


def test_arm_then_disarm_in_one_breath_ends_disarmed(ready):
    ready.session.arm(ready.now_ns)
    ready.session.send("disarm", now_ns=ready.now_ns)
    ready.run(5)
    assert not ready.session.armed
    assert ready.board.types()[-2:] == [ARM, DISARM]
    assert ready.happened(Disarmed) == []  # it was asked for: known by the answer, and no news of telemetry's


def test_telemetry_carries_the_host_time_of_its_measurement(ready):
    measured_ns = ready.now_ns
    ready.put("down", ready.board.telemetry(measured_ns), measured_ns)
    ready.run(3)
    (event,) = ready.happened(Telemetry)
    assert abs(event.time_ns - measured_ns) * 1e-9 <= ready.session.clock.error_bound_s(ready.now_ns) + 1e-6
    assert event.message.supply == 0


def test_a_silent_board_is_asked_again_and_then_lost(armed):
    armed.run(1000)
    waiting = pulse(armed, 500)
    armed.board.silent = True
    armed.run(6000)
    assert isinstance(waiting.error, LinkError)
    assert isinstance(armed.session.error, LinkLost)
    assert "no byte came from the board" in str(armed.session.error)
    assert not armed.session.armed
    assert len(armed.happened(Lost)) == 1


def test_a_pause_of_a_second_is_survived(armed):
    armed.run(1000)
    armed.board.silent = True
    armed.run(1500)
    armed.board.silent = False
    armed.run(500)
    assert armed.session.ready
    assert armed.happened(Rebooted) == []
    assert armed.happened(Lost) == []
    assert armed.session.armed == armed.board.armed


def test_loss_of_the_port_fails_everything_with_the_reason(armed):
    pendings = [pulse(armed, 100) for _ in range(12)]
    armed.session.lost(LinkLost("double", "unplugged"), armed.now_ns)
    assert all(isinstance(p.error, LinkLost) and "unplugged" in str(p.error) for p in pendings)
    assert "unknown" in str(pendings[0].error)
    assert "unplugged" in str(armed.session.send("cancel", 1, now_ns=armed.now_ns).error)
    assert armed.session.next_deadline_ns is None
    assert armed.session.outgoing() == b""
    armed.session.start(armed.now_ns)
    armed.run(50)
    assert armed.session.ready
    assert not armed.session.armed


# The clock


def test_nothing_is_scheduled_by_a_stale_clock(armed):
    at = armed.session.clock.reference_ns
    with pytest.raises(ClockUncertain, match=r"2\.10 s"):
        armed.session.to_ticks(at + 2_100 * MS)
    armed.up = losing(SYNC, 99)
    refused = armed.session.send("pulse", 0, 1, 1, DURATIONS, now_ns=at + 2_100 * MS)
    assert isinstance(refused.error, ClockUncertain)
    armed.session.send("cancel", 1, now_ns=at + 2_100 * MS)  # no time in it, so none is needed


def test_nothing_is_scheduled_by_a_loose_clock():
    bench = Bench(LinkSession(Board.TACTILES, "far away"), BoardDouble(), delay_ns=30 * MS)
    bench.session.start(0)
    bench.run(2000)
    assert bench.session.ready
    with pytest.raises(ClockUncertain, match="known within"):
        bench.session.to_ticks(bench.now_ns)
    assert bench.session.counters.clock_refusals == 1
    assert 25 < bench.session.counters.clock_refused_ms < 35


def test_nothing_is_measured_by_a_coarse_clock():
    bench = Bench(LinkSession(Board.TACTILES, "far away"), BoardDouble(), delay_ns=8 * MS)
    bench.session.start(0)
    bench.run(1000)
    bench.session.to_ticks(bench.now_ns)
    with pytest.raises(ClockUncertain, match="limit 5 ms"):
        bench.session.exact_ticks(bench.now_ns)


@pytest.mark.parametrize(("up_ms", "down_ms"), [(0.3, 16.0), (16.0, 0.3), (8.0, 8.0)])
def test_over_a_coarse_line_commands_play_later_by_the_clocks_bound_and_never_too_late(up_ms, down_ms):
    """By the double's own clock: asked for 3 ms ahead, a pulse is there in time, and plays within twice the shift."""
    bench = Bench(LinkSession(Board.TACTILES, "slow"), BoardDouble(skew=2e-4))
    bench.up = lambda now_ns, data: (round(up_ms * MS), data)
    bench.down = lambda now_ns, data: (round(down_ms * MS), data)
    bench.session.start(0)
    bench.run(3000)
    bench.session.arm(bench.now_ns)
    bench.run(100)
    pendings, asked = [], []
    for _ in range(40):
        asked.append(bench.now_ns + 3 * MS)
        ticks = bench.session.to_ticks(asked[-1])
        pendings.append(bench.session.send("pulse", ticks, 1, 1, DURATIONS, now_ns=bench.now_ns))
        plays_ns = (ticks - bench.board.ticks_0) * 500 / (1 + 2e-4)
        assert asked[-1] <= plays_ns <= asked[-1] + 2 * bench.session.shift_ns + MS // 100
        bench.run(50)
    bench.run(200)
    assert [pending.status for pending in pendings] == [Status.OK] * 40
    assert 5 * MS < bench.session.shift_ns <= 12 * MS


def test_the_shift_grows_at_once_and_shrinks_only_when_nothing_was_asked_for_a_while():
    exchanges = ClockExchanges(LinkSettings(), LinkCounters())
    exchanges._shift_wanted_ns = 5 * MS
    assert exchanges.shifted_ns(1000 * MS) == 1005 * MS
    exchanges._shift_wanted_ns = 9 * MS
    assert exchanges.shifted_ns(1010 * MS) == 1019 * MS
    exchanges._shift_wanted_ns = 0
    assert exchanges.shifted_ns(1020 * MS) == 1029 * MS
    assert exchanges.shifted_ns(1120 * MS) == 1129 * MS
    assert exchanges.shifted_ns(1221 * MS) == 1221 * MS


@pytest.mark.parametrize("period_ms", [16, 40])
def test_a_line_that_hands_answers_on_in_batches_is_asked_at_all_its_phases(period_ms):
    """Asked again at once, each answer would wait for a whole batch: the clock would be known within half of one for ever."""
    bench = Bench(LinkSession(Board.TACTILES, "batches"), BoardDouble())
    bench.down = lambda now_ns, data: (period_ms * MS - now_ns % (period_ms * MS), data)
    bench.session.start(0)
    bench.run(4000)
    assert bench.session.ready
    error_s = (bench.session.clock.to_ticks(bench.now_ns) - bench.board.ticks(bench.now_ns)) / 2e6
    assert abs(error_s) <= bench.session.clock.error_bound_s(bench.now_ns) < period_ms * 1e-3 / 3


def test_clock_is_measured_at_least_every_half_second(ready):
    asked = []
    ready.up = lambda now_ns, data: (asked.append(now_ns) if parse(data[:-1])[0] == SYNC else None) or (300_000, data)
    ready.run(10_000)
    gaps = [b - a for a, b in itertools.pairwise(asked)]
    assert max(gaps) <= 501 * MS
    assert min(gaps) >= 10 * MS


def test_commands_are_timed_right_across_the_wrap_of_the_tick_counter():
    board = BoardDouble(ticks_0=2**32 - 400_000)  # wraps after 200 ms
    bench = Bench(LinkSession(Board.TACTILES, "double"), board)
    bench.session.start(0)
    bench.run(50)
    bench.session.arm(bench.now_ns)
    bench.run(5)
    for _ in range(60):
        pending = pulse(bench, in_ms=8)
        bench.run(5)
        assert pending.ok
    assert bench.now_ns > 250 * MS
    assert bench.happened(Rebooted) == []


# Any bytes at all


@settings(deadline=None, max_examples=60)
@given(st.lists(st.binary(max_size=200), max_size=10))
def test_no_bytes_raise_or_disturb(chunks):
    bench = Bench(LinkSession(Board.TACTILES, "noise"), BoardDouble())
    bench.session.start(0)
    bench.run(50)
    for chunk in chunks:
        bench.session.receive(chunk, bench.now_ns)
        bench.run(1)
    bench.session.receive(b"\0", bench.now_ns)
    pending = bench.session.send("cancel", 1, now_ns=bench.now_ns)
    bench.run(100)
    assert pending.ok


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255), st.binary(max_size=64)), max_size=20))
def test_no_valid_frame_raises(frames):
    bench = Bench(LinkSession(None, "odd board"), BoardDouble())
    bench.session.start(0)
    bench.run(20)
    for one in frames:
        bench.session.receive(frame(*one), bench.now_ns)
        bench.run(1)


@pytest.mark.parametrize("seed", range(12))
def test_a_bad_line_plays_no_pulse_twice_or_late_and_every_command_gets_an_outcome(seed):
    """Loss, flipped and inserted bytes, truncation, doubled frames and latency spikes, all at 5 % each way."""
    dice = random.Random(seed)

    def wire(now_ns, data):
        delay_ns = dice.randrange(100_000, 2 * MS) + (20 * MS if dice.random() < 0.02 else 0)
        kind = dice.random()
        if kind < 0.05:
            return None
        if kind < 0.10:
            changed = bytearray(data)
            changed[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
            return delay_ns, bytes(changed)
        if kind < 0.15:
            return delay_ns, data[: dice.randrange(len(data))]
        if kind < 0.20:
            at = dice.randrange(len(data))
            return delay_ns, data[:at] + bytes([dice.randrange(256)]) + data[at:]
        if kind < 0.25:
            return delay_ns, data + data
        return delay_ns, data

    bench = Bench(LinkSession(Board.TACTILES, "bad line"), BoardDouble(boot_id=0xB0070000 + seed, skew=1e-4))
    bench.up = bench.down = wire
    bench.session.start(0)
    bench.run(2000)
    assert bench.session.ready
    while not bench.session.armed and bench.now_ns < 5000 * MS:  # four tries may all be lost
        bench.session.arm(bench.now_ns)
        bench.run(100)
    assert bench.session.armed
    pendings = []
    for index in range(400):
        try:
            ticks = bench.session.to_ticks(bench.now_ns + dice.randrange(100 * MS))
        except ClockUncertain:
            bench.run(5)
            continue
        durations = ((index & 127) + 1, index >> 7, *[0] * 13)  # no two alike
        pendings.append(bench.session.send("pulse", ticks, 3, 1, durations, now_ns=bench.now_ns))
        bench.run(5)
    bench.run(200)
    played = [payload for type_, _, payload in bench.board.carried_out if type_ == PULSE]
    assert len(played) == len(set(played))
    assert set(played) <= {pending.payload for pending in pendings}
    assert all(pending.done for pending in pendings)
    ok = {pending.payload for pending in pendings if pending.ok}
    late = {pending.payload for pending in pendings if pending.status is Status.LATE}
    assert ok <= set(played)
    assert not late & set(played)
    assert len(ok) > 200


# Records


def test_the_tap_sees_every_byte_both_ways():
    seen: list[tuple[int, str, bytes]] = []
    bench = Bench(LinkSession(Board.TACTILES, "double", tap=lambda *row: seen.append(row)), BoardDouble())
    bench.session.start(0)
    bench.run(100)
    for direction, total in (("in", bench.session.counters.bytes_in), ("out", bench.session.counters.bytes_out)):
        assert sum(len(data) for _, way, data in seen if way == direction) == total > 0
    assert [time for time, _, _ in seen] == sorted(time for time, _, _ in seen)


def test_same_inputs_give_the_same_bytes():
    def run():
        seen: list[tuple[int, str, bytes]] = []
        bench = Bench(LinkSession(Board.TACTILES, "double", tap=lambda *row: seen.append(row)), BoardDouble())
        bench.session.start(0)
        bench.run(50)
        bench.session.arm(bench.now_ns)
        bench.run(700)
        return seen

    assert run() == run()


def test_events_nobody_takes_are_bounded_and_counted(ready):
    session = ready.session
    for _ in range(5000):
        session.receive(ready.board.telemetry(ready.now_ns), ready.now_ns)
    assert len(session.events()) == session.EVENTS_KEPT
    assert session.counters.events_dropped == 5000 - session.EVENTS_KEPT


@pytest.mark.parametrize("bad", [{"in_flight": 9}, {"tries": 0}, {"reply_timeout_ns": -1}])
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        LinkSettings(**bad)
