"""Rules of the coils' accounts of on-time: what fills them, what does not empty them, and that nothing resets them."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, exp

from haptics.link.messages import COIL_CHANNELS, HEAT_UNIT_MS, State, Status
from haptics.link_trial.raw_host import TICKS_PER_MS, RawHost, need, reply_in_words
from haptics.link_trial.rules.rule import COILS, Rules
from haptics.time import NS_PER_MS

RULES = Rules()

_ACCOUNT = 4  # its place in identity.limits
_TAU_MS = 102_000.0
_LONGEST = 200  # in 50 us: 10 ms
_PULSE_MS = 10.0
_EARLY = 0.01  # of an account: what decays while its pulses wait
_WARM_MS = 100.0
_WRAP = 1 << 32


def _limited(host: RawHost, account_ms: int) -> None:
    """Arm with a small account, so that it is soon full."""
    limits = list(host.ask("identify").limits)
    limits[_ACCOUNT] = account_ms
    host.expect("configure", limits)
    host.arm()


def _pulse(host: RawHost, start: int, mask: int, duration: int = _LONGEST) -> tuple[int, int]:
    """Ask for a pulse; status and detail."""
    reply = host.ask("pulse", start % _WRAP, mask, 0, [duration] * COIL_CHANNELS)
    need(reply.status in (Status.OK, Status.HOT), f"a pulse was answered {reply_in_words(reply)}")
    return reply.status, reply.detail


def _fill(host: RawHost, mask: int, count: int, duration: int = _LONGEST) -> int:
    """Play pulses of one coil or of some together, one behind the other; how many were taken before one was hot."""
    start, taken, apart_ms = host.tick_in(20), 0, max(duration / 20 + 0.5, 2.0)

    def live_to_ms(ms: float) -> None:
        left_ns = host.outputs.tick_ns(start) + round(ms * NS_PER_MS) - host.now_ns
        host.live(max(left_ns / NS_PER_MS, 0.0))

    for index in range(count):
        status, detail = _pulse(host, start + round(index * apart_ms * TICKS_PER_MS), mask, duration)
        if status == Status.HOT:
            need(detail == mask, f"hot, detail {detail:#x}; the coils that are: {mask:#x}")
            break
        taken += 1
        live_to_ms((index - 8) * apart_ms)
    live_to_ms(count * apart_ms)
    return taken


def _heat(host: RawHost, channel: int = 0) -> int:
    return host.telemetry().heat[channel]


@RULES.rule(
    "heat.limit",
    "A pulse is hot once its coil's account is full, detail its mask; other coils are not",
    COILS,
    arms=True,
    simulated=True,
)
def _limit(host: RawHost) -> str:
    _limited(host, 100)
    taken = _fill(host, 0b1, 14)
    need(taken == 10, f"{taken} pulses of 10 ms were taken on an account of 100 ms; expected 10")
    soon = host.tick_in(50)
    status, detail = _pulse(host, soon, 0b11)
    need((status, detail) == (Status.HOT, 0b01), f"with a cool coil beside it: status {status}, detail {detail:#x}")
    host.expect("pulse", soon, 0b10, 0, [_LONGEST] * COIL_CHANNELS)
    host.expect("pulse", soon, 0b11, 0, [_LONGEST] * COIL_CHANNELS, status=Status.FULL, detail=0b10)  # asked before heat is
    return "10 pulses of 10 ms taken on 100 ms; a pulse of two coils refused whole"


@RULES.rule(
    "heat.small", "Many short pulses count as much as few long ones, on many coils at once too", COILS, arms=True, simulated=True
)
def _small(host: RawHost) -> str:
    _limited(host, 20)
    for mask in (0b111, 0b111 << 12):
        taken = _fill(host, mask, 60, duration=10)
        need(taken == 40, f"{taken} pulses of 0.5 ms were taken on coils {mask:#x}, account 20 ms; expected 40")
    host.expect("pulse", host.tick_in(20), 0b1000, 0, [_LONGEST] * COIL_CHANNELS)
    return "40 pulses of 0.5 ms taken on 20 ms, of three coils at once"


@RULES.rule("heat.decay", "An account decays with a time constant of 102 s, and no quicker", COILS, arms=True, simulated=True)
def _decay(host: RawHost) -> str:
    _limited(host, 100)
    _fill(host, 0b1, 10)
    host.live(4000)
    room_ms = 100 * (1 - exp(-4100 / _TAU_MS))
    more = ceil(room_ms * 20 * 1.05)
    status, _ = _pulse(host, host.tick_in(20), 0b1, more)
    need(status == Status.HOT, f"{more / 20:g} ms were taken after 4 s; what has decayed by then is {room_ms:.2f} ms")
    less = int(room_ms * 20 * 0.95)
    status, _ = _pulse(host, host.tick_in(20), 0b1, less)
    need(status == Status.OK, f"{less / 20:g} ms were hot after 4 s; what has decayed by then is {room_ms:.2f} ms")
    return f"after 4 s {less / 20:g} ms of 100 taken, {more / 20:g} refused"


@RULES.rule(
    "heat.refund",
    "A waiting pulse counts until cancel, disarm or stop forgets it; doing so again and again erases no heat",
    COILS,
    arms=True,
    simulated=True,
)
def _refund(host: RawHost) -> str:
    _limited(host, 100)
    _fill(host, 0b1, 5)

    def queue() -> None:
        start = host.tick_in(900)
        for index in range(5):
            status, _ = _pulse(host, start + index * 11 * TICKS_PER_MS, 0b1)
            need(status == Status.OK, f"with 50 ms played and {10 * index} ms waiting of 100 ms: hot")
        status, _ = _pulse(host, start + 80 * TICKS_PER_MS, 0b1)
        need(status == Status.HOT, "100 ms were played or waited, and another 10 ms were taken")

    for _ in range(6):
        queue()
        host.live(800)
        host.expect("cancel", 0b1, detail=5)
    for how in ("disarm", "stop"):
        queue()
        host.expect(how)
        host.arm()
    left_ms = 50 * exp(-6 * 850 / _TAU_MS)
    more = ceil((100 - left_ms) / 5 * 20 * 1.03) - _LONGEST
    _fill(host, 0b1, 5)
    status, _ = _pulse(host, host.tick_in(20), 0b1, 5 * more)
    need(status == Status.HOT, f"50 ms were played, and then another {50 + 5 * more / 20:g} ms of 100 taken")
    return "by cancel, disarm and stop; six times over"


@RULES.rule("heat.telemetry", "Telemetry shows each coil's account in 20 ms, rounded up", COILS, arms=True, simulated=True)
def _telemetry(host: RawHost) -> str:
    host.arm()
    need(not any(host.telemetry().heat), f"{host.telemetry().heat} of a new board")
    _fill(host, 0b1, 3)
    _fill(host, 0b10, 1, duration=4)
    heat = host.telemetry().heat
    need(heat[:3] == (2, 1, 0), f"{heat[:3]} after 30 ms, 0.2 ms and nothing; expected (2, 1, 0)")
    return "30 ms, 0.2 ms and 0: 2, 1 and 0"


@RULES.rule("heat.outlives", "No arming, disarming, stop, fault or reset empties an account", COILS, arms=True, simulated=True)
def _outlives(host: RawHost) -> str:
    host.arm()
    _fill(host, 0b1, 5)
    before = _heat(host)
    actions: dict[str, Callable[[], object]] = {
        "disarm": lambda: host.expect("disarm"),
        "stop": lambda: host.expect("stop"),
        "the dead-man": lambda: host.run(150),
        "a reset": lambda: (host.world.set_load(0, reset=1), host.run(10), host.meet()),
        "arm": lambda: None,
    }
    for name, action in actions.items():
        action()
        host.rest()
        host.arm()
        need(_heat(host) == before, f"{_heat(host)} times 20 ms after {name}; before it {before}")
    return f"{HEAT_UNIT_MS * before} ms after {', '.join(actions)}"


@RULES.rule(
    "heat.power",
    "After a loss of power the accounts begin at the worst case: full, or 100 ms after little use",
    COILS,
    arms=True,
    simulated=True,
)
def _power(host: RawHost) -> str:
    def lose() -> tuple[int, ...]:
        host.world.set_load(0, brown_out=1)
        host.run(10)
        host.meet()
        host.rest()
        return host.telemetry().heat

    most = host.identity.limits[_ACCOUNT]
    new = lose()
    need(not any(new), f"{new} of a board that never put a coil on")
    host.arm()
    _fill(host, 0b1, 9)
    little = lose()
    need(min(little) * HEAT_UNIT_MS >= _WARM_MS, f"{little} after 90 ms of use")
    host.arm()
    _fill(host, 0b1, 4)
    much = lose()
    need(min(much) * HEAT_UNIT_MS >= most * (1 - _EARLY), f"{much} after more than 100 ms of use; expected {most} ms")
    host.arm()
    status, detail = _pulse(host, host.tick_in(20), 0b100)
    need((status, detail) == (Status.HOT, 0b100), f"a coil that may be hot took 10 ms: {status}")
    host.live(2000)
    status, _ = _pulse(host, host.tick_in(20), 0b100)
    need(status == Status.OK, "2 s later it took none")
    return f"0 before the first use, then {HEAT_UNIT_MS * max(little)} ms, then {HEAT_UNIT_MS * max(much)} ms"


@RULES.rule(
    "heat.configured",
    "A configured limit of the account binds at once, and decay of the old account does not undo it",
    COILS,
    arms=True,
    simulated=True,
)
def _configured(host: RawHost) -> str:
    host.arm()
    _fill(host, 0b1, 5)
    host.expect("disarm")
    _limited(host, 55)
    status, _ = _pulse(host, host.tick_in(20), 0b1)
    need(status == Status.HOT, "of 55 ms 50 were used, and 10 taken")
    status, _ = _pulse(host, host.tick_in(20), 0b1, 80)
    need(status == Status.OK, "of 55 ms 50 were used, and 4 refused")
    need(host.telemetry().state == State.ARMED, "a hot coil disarmed the board")
    return "of 55 ms, 50 of them used, 10 refused and 4 taken"
