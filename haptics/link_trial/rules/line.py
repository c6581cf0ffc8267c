"""Rules of the uplink: telemetry on time and within its share, replies never lost, counters that count."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from haptics.link.clock import signed_ticks
from haptics.link.framing import BITS_PER_BYTE, FRAMING_BYTES
from haptics.link.messages import BY_NAME, OPEN_COMMANDS, Status, payload_size
from haptics.link_trial.raw_frames import frame
from haptics.link_trial.raw_host import TICKS_PER_MS, RawHost, need
from haptics.link_trial.rules.rule import BRAKES, COILS, Rules
from haptics.time import NS_PER_S

RULES = Rules()

_PERIOD_TICKS = 20 * TICKS_PER_MS
_SHARE = 0.4


def _ticks_of(host: RawHost, since: int) -> list[int]:
    return [one.message.time for one in host.all("telemetry", since)]


@RULES.rule("telemetry.period", "Telemetry is sent every 20 ms")
def _period(host: RawHost) -> str:
    since = len(host.heard)
    host.run(500)
    times = _ticks_of(host, since)
    need(len(times) >= 20, f"{len(times)} in 500 ms")
    gaps = [signed_ticks(later, earlier) for earlier, later in pairwise(times)]
    allowed = TICKS_PER_MS  # the firmware may be busy with a frame, or the line with another
    need(all(abs(gap - _PERIOD_TICKS) <= allowed for gap in gaps), f"gaps of {min(gaps) / 2000:g} to {max(gaps) / 2000:g} ms")
    return f"{len(times)} in 500 ms, gaps of {min(gaps) / 2000:g} to {max(gaps) / 2000:g} ms"


@RULES.rule("telemetry.share", "Telemetry takes at most 40 % of the uplink, also while replies fill it", simulated=True)
def _share(host: RawHost) -> str:
    since, begun_ns = len(host.heard), host.now_ns
    host.flood("disarm", count=40 * OPEN_COMMANDS)
    elapsed_s = (host.now_ns - begun_ns) / NS_PER_S
    baud = getattr(host.port, "baudrate", 500_000)
    frame_bytes = payload_size(f"{host.board.name.lower()}_telemetry") + FRAMING_BYTES
    share = len(host.all("telemetry", since)) * frame_bytes * BITS_PER_BYTE / baud / elapsed_s
    need(share <= _SHARE, f"{share:.1%} of the line")
    gaps = [signed_ticks(later, earlier) for earlier, later in pairwise(_ticks_of(host, since))]
    need(all(gap >= _PERIOD_TICKS - TICKS_PER_MS for gap in gaps), f"two within {min(gaps, default=0) / 2000:g} ms")
    return f"{share:.1%} of the line under load"


@RULES.rule("replies.flood", "No reply is lost while eight commands are open all the time, and each comes under its number")
def _flood(host: RawHost) -> str:
    numbers = host.flood("disarm", count=30 * OPEN_COMMANDS)
    return f"{len(numbers)} commands, {len(numbers)} replies"


@RULES.rule("replies.mixed", "Questions of all kinds, sent at once, are all answered in their order")
def _mixed(host: RawHost) -> str:
    data = b""
    wanted: list[tuple[str, int]] = []
    for _ in range(3):
        seq = host.number()
        data += frame(BY_NAME["sync"].type, 0, b"\x01\x02\x03\x04") + frame(BY_NAME["disarm"].type, seq) + frame(0x33, 0)
        wanted += [("sync_reply", 0), ("reply", seq), ("reply", 0)]
    found = host.answers(data, len(wanted))
    seen = [(one.name, one.seq) for one in found]
    need(seen == wanted, f"{seen}; expected {wanted}")
    return f"{len(wanted)} answers"


@RULES.rule("telemetry.time", "Telemetry carries the tick at which it was made")
def _time(host: RawHost) -> str:
    worst = 0
    for _ in range(5):
        before = host.tick()
        sent = host.telemetry(feed=False).time
        after = host.tick()
        need(signed_ticks(after, sent) >= 0, f"tick {sent} is {signed_ticks(sent, after)} ticks ahead of the clock")
        worst = max(worst, signed_ticks(before, sent))
    need(worst <= TICKS_PER_MS, f"{worst} ticks before the question ahead of it")
    return "between the questions around it"


@RULES.rule("telemetry.late", "Telemetry counts late commands", arms=True)
def _late(host: RawHost) -> str:
    host.arm()
    before = host.telemetry().late
    for _ in range(3):
        past = host.tick_in(-20)
        name, values = _timed(host)
        host.expect(name, past, *values, status=Status.LATE, detail=None)
    count = (host.telemetry().late - before) % 65536
    need(count == 3, f"rose by {count} after three")
    return "rose by 3 after three"


def _timed(host: RawHost) -> tuple[str, tuple[Any, ...]]:
    return ("pulse", (1, 1, [20] * 15)) if host.board in COILS else ("piezo", (1, 5))


@RULES.rule("telemetry.played", "Telemetry counts the pulses begun on each channel", COILS, arms=True)
def _played(host: RawHost) -> str:
    host.arm()
    before = host.telemetry().played
    for ms in (5, 12):
        host.expect("pulse", host.tick_in(ms), 0b101, 0b001, [20] * 15)
    host.expect("pulse", host.tick_in(9), 0b010, 0, [20] * 15)
    host.wait_out(25)
    rose = [(new - old) % 65536 for new, old in zip(host.telemetry().played, before, strict=True)]
    need(rose[:3] == [2, 1, 2] and not any(rose[3:]), f"rose by {rose}")
    return "2, 1 and 2 on the first three channels"


@RULES.rule("telemetry.queued", "Telemetry counts the pulses that wait", COILS, arms=True)
def _queued_pulses(host: RawHost) -> str:
    host.arm()
    host.expect("pulse", host.tick_in(200), 0b111, 0, [20] * 15)
    host.expect("pulse", host.tick_in(250), 0b001, 0, [20] * 15)
    queued = host.telemetry().queued
    need(queued == 4, f"{queued}; expected 4")
    host.expect("cancel", 0b001, detail=2)
    queued = host.telemetry().queued
    need(queued == 2, f"{queued} after two were cancelled; expected 2")
    host.wait_out(210)
    queued = host.telemetry().queued
    need(queued == 0, f"{queued} after they were played")
    return "4, 2 after a cancel, 0 in the end"


@RULES.rule("telemetry.queued", "Telemetry counts the commands that wait", BRAKES, arms=True)
def _queued_commands(host: RawHost) -> str:
    host.arm()
    for ms in (200, 220, 240):
        host.expect("piezo", host.tick_in(ms), 1, 5)
    queued = host.telemetry().queued
    need(queued == 3, f"{queued}; expected 3")
    host.wait_out(260)
    queued = host.telemetry().queued
    need(queued == 0, f"{queued} after they were played")
    return "3, 0 in the end"
