"""Rules of a brake controller: its self test, the wave on its outputs, what replaces what, and what it refuses."""

from __future__ import annotations

from haptics.link.messages import BRAKE_CHANNELS, BY_NAME, State, Status, encode
from haptics.link_trial.outputs import armed_brake, tick_after
from haptics.link_trial.raw_frames import frame
from haptics.link_trial.raw_host import NotApplicable, RawHost, need, reply_in_words
from haptics.link_trial.rules.rule import BRAKES, Rules
from haptics.link_trial.rules.schedule import in_time
from haptics.time import NS_PER_MS

RULES = Rules()

_VOLTS, _FREQUENCY_DHZ = 200, 500
_QUARTER_MS, _HALF_MS = 5, 10  # of the period of that frequency
_CLAMP_MS = 1.0  # a tenth of its half period
_DISCHARGED_V, _TOUCHABLE_V, _SELF_TEST_V = 60.0, 42.4, 40.0
_TICK_NS = 500
_BYTE_NS = 20_000  # on the line
_CAPACITANCE_TOLERANCE = 0.05  # as good as the supply's current and the stray capacitance are known
_SUPPLY_A, _STRAY_F = 500e-6, 0.2e-9  # thesis 4.4.3; assumed
_REACHED = 0.85  # of the setpoint: the supply's volts stray by a few percent


def _volts(host: RawHost, channel: int) -> float:
    return float(host.world.truth()["volts"][channel])


def _live_to(host: RawHost, to_ns: int) -> None:
    if to_ns > host.now_ns:
        host.live((to_ns - host.now_ns) / NS_PER_MS)


def _brake_edges(host: RawHost, channel: int, wanted: list[tuple[int, int]], kind: str = "brake", early_ns: int = 0) -> str:
    due = [(host.outputs.tick_ns(tick), channel, drive) for tick, drive in wanted]
    return in_time([edge for edge in host.edges if edge.kind == kind], due, early_ns)


@RULES.rule(
    "self-test.capacitance",
    "The self test measures each output's capacitance; one without a brake has 0",
    BRAKES,
    arms=True,
    simulated=True,
)
def _capacitance(host: RawHost) -> str:
    host.arm()
    found = host.telemetry().capacitance
    worst = 0.0
    for channel in [one for one in range(BRAKE_CHANNELS) if found[one]]:
        start = host.tick_in(5)
        host.expect("drive", start, 1 << channel, 1000, 50, 20)
        volts: list[float] = []
        for ms in (0.5, 1.5):
            _live_to(host, host.outputs.tick_ns(tick_after(start, ms)))
            volts.append(abs(_volts(host, channel)))
        farad = _SUPPLY_A * 1e-3 / (volts[1] - volts[0]) - _STRAY_F
        worst = max(worst, abs(found[channel] * 1e-12 / farad - 1))
        host.wait_out(35)
    need(any(found), "no output has a brake")
    need(worst <= _CAPACITANCE_TOLERANCE, f"{found} pF, {worst:.1%} away from what the outputs' slope shows")
    return f"{found} pF, within {worst:.1%}"


@RULES.rule(
    "self-test.volts", "The self test puts at most 40 V on an output, and leaves it armed", BRAKES, arms=True, simulated=True
)
def _self_test_volts(host: RawHost) -> str:
    host.expect("arm", host.ask("identify").boot_id)
    highest_v = 0.0
    for _ in range(150):
        host.live(0.1)
        highest_v = max(highest_v, *(abs(volts) for volts in host.world.truth()["volts"]))
    need(highest_v <= _SELF_TEST_V * 1.1, f"{highest_v:.1f} V")  # volts of the supply stray
    need(highest_v > 1, "no output was charged at all")
    state = host.telemetry().state
    need(state == State.ARMED, f"{State(state).name.lower()} after it")
    return f"{highest_v:.1f} V at most"


@RULES.rule("self-test.refuses", "While the self test runs, commands that would energise are interlock", BRAKES, arms=True)
def _self_test_refuses(host: RawHost) -> str:
    soon = host.tick_in(10)
    host.expect("arm", host.identity.boot_id)
    if host.simulated is not None:
        host.expect("piezo", soon, 1, 5, status=Status.INTERLOCK)
    host.wait_out(30)
    state = host.telemetry().state
    need(state == State.ARMED, f"{State(state).name.lower()} 30 ms after it")
    return "refused, then armed"


@RULES.rule(
    "arm.touchable",
    "arm is interlock while an output or the bus is at 42.4 V or more",
    BRAKES,
    arms=True,
    simulated=True,
    query=("output_resistance_ohm=60000",),  # slow to empty
)
def _arm_touchable(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, 1000, 100, 100)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 20)))
    stop, arm = (frame(BY_NAME[name].type, host.number(), payload) for name, payload in (("stop", b""), _arm_of(host)))
    mark = len(host.heard)
    host.write(stop + arm)
    host.run_to(host.now_ns + len(stop + arm) * _BYTE_NS - _TICK_NS)
    volts = abs(_volts(host, channel))
    if volts < _TOUCHABLE_V:
        raise NotApplicable(f"{volts:.0f} V are left before a frame can come behind the stop")
    host.run(5)
    replies = host.all("reply", mark)
    need(len(replies) == 2, f"stop and arm brought {len(replies)} replies")
    reply = replies[1].message
    need((reply.status, reply.detail) == (Status.INTERLOCK, 0), f"arm at {volts:.0f} V was answered {reply_in_words(reply)}")
    host.wait_out(30)
    host.arm()
    return f"refused at {volts:.0f} V, armed once empty"


def _arm_of(host: RawHost) -> tuple[str, bytes]:
    return "arm", encode("arm", host.identity.boot_id)


@RULES.rule("piezo.edges", "A piezo is on from its tick for its duration, within 10 us", BRAKES, arms=True, simulated=True)
def _piezo_edges(host: RawHost) -> str:
    host.arm()
    start = host.tick_in(10)
    host.expect("piezo", start, 0b10, 7)
    host.expect("piezo", tick_after(start, 12), 0b10, 3)
    host.wait_out(40)
    wanted = [(start, 1), (tick_after(start, 7), 0), (tick_after(start, 12), 1), (tick_after(start, 15), 0)]
    return _brake_edges(host, 1, wanted, "piezo")


@RULES.rule(
    "drive.edges", "An output is driven from its tick until its ttl is over, within 10 us", BRAKES, arms=True, simulated=True
)
def _drive_edges(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    host.edges.clear()
    start = host.tick_in(10)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 37)
    host.wait_out(70)
    return _brake_edges(host, channel, [(start, 1), (tick_after(start, 37), 0)])


@RULES.rule(
    "drive.end",
    "Where a drive ends its output is shorted, below 60 V in 5 ms, and the board is armed again",
    BRAKES,
    arms=True,
    simulated=True,
)
def _drive_end(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, 1000, 100, 40)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 20)))
    state = host.telemetry().state
    need(state == State.DRIVING, f"{State(state).name.lower()} while it ran")
    _live_to(host, host.outputs.tick_ns(tick_after(start, 46)))
    volts = abs(_volts(host, channel))
    need(volts < _DISCHARGED_V, f"{volts:.0f} V 6 ms after its end")
    state = host.telemetry().state
    need(state == State.ARMED, f"{State(state).name.lower()} after it")
    return f"{volts:.1f} V 6 ms after its end"


def _need_reversal(host: RawHost, channel: int, at_ns: int) -> None:
    """At ``at_ns`` full volts are shorted, and the other sign comes."""
    _live_to(host, at_ns - NS_PER_MS // 20)
    before = _volts(host, channel)
    need(abs(before) >= _REACHED * _VOLTS, f"{before:.0f} V 50 us ahead of a reversal; expected about {_VOLTS}")
    _live_to(host, at_ns + round(_CLAMP_MS * 0.9 * NS_PER_MS))
    shorted = _volts(host, channel)
    need(abs(shorted) < _DISCHARGED_V, f"{shorted:.0f} V 0.9 ms behind a reversal; it is to be shorted for 1 ms")
    _live_to(host, at_ns + 4 * NS_PER_MS)
    after = _volts(host, channel)
    need(
        abs(after) >= _REACHED * _VOLTS and (after > 0) != (before > 0), f"{before:.0f} V before a reversal, {after:.0f} V after"
    )


@RULES.rule(
    "drive.wave",
    "A wave reverses after half a half period, then each half period; at each reversal it is shorted first",
    BRAKES,
    arms=True,
    simulated=True,
)
def _wave(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 60)
    for index in range(5):
        _need_reversal(host, channel, host.outputs.tick_ns(tick_after(start, _QUARTER_MS + index * _HALF_MS)))
    return "five reversals in their place, each from a short"


@RULES.rule(
    "drive.renewed",
    "A drive with the mask and frequency of the one that runs goes on in its phase",
    BRAKES,
    arms=True,
    simulated=True,
)
def _renewed(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    host.edges.clear()
    start = host.tick_in(5)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 40)
    host.expect("drive", tick_after(start, 22), mask, _VOLTS, _FREQUENCY_DHZ, 40)
    for ms in (15, 25, 35, 45, 55):
        _need_reversal(host, channel, host.outputs.tick_ns(tick_after(start, ms)))
    host.wait_out(20)
    return f"reversals kept their place; {_brake_edges(host, channel, [(start, 1), (tick_after(start, 62), 0)])}"


@RULES.rule(
    "drive.restart", "Any other drive shorts all outputs first, and begins 2 ms after that", BRAKES, arms=True, simulated=True
)
def _restart(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    host.edges.clear()
    start = host.tick_in(5)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 100)
    host.expect("drive", tick_after(start, 21), mask, _VOLTS, 2 * _FREQUENCY_DHZ, 20)
    host.wait_out(70)
    wanted = [(start, 1), (tick_after(start, 21), 0), (tick_after(start, 23), 1), (tick_after(start, 41), 0)]
    return _brake_edges(host, channel, wanted, early_ns=_TICK_NS)


@RULES.rule("drive.raised", "A higher amplitude acts at once", BRAKES, arms=True, simulated=True)
def _raised(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, _VOLTS, 100, 200)
    host.expect("drive", tick_after(start, 50), mask, 2 * _VOLTS, 100, 200)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 49)))
    before = _volts(host, channel)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 50.5)))
    at_once = _volts(host, channel)
    need(abs(at_once) >= abs(before) and at_once * before > 0, f"{before:.0f} V before it, {at_once:.0f} V 0.5 ms after")
    _live_to(host, host.outputs.tick_ns(tick_after(start, 60)))  # the next reversal comes 75 ms after the start
    after = _volts(host, channel)
    need(abs(before) < 1.2 * _VOLTS, f"{before:.0f} V before it")
    need(abs(after) > 2 * _REACHED * _VOLTS and before * after > 0, f"{before:.0f} V before it, {after:.0f} V 10 ms after")
    return f"{before:.0f} V, then {after:.0f} V in the same half period"


@RULES.rule("drive.lowered", "A lower amplitude acts at the next reversal at the latest", BRAKES, arms=True, simulated=True)
def _lowered(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, 2 * _VOLTS, 100, 200)
    host.expect("drive", tick_after(start, 50), mask, _VOLTS, 100, 200)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 90)))  # the reversal came 75 ms after the start
    after = _volts(host, channel)
    need(abs(after) < 1.2 * _VOLTS, f"{after:.0f} V behind the reversal")
    telemetry = host.telemetry()
    need(telemetry.faults == 0, f"faults {telemetry.faults:#x}")
    return f"{after:.0f} V behind the reversal"


@RULES.rule("drive.off", "Amplitude or mask 0 discharges at its tick", BRAKES, arms=True, simulated=True)
def _off(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    host.edges.clear()
    start = host.tick_in(5)
    host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 200)
    host.expect("drive", tick_after(start, 31), mask, 0, 0, 0)
    host.expect("drive", tick_after(start, 50), mask, _VOLTS, _FREQUENCY_DHZ, 200)
    host.expect("drive", tick_after(start, 83), 0, _VOLTS, _FREQUENCY_DHZ, 200)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 90)))
    volts = abs(_volts(host, channel))
    need(volts < _DISCHARGED_V, f"{volts:.0f} V 7 ms after it")
    host.wait_out(20)
    wanted = [(start, 1), (tick_after(start, 31), 0), (tick_after(start, 50), 1), (tick_after(start, 83), 0)]
    return _brake_edges(host, channel, wanted)


@RULES.rule("drive.others", "Outputs outside the mask stay shorted", BRAKES, arms=True, simulated=True)
def _others(host: RawHost) -> str:
    mask, channel = armed_brake(host)
    start = host.tick_in(5)
    host.expect("drive", start, mask, 500, 100, 60)
    _live_to(host, host.outputs.tick_ns(tick_after(start, 20)))
    volts = [abs(one) for one in host.world.truth()["volts"]]
    others = max(one for index, one in enumerate(volts) if index != channel)
    need(others < 1.0, f"{others:.0f} V on another")
    return f"{volts[channel]:.0f} V on one, {others:.1f} V on the others"
