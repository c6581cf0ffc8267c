"""Rules of the dead-man and of what it latches: a board makes itself safe, and stays so until it is disarmed."""

from __future__ import annotations

from collections.abc import Callable

from haptics.link.clock import signed_ticks
from haptics.link.messages import BY_NAME, COIL_CHANNELS, Fault, State, Status
from haptics.link_trial.outputs import energise, need_off, need_state, refused, stays_off
from haptics.link_trial.raw_frames import frame
from haptics.link_trial.raw_host import TICKS_PER_MS, RawHost, need
from haptics.link_trial.rules.rule import COILS, Rules

RULES = Rules()

_DEAD_MAN_TICKS = 100 * TICKS_PER_MS
_TOLERANCE_TICKS = TICKS_PER_MS
_DEAD_MAN = 1 << Fault.DEAD_MAN
_TOO_LONG = frame(BY_NAME["keepalive"].type, 0, b"\x01")
_UNKNOWN = frame(0x7E, 0)


def _trip(host: RawHost, begin: Callable[[], None]) -> int:
    """Fall silent once ``begin`` is done; ticks from the last frame until the board reported dead_man."""
    begin()
    fed = host.ask("sync", 1).received
    mark = len(host.heard)
    host.run(130 if host.simulated is not None else 250)
    faults = [one.message for one in host.all("fault", mark)]
    need(bool(faults), "no fault was reported within 130 ms of silence")
    need(faults[0].code == Fault.DEAD_MAN and faults[0].channel == 255, f"fault {faults[0].code}, channel {faults[0].channel}")
    return signed_ticks(faults[0].time, fed)


def _dead_man(host: RawHost, begin: Callable[[], None]) -> str:
    ticks = _trip(host, begin)
    late = ticks - _DEAD_MAN_TICKS
    need(abs(late) <= _TOLERANCE_TICKS, f"made safe {ticks / TICKS_PER_MS:g} ms after the last frame")
    need_off(host, "after it")
    telemetry = host.telemetry()
    need(telemetry.state == State.FAULT, f"{State(telemetry.state).name.lower()} after it")
    need(telemetry.faults == _DEAD_MAN, f"faults {telemetry.faults:#x} after it")
    need(telemetry.queued == 0, f"{telemetry.queued} left in the queue")
    stays_off(host)
    need_state(host, State.FAULT, when="though frames came again")
    refused(host, _DEAD_MAN)
    return f"safe {ticks / TICKS_PER_MS:.2f} ms after the last frame, and so it stayed"


@RULES.rule("dead-man.armed", "An armed board that hears nothing for 100 ms makes itself safe and latches dead_man", arms=True)
def _dead_man_armed(host: RawHost) -> str:
    return _dead_man(host, host.arm)


@RULES.rule("dead-man.energised", "The same with outputs on and commands waiting", arms=True)
def _dead_man_energised(host: RawHost) -> str:
    def begin() -> None:
        host.arm()
        energise(host)

    return _dead_man(host, begin)


@RULES.rule("dead-man.pulse", "A pulse that is on when the dead-man's time is up is cut short", COILS, arms=True, simulated=True)
def _dead_man_pulse(host: RawHost) -> str:
    def begin() -> None:
        host.arm()
        host.expect("pulse", host.tick_in(96), 1, 1, [200] * COIL_CHANNELS)

    ticks = _trip(host, begin)
    coil = [edge for edge in host.edges if edge.kind == "coil"]
    need([edge.drive for edge in coil] == [1, 0], f"the coil went {[edge.drive for edge in coil]}")
    on_ms = (coil[1].time_ns - coil[0].time_ns) / 1e6
    need(on_ms < 8, f"it was on for {on_ms:g} ms")
    return f"cut after {on_ms:.2f} ms, {ticks / TICKS_PER_MS:.2f} ms after the last frame"


@RULES.rule("dead-man.feeds", "Only a whole frame of a known type and the right length feeds the dead-man", arms=True)
def _dead_man_feeds(host: RawHost) -> str:
    host.arm()
    for _ in range(6):
        host.run(60 if host.simulated is not None else 30)
        host.send("keepalive", seq=0)
    need_state(host, State.ARMED, when="after frames each 60 ms")
    fed = host.ask("sync", 1).received
    mark = len(host.heard)
    for _ in range(8):
        host.run(20)
        host.write(b"\x05\x01\x02\x03\x04\0" + bytes.fromhex("0233 00") + _TOO_LONG + _UNKNOWN)
    faults = [one.message for one in host.all("fault", mark) if one.message.code == Fault.DEAD_MAN]
    need(bool(faults), "garbage fed it")
    return f"fed by keepalives; garbage did not keep it from {signed_ticks(faults[0].time, fed) / TICKS_PER_MS:.2f} ms"


@RULES.rule("dead-man.disarmed", "A board that is disarmed has no dead-man")
def _dead_man_disarmed(host: RawHost) -> str:
    host.run(300)
    telemetry = host.telemetry()
    need((telemetry.state, telemetry.faults) == (State.DISARMED, 0), f"state {telemetry.state}, faults {telemetry.faults:#x}")
    return "disarmed, no fault, after 300 ms of silence"


@RULES.rule("fault.arm", "While a fault is latched arm is interlock, and disarm clears a fault whose cause is gone", arms=True)
def _fault_arm(host: RawHost) -> str:
    _trip(host, host.arm)
    boot_id = host.ask("identify").boot_id
    host.expect("arm", boot_id, status=Status.INTERLOCK, detail=None)
    host.expect("configure", host.identity.limits)
    host.expect("arm", boot_id, status=Status.INTERLOCK, detail=None)
    host.expect("disarm")
    need(host.telemetry().faults == 0, "it is still latched")
    need_state(host, State.DISARMED, when="after disarm: nothing may arm by itself")
    host.arm()
    return "interlock until disarm; armed again only when asked"


@RULES.rule("fault.once", "A fault is reported when it latches, and stays in telemetry until it is cleared", arms=True)
def _fault_once(host: RawHost) -> str:
    mark = len(host.heard)
    _trip(host, host.arm)
    host.wait_out(200)
    count = len(host.all("fault", mark))
    need(count == 1, f"reported {count} times")
    need(host.telemetry().faults == _DEAD_MAN, "telemetry forgot it")
    host.expect("disarm")
    need(host.telemetry().faults == 0, "disarm did not clear it")
    return "reported once, kept until disarm"


@RULES.rule("stop.fault", "stop works while a fault is latched, reports it, and does not clear it", arms=True)
def _stop_fault(host: RawHost) -> str:
    _trip(host, host.arm)
    host.expect("stop", detail=_DEAD_MAN)
    need_state(host, State.FAULT, when="after it")
    return "ok, detail dead_man"
