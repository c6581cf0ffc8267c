"""Rules of arming, limits and making safe: only ever on purpose, off by itself, and never on again by itself."""

from __future__ import annotations

from haptics.link.messages import COIL_CHANNELS, LIMITS, Board, Fault, State, Status
from haptics.link_trial.outputs import energise, fitted, need_off, need_state, refused, stays_off
from haptics.link_trial.raw_host import TICKS_PER_MS, RawHost, need
from haptics.link_trial.rules.rule import BRAKES, COILS, Rules

RULES = Rules()

_MS = [20] * COIL_CHANNELS
_VOLTS, _FREQUENCY_DHZ = 200, 500


@RULES.rule("arm.boot-id", "arm with another boot id is bad_value, and arms nothing", arms=True)
def _arm_boot_id(host: RawHost) -> str:
    for wrong in (host.identity.boot_id ^ 1, host.identity.boot_id ^ 0x80000000, 0):
        host.expect("arm", wrong, status=Status.BAD_VALUE)
    need_state(host, State.DISARMED, when="after it")
    host.arm()
    host.expect("arm", host.identity.boot_id ^ 1, status=Status.BAD_VALUE)
    need_state(host, State.ARMED, when="after a wrong one while armed")
    return "three refused; armed by its own"


@RULES.rule("arm.again", "arm of an armed board is ok and changes nothing", arms=True)
def _arm_again(host: RawHost) -> str:
    host.arm()
    host.expect("arm", host.identity.boot_id)
    need_state(host, State.ARMED, when="after it")
    return "still armed"


@RULES.rule("arm.explicit", "No board arms by itself", simulated=True)
def _arm_explicit(host: RawHost) -> str:
    host.wait_out(400)
    need_state(host, State.DISARMED, when="after 400 ms of keepalives")
    need(not host.edges, f"{host.edges[0] if host.edges else ''}")
    return "disarmed for 400 ms"


@RULES.rule("disarmed.commands", "While disarmed, commands that would energise are interlock, detail the faults")
def _disarmed_commands(host: RawHost) -> str:
    soon = host.tick_in(20)
    if host.board == Board.TACTILES:
        host.expect("pulse", soon, 1, 1, _MS, status=Status.INTERLOCK)
    else:
        host.expect("drive", soon, 1, _VOLTS, _FREQUENCY_DHZ, 100, status=Status.INTERLOCK)
        host.expect("drive", soon, 0, 0, 0, 0, status=Status.INTERLOCK)
        host.expect("piezo", soon, 1, 5, status=Status.INTERLOCK)
    need_off(host, "after them")
    return "refused"


@RULES.rule("configure.limits", "The board's own limits are accepted; a looser one is bad_value 0")
def _configure(host: RawHost) -> str:
    limits = list(host.ask("identify").limits)
    host.expect("configure", limits)
    for index in range(LIMITS):
        looser = list(limits)
        looser[index] += -1 if (host.board, index) == (Board.TACTILES, 3) else 1
        host.expect("configure", looser, status=Status.BAD_VALUE)
    need(list(host.ask("identify").limits) == limits, "limits changed")
    return f"none of {limits} could be made looser"


@RULES.rule("configure.stricter", "Stricter limits are accepted, appear in identity, and cannot be undone", simulated=True)
def _stricter(host: RawHost) -> str:
    limits = host.ask("identify").limits
    stricter = [limit + 1 if (host.board, index) == (Board.TACTILES, 3) else limit - 1 for index, limit in enumerate(limits)]
    host.expect("configure", stricter)
    need(list(host.ask("identify").limits) == stricter, f"identity has {host.identity.limits}")
    host.expect("configure", limits, status=Status.BAD_VALUE)
    host.expect("disarm")
    need(list(host.ask("identify").limits) == stricter, "disarm undid them")
    return f"{stricter}"


@RULES.rule("configure.enforced", "A stricter limit binds", arms=True, simulated=True)
def _enforced(host: RawHost) -> str:
    limits = list(host.ask("identify").limits)
    limits[0] = 30 if host.board == Board.TACTILES else 150
    host.expect("configure", limits)
    host.arm()
    soon = host.tick_in(50)
    if host.board == Board.TACTILES:
        host.expect("pulse", soon, 1, 1, [31] * COIL_CHANNELS, status=Status.BAD_VALUE, detail=3)
        host.expect("pulse", soon, 1, 1, [30] * COIL_CHANNELS)
    else:
        host.expect("drive", soon, fitted(host), 151, _FREQUENCY_DHZ, 10, status=Status.BAD_VALUE, detail=2)
        host.expect("drive", soon, fitted(host), 150, _FREQUENCY_DHZ, 10)
    return "one above it refused, it itself taken"


@RULES.rule("configure.armed", "An armed board refuses limits", arms=True)
def _configure_armed(host: RawHost) -> str:
    limits = host.identity.limits
    host.arm()
    host.expect("configure", limits, status=Status.INTERLOCK)
    host.expect("disarm")
    host.rest()
    host.expect("configure", limits)
    return "interlock, and ok once disarmed"


def _make_safe(host: RawHost, how: str) -> str:
    """A command that makes safe, with outputs on and others waiting: off at once, queue empty, disarmed, and so it stays."""
    host.arm()
    energise(host)
    host.expect(how)
    asked_ns = host.now_ns
    host.wait_out(8)  # volts are below 60 V in 5 ms
    need_off(host, f"8 ms after {how}")
    late = [edge for edge in host.edges if edge.time_ns > asked_ns]
    need(not late, f"an output changed after {how} was answered")
    telemetry = host.telemetry()
    need(telemetry.state == State.DISARMED, f"{State(telemetry.state).name.lower()} after {how}")
    need(telemetry.queued == 0, f"{telemetry.queued} left in the queue")
    stays_off(host)
    need_state(host, State.DISARMED, when="later")
    refused(host)
    return "off at once, queue empty, disarmed, and nothing came back"


@RULES.rule(
    "stop.energised", "stop makes safe at once: outputs off, queue empty, disarmed; nothing comes back by itself", arms=True
)
def _stop(host: RawHost) -> str:
    return _make_safe(host, "stop")


@RULES.rule("disarm.energised", "disarm makes safe and empties the queue; nothing comes back by itself", arms=True)
def _disarm(host: RawHost) -> str:
    return _make_safe(host, "disarm")


@RULES.rule("stop.rearm", "After a stop the queue stays empty, also when the board is armed again", arms=True)
def _stop_rearm(host: RawHost) -> str:
    host.arm()
    energise(host)
    host.expect("stop")
    host.wait_out(10)
    host.arm()
    stays_off(host)
    return "armed again, and nothing played"


@RULES.rule("stop.disarmed", "stop works while disarmed and changes nothing")
def _stop_disarmed(host: RawHost) -> str:
    for _ in range(3):
        host.expect("stop")
    need_state(host, State.DISARMED, when="after three")
    return "ok three times"


@RULES.rule("stop.self-test", "stop works during the self test", BRAKES, arms=True)
def _stop_self_test(host: RawHost) -> str:
    host.expect("arm", host.identity.boot_id)
    host.expect("stop")
    host.wait_out(30)
    need_state(host, State.DISARMED, when="30 ms after it")
    need_off(host, "after it")
    return "disarmed"


@RULES.rule(
    "stop.discharging",
    "stop works while discharging",
    BRAKES,
    arms=True,
    simulated=True,
    query=("output_resistance_ohm=60000",),  # slow to empty
)
def _stop_discharging(host: RawHost) -> str:
    host.arm()
    mask = fitted(host)
    end = host.tick_in(50)
    host.expect("drive", (end - 30 * TICKS_PER_MS) % 2**32, mask, 1000, 100, 30)
    host.live((host.outputs.tick_ns(end) - host.now_ns) / 1e6)
    host.expect("stop")
    volts = max(abs(one) for one in host.world.truth()["volts"])
    need(volts > 1, "it was empty before a stop could come")
    host.wait_out(15)
    need_state(host, State.DISARMED, when="15 ms after it")
    need_off(host, "15 ms after it")
    return f"{volts:.0f} V were left when it was answered; disarmed"


@RULES.rule(
    "reboot.brown-out",
    "A brown-out gives a new boot id, an empty queue, and latches brown_out until disarm",
    arms=True,
    simulated=True,
)
def _brown_out(host: RawHost) -> str:
    host.arm()
    energise(host)
    old = host.identity.boot_id
    host.world.set_load(0, brown_out=1)
    off_ns = host.now_ns
    host.run(8)
    need_off(host, "8 ms after it")
    on = [edge for edge in host.edges if edge.drive and edge.time_ns > off_ns]
    need(not on, "an output went on after it")
    new = host.meet().boot_id
    need(new != old, "the boot id is the old one")
    bit = 1 << Fault.BROWN_OUT
    telemetry = host.telemetry()
    need((telemetry.state, telemetry.faults) == (State.FAULT, bit), f"state {telemetry.state}, faults {telemetry.faults:#x}")
    host.expect("arm", old, status=Status.BAD_VALUE)
    host.expect("arm", new, status=Status.INTERLOCK, detail=bit)
    stays_off(host)
    host.expect("disarm")
    need_state(host, State.DISARMED, when="after disarm")
    host.arm()
    return f"{old:08x} became {new:08x}; brown_out until disarm"


@RULES.rule(
    "supply.low",
    "arm of a coil board whose supply is below its minimum is interlock, detail 1 << supply",
    COILS,
    arms=True,
    simulated=True,
)
def _supply_low(host: RawHost) -> str:
    host.world.set_load(0, supply_v=2.5)
    host.wait_out(25)
    host.expect("arm", host.identity.boot_id, status=Status.INTERLOCK, detail=1 << Fault.SUPPLY)
    host.world.set_load(0, supply_v=5.0)
    host.wait_out(25)
    host.arm()
    return "refused at 2.5 V, armed at 5 V"


@RULES.rule(
    "lid",
    "A brake controller whose lid opens makes itself safe, and does not arm while it is open",
    BRAKES,
    arms=True,
    simulated=True,
)
def _lid(host: RawHost) -> str:
    host.arm()
    energise(host)
    host.world.set_load(0, lid_open=1)
    host.wait_out(10)
    need_off(host, "10 ms after the lid opened")
    need_state(host, State.DISARMED, when="with an open lid")
    host.expect("arm", host.identity.boot_id, status=Status.INTERLOCK, detail=None)
    host.world.set_load(0, lid_open=0)
    stays_off(host)
    need_state(host, State.DISARMED, when="once the lid is closed again")
    host.arm()
    return "safe, refused while open, armed again only when asked"
