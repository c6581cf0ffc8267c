"""Rules of what a brake controller refuses, and why."""

from __future__ import annotations

from haptics.link.clock import signed_ticks
from haptics.link.messages import TICK_HZ, State, Status
from haptics.link_trial.outputs import armed_brake, tick_after
from haptics.link_trial.raw_host import NotApplicable, RawHost, need
from haptics.link_trial.rules.rule import BRAKES, Rules

RULES = Rules()

_VOLTS, _FREQUENCY_DHZ = 200, 500
_LOWEST_DHZ = 5
_PLACES = 8
_CHARGE_NC, _LITTLE_NC = 45_000, 1000


@RULES.rule("drive.values", "A field outside its limit is bad_value, detail its index", BRAKES, arms=True)
def _drive_values(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    volts, _, frequency, ttl, _ = host.identity.limits
    farad = host.telemetry().capacitance[channel] * 1e-12
    start = host.tick_in(300)
    bad: list[tuple[int, tuple[int, int, int, int]]] = [
        (1, (0x20 | mask, _VOLTS, _FREQUENCY_DHZ, 10)),
        (1, (0x80, _VOLTS, _FREQUENCY_DHZ, 10)),
        (2, (mask, volts + 1, _FREQUENCY_DHZ, 10)),
        (2, (mask, 65535, _FREQUENCY_DHZ, 10)),
        (3, (mask, _VOLTS, _LOWEST_DHZ - 1, 10)),
        (3, (mask, 1, frequency + 1, 10)),
        (3, (mask, volts, min(int(10 * 500e-6 / (2 * farad * volts) * 1.1) + 1, 65535), 10)),
        (4, (mask, _VOLTS, _FREQUENCY_DHZ, 0)),
        (4, (mask, _VOLTS, _FREQUENCY_DHZ, ttl + 1)),
    ]
    for index, values in bad:
        host.expect("drive", start, *values, status=Status.BAD_VALUE, detail=index)
    host.expect("drive", start, mask, _VOLTS, _LOWEST_DHZ, ttl)
    return f"{len(bad)} refused by the right field"


@RULES.rule(
    "drive.charge",
    "A drive that stores more charge than the limit is bad_value 2; the limit may be made stricter",
    BRAKES,
    arms=True,
    simulated=True,
)
def _charge(host: RawHost) -> str:
    limits = list(host.identity.limits)
    need(limits[4] <= _CHARGE_NC, f"its limit is {limits[4]} nC; must be at most {_CHARGE_NC}")
    limits[4] = _LITTLE_NC
    host.expect("configure", limits)
    host.arm()
    measured = host.telemetry().capacitance
    mask = sum(1 << channel for channel, picofarad in enumerate(measured) if picofarad)
    volts = int(_LITTLE_NC * 1000 / sum(measured))
    start = host.tick_in(300)
    host.expect("drive", start, mask, volts - 1, _LOWEST_DHZ, 10)
    host.expect("drive", start, mask, volts + 2, _LOWEST_DHZ, 10, status=Status.BAD_VALUE, detail=2)
    return f"on all brakes more than {volts} V refused at {_LITTLE_NC} nC"


@RULES.rule(
    "drive.unfitted",
    "An output that the self test found without a brake is bad_value 1",
    BRAKES,
    arms=True,
    simulated=True,
    query=("fitted=2",),
)
def _unfitted(host: RawHost) -> str:
    host.arm()
    empty = [channel for channel, picofarad in enumerate(host.telemetry().capacitance) if picofarad == 0]
    if not empty:
        raise NotApplicable("every output has a brake")
    start = host.tick_in(50)
    for channel in empty:
        host.expect("drive", start, 1 << channel | 1, _VOLTS, _FREQUENCY_DHZ, 10, status=Status.BAD_VALUE, detail=1)
    return f"outputs {empty} refused"


@RULES.rule(
    "drive.first-reason",
    "A drive is checked in the order of the protocol page, and the first thing wrong is the answer",
    BRAKES,
    arms=True,
)
def _drive_first_reason(host: RawHost) -> str:
    far = (host.tick() + 3 * TICK_HZ) % 2**32
    host.expect("drive", far, 0xFF, 65535, 0, 0, status=Status.INTERLOCK)
    mask, _ = armed_brake(host)
    far = (host.tick() + 3 * TICK_HZ) % 2**32
    host.expect("drive", far, 0xFF, 65535, 0, 0, status=Status.BAD_VALUE, detail=1)
    host.expect("drive", far, mask, 65535, 0, 0, status=Status.BAD_VALUE, detail=2)
    host.expect("drive", far, mask, _VOLTS, 0, 0, status=Status.BAD_VALUE, detail=3)
    host.expect("drive", far, mask, _VOLTS, _FREQUENCY_DHZ, 0, status=Status.BAD_VALUE, detail=4)
    host.expect("drive", far, mask, _VOLTS, _FREQUENCY_DHZ, 10, status=Status.FAR)
    return "interlock, mask, amplitude, frequency, ttl, far"


@RULES.rule("drive.off-checks", "A drive that discharges is checked only for arming, time and room", BRAKES, arms=True)
def _off_checks(host: RawHost) -> str:
    mask, _ = armed_brake(host)
    host.expect("drive", host.tick_in(5), 0xFF, 0, 0, 0)
    host.expect("drive", host.tick_in(5), 0, 65535, 65535, 65535)
    host.expect("drive", host.tick_in(-5), mask, 0, 0, 0, status=Status.LATE, detail=None)
    host.expect("drive", host.tick_in(1500), 0, 0, 0, 0, status=Status.FAR)
    return "taken whatever its other fields"


@RULES.rule(
    "drive.late",
    "A drive or a piezo burst whose time has passed is late, by lateness / 32 ticks, and does nothing",
    BRAKES,
    arms=True,
)
def _drive_late(host: RawHost) -> str:
    mask, _ = armed_brake(host)
    for name, values in (("drive", (mask, _VOLTS, _FREQUENCY_DHZ, 50)), ("piezo", (1, 50))):
        due = host.tick_in(-10)
        reply = host.expect(name, due, *values, status=Status.LATE, detail=None)
        lateness = signed_ticks(reply.time, due) // 32
        need(abs(reply.detail - lateness) <= 1, f"{name}: detail {reply.detail} for a lateness of {lateness} times 32 ticks")
        host.expect(name, host.tick_in(1100), *values, status=Status.FAR)
    host.wait_out(10)
    state = host.telemetry().state
    need(state == State.ARMED, f"{State(state).name.lower()} after it")
    need(not [edge for edge in host.edges if edge.kind == "piezo"], "a piezo went on")
    return "refused, nothing played"


@RULES.rule("drive.full", "Eight drives may wait, a ninth is full", BRAKES, arms=True)
def _drive_full(host: RawHost) -> str:
    mask, _ = armed_brake(host)
    start = host.tick_in(600)
    for index in range(_PLACES):
        host.expect("drive", tick_after(start, 10 * index), mask, _VOLTS, _FREQUENCY_DHZ, 5)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 5, status=Status.FULL)
    host.expect("drive", start, 0, 0, 0, 0, status=Status.FULL)
    return "eight taken, the ninth refused"


@RULES.rule("piezo.full", "Eight bursts may wait or run, a ninth is full", BRAKES, arms=True)
def _piezo_full(host: RawHost) -> str:
    host.arm()
    start = host.tick_in(30)
    host.expect("piezo", start, 1, 500)
    for index in range(1, _PLACES):
        host.expect("piezo", tick_after(start, 500 + 10 * index), 2, 5)
    host.wait_out(40)
    host.expect("piezo", host.tick_in(300), 4, 5, status=Status.FULL)
    return "one running and seven waiting taken, the ninth refused"


@RULES.rule("piezo.values", "A mask or duration outside its limit is bad_value, detail the field's index", BRAKES, arms=True)
def _piezo_values(host: RawHost) -> str:
    host.arm()
    ttl, far = host.identity.limits[3], (host.tick() + 3 * TICK_HZ) % 2**32
    for mask in (0, 0x20, 0x81):
        host.expect("piezo", far, mask, 0, status=Status.BAD_VALUE, detail=1)
    for duration in (0, ttl + 1, 65535):
        host.expect("piezo", far, 1, duration, status=Status.BAD_VALUE, detail=2)
    host.expect("piezo", host.tick_in(50), 0x1F, ttl)
    return "six refused by the right field"
