"""Rules of coil pulses in time: at their tick, once, whole or not at all, and refused in the order of the page."""

from __future__ import annotations

from haptics.link.clock import signed_ticks
from haptics.link.messages import BY_NAME, COIL_CHANNELS, DURATION_UNIT_US, OPEN_COMMANDS, TICK_HZ, State, Status, encode
from haptics.link_trial.raw_frames import frame
from haptics.link_trial.raw_host import TICKS_PER_MS, Edge, NotApplicable, RawHost, need, reply_in_words
from haptics.link_trial.rules.rule import COILS, Rules
from haptics.time import NS_PER_US

RULES = Rules()

EDGE_NS = 10 * NS_PER_US
"""An edge comes no earlier than its tick, and no more than this behind it."""
_COIL_WORST_MA = 3907
_TOO_MANY = 0x8000
_MS = [20] * COIL_CHANNELS
_UNIT_TICKS = 2 * DURATION_UNIT_US
_WRAP = 1 << 32
_NEAR_WRAP_S = 15
_LATE_TICKS = 32


def in_time(seen: list[Edge], due: list[tuple[int, int, int]], early_ns: int = 0) -> str:
    """Compare edges with those due.

    :param seen: edges of the board's outputs.
    :param due: ``(time_ns, channel, drive)`` of each edge expected.
    :param early_ns: how much too early they may come (ns), where the time is not a tick of the host's own.
    :return: by how much they came behind, in words.
    :raises Broken: an edge is missing, surplus, early, late or of the wrong sign.
    """
    worst_ns = 0
    for channel in sorted({edge.channel for edge in seen} | {channel for _, channel, _ in due}):
        came = [edge for edge in seen if edge.channel == channel]
        wanted = sorted((time_ns, drive) for time_ns, one, drive in due if one == channel)
        drives, expected = [edge.drive for edge in came], [drive for _, drive in wanted]
        need(drives == expected, f"channel {channel} went {drives}; expected {expected}")
        for edge, (time_ns, _) in zip(came, wanted, strict=True):
            off_ns = edge.time_ns - time_ns
            need(
                -early_ns <= off_ns <= EDGE_NS,
                f"channel {channel}: an edge {off_ns / 1000:g} us behind its tick; must be 0 to 10 us",
            )
            worst_ns = max(worst_ns, off_ns)
    return f"{len(due)} edges, {worst_ns / 1000:g} us behind their tick at most"


def _edges(host: RawHost, wanted: list[tuple[int, int, int]]) -> str:
    """The coils' edges so far are those at these (tick, channel, drive)."""
    due = [(host.outputs.tick_ns(tick), channel, drive) for tick, channel, drive in wanted]
    return in_time([edge for edge in host.edges if edge.kind == "coil"], due)


def _durations(units: dict[int, int]) -> list[int]:
    return [units.get(channel, 0) for channel in range(COIL_CHANNELS)]


def _played(host: RawHost) -> int:
    return sum(host.telemetry().played)


@RULES.rule("pulse.edges", "A coil is on from its tick for its duration, within 10 us", COILS, arms=True, simulated=True)
def _pulse_edges(host: RawHost) -> str:
    host.arm()
    start, units = host.tick_in(10), {0: 20, 7: 63, 14: 200}
    host.expect("pulse", start, 1 | 1 << 7 | 1 << 14, 1 | 1 << 14, _durations(units))
    host.wait_out(30)
    wanted = [(start, channel, -1 if channel == 7 else 1) for channel in units]
    return _edges(host, wanted + [(start + count * _UNIT_TICKS, channel, 0) for channel, count in units.items()])


@RULES.rule(
    "pulse.order",
    "Pulses play in the order of their ticks, whatever the order in which they came",
    COILS,
    arms=True,
    simulated=True,
)
def _pulse_order(host: RawHost) -> str:
    host.arm()
    begin, wanted = host.tick_in(40), list[tuple[int, int, int]]()
    for place, channel in ((4, 2), (0, 5), (3, 0), (1, 14), (2, 9)):
        start = begin + 4 * place * TICKS_PER_MS
        host.expect("pulse", start, 1 << channel, 0x7FFF, _MS)
        wanted += [(start, channel, 1), (start + 20 * _UNIT_TICKS, channel, 0)]
    host.wait_out(70)
    return _edges(host, wanted)


@RULES.rule(
    "pulse.direction",
    "A coil is driven toward the skin where its bit is set, and back where it is not",
    COILS,
    arms=True,
    simulated=True,
)
def _pulse_direction(host: RawHost) -> str:
    host.arm()
    begin, wanted = host.tick_in(60), list[tuple[int, int, int]]()
    for channel in range(COIL_CHANNELS):
        start = begin + 2 * channel * TICKS_PER_MS
        host.expect("pulse", start, 1 << channel, 0x2AAA, _MS)
        wanted += [(start, channel, 1 if 0x2AAA >> channel & 1 else -1), (start + 20 * _UNIT_TICKS, channel, 0)]
    host.wait_out(100)
    return _edges(host, wanted)


@RULES.rule("pulse.back-to-back", "A pulse may begin at the very tick where another on its coil ends", COILS, arms=True)
def _back_to_back(host: RawHost) -> str:
    host.arm()
    start = host.tick_in(30)
    end = (start + 20 * _UNIT_TICKS) % _WRAP
    host.expect("pulse", start, 1, 1, _MS)
    host.expect("pulse", (end - 1) % _WRAP, 1, 0, _MS, status=Status.FULL, detail=1)
    host.expect("pulse", end, 1, 0, _MS)
    host.wait_out(40)
    if host.simulated is None:
        return "taken"
    return _edges(host, [(start, 0, 1), (end, 0, -1), (end + 20 * _UNIT_TICKS, 0, 0)])


@RULES.rule("pulse.unmasked", "Durations of channels outside the mask are ignored", COILS, arms=True)
def _unmasked(host: RawHost) -> str:
    host.arm()
    host.expect("pulse", host.tick_in(10), 1, 1, [20, *[255] * 14])
    host.expect("pulse", host.tick_in(20), 2, 2, _durations({1: 20}))
    return "taken with 255 and with 0 beside it"


@RULES.rule("pulse.repeat", "A repeated pulse gets its first reply, and plays once", COILS, arms=True)
def _pulse_repeat(host: RawHost) -> str:
    host.arm()
    before, start = _played(host), host.tick_in(15)
    seq = host.number()
    first = host.expect("pulse", start, 1, 1, _MS, seq=seq)
    for _ in range(4):
        host.wait_out(8)
        need(host.ask("pulse", start, 1, 1, _MS, seq=seq) == first, "a repetition got another reply")
    played = _played(host) - before
    need(played == 1, f"played {played} times")
    return "played once, answered five times"


@RULES.rule("pulse.late", "A pulse whose time has passed is late, by lateness / 32 ticks, and never played", COILS, arms=True)
def _late(host: RawHost) -> str:
    host.arm()
    before, worst = _played(host), 0
    for ms in (1, 20, 400):
        due = host.tick_in(-ms)
        reply = host.expect("pulse", due, 1, 1, _MS, status=Status.LATE, detail=None)
        lateness = signed_ticks(reply.time, due) // _LATE_TICKS
        worst = max(worst, abs(reply.detail - lateness))
        need(worst <= 1, f"detail {reply.detail} for a lateness of {lateness} times 32 ticks")
    due = (host.tick() - 3 * TICK_HZ) % _WRAP
    host.expect("pulse", due, 1, 1, _MS, status=Status.LATE, detail=65535)
    host.wait_out(40)
    need(_played(host) == before, "one was played")
    return f"four refused, detail within {worst} of lateness / 32, at most 65535"


@RULES.rule("pulse.far", "A pulse more than one second ahead is far, one within it is taken", COILS, arms=True)
def _far(host: RawHost) -> str:
    host.arm()
    host.expect("pulse", host.tick_in(1100), 1, 1, _MS, status=Status.FAR)
    host.expect("pulse", (host.tick() + _WRAP // 4) % _WRAP, 1, 1, _MS, status=Status.FAR)
    host.expect("pulse", (host.tick() + 990 * TICKS_PER_MS) % _WRAP, 1, 1, _MS)
    host.expect("cancel", 1, detail=1)
    return "1.1 s refused, 0.99 s taken"


@RULES.rule("pulse.full-queue", "A pulse for which the queue has no room is full, detail 0", COILS, arms=True)
def _full_queue(host: RawHost) -> str:
    host.arm()
    depth = host.identity.limits[2]
    begin = host.tick_in(700)
    for index in range(depth):
        start = (begin + index * 3 * TICKS_PER_MS) % _WRAP
        host.expect("pulse", start, 1 << index % COIL_CHANNELS, 0, _MS)
        if index % 8 == 7:
            host.live(1)
    host.expect("pulse", (begin - 10 * TICKS_PER_MS) % _WRAP, 1, 0, _MS, status=Status.FULL)
    host.expect("cancel", 0x7FFF, detail=depth)
    return f"{depth} taken, one more refused"


@RULES.rule(
    "pulse.full-coil", "A pulse on a coil that another has then is full, detail the mask of those coils", COILS, arms=True
)
def _full_coil(host: RawHost) -> str:
    host.arm()
    start = host.tick_in(300)
    host.expect("pulse", start, 0b011, 0, _MS)
    host.expect("pulse", (start + 10) % _WRAP, 0b111, 0, _MS, status=Status.FULL, detail=0b011)
    host.expect("pulse", (start + 10) % _WRAP, 0b100, 0, _MS)
    return "two of three coils named"


@RULES.rule("pulse.full-current", "More coils at once than the coil current allows are full, detail 0x8000", COILS, arms=True)
def _full_current(host: RawHost) -> str:
    host.arm()
    allowed = host.identity.limits[1] // _COIL_WORST_MA
    if allowed >= COIL_CHANNELS:
        raise NotApplicable(f"{host.identity.limits[1]} mA allows all coils at once")
    start = host.tick_in(300)
    host.expect("pulse", start, (1 << allowed) - 1, 0, _MS)
    host.expect("pulse", (start + 100) % _WRAP, 1 << allowed, 0, _MS, status=Status.FULL, detail=_TOO_MANY)
    host.expect("pulse", (start - 100) % _WRAP, 1 << allowed, 0, _MS, status=Status.FULL, detail=_TOO_MANY)
    host.expect("pulse", (start + 20 * _UNIT_TICKS) % _WRAP, 1 << allowed, 0, _MS)
    return f"{allowed} coils at {host.identity.limits[1]} mA"


@RULES.rule("pulse.values", "A mask or duration outside its limit is bad_value, detail the field's index", COILS, arms=True)
def _values(host: RawHost) -> str:
    host.arm()
    longest, start = host.identity.limits[0], host.tick_in(100)
    for mask in (0, 0x8000, 0x8001):
        host.expect("pulse", start, mask, 0, _MS, status=Status.BAD_VALUE, detail=1)
    durations = [0] if longest >= 255 else [0, longest + 1, 255]
    for duration in durations:
        host.expect("pulse", start, 0b11, 0, _durations({0: 20, 1: duration}), status=Status.BAD_VALUE, detail=3)
    host.expect("pulse", start, 1, 0xFFFF, _durations({0: longest}))
    return f"masks 0 and 0x8000, durations {durations} refused"


@RULES.rule(
    "pulse.first-reason",
    "A pulse is checked in the order of the protocol page, and the first thing wrong is the answer",
    COILS,
    arms=True,
)
def _first_reason(host: RawHost) -> str:
    far = (host.tick() + 3 * TICK_HZ) % _WRAP
    host.expect("pulse", far, 0, 0, _durations({}), status=Status.INTERLOCK)
    host.arm()
    start = host.tick_in(400)
    host.expect("pulse", start, 0b111, 0, _MS)
    host.expect("pulse", far, 0x8000, 0, _durations({}), status=Status.BAD_VALUE, detail=1)
    host.expect("pulse", far, 1, 0, _durations({}), status=Status.BAD_VALUE, detail=3)
    host.expect("pulse", far, 0x7FFF, 0, _MS, status=Status.FAR)
    host.expect("pulse", start, 0x7FFF, 0, _MS, status=Status.FULL, detail=0b111)
    host.expect("pulse", start, 0x7FF8, 0, _MS, status=Status.FULL, detail=_TOO_MANY)
    host.expect("cancel", 0x7FFF, detail=3)
    return "interlock, mask, duration, far, coil, current"


@RULES.rule("pulse.whole", "A pulse command is taken whole or dropped whole", COILS, arms=True)
def _whole(host: RawHost) -> str:
    host.arm()
    start, before = host.tick_in(40), host.telemetry().queued
    host.expect("pulse", start, 0b001, 0, _MS)
    host.expect("pulse", start, 0b111, 0, _MS, status=Status.FULL, detail=0b001)
    host.expect("pulse", start, 0b110, 0, _durations({1: 20}), status=Status.BAD_VALUE, detail=3)
    queued = host.telemetry().queued - before
    need(queued == 1, f"{queued} pulses wait; expected 1")
    return "two refused, nothing of them waits"


@RULES.rule(
    "cancel", "cancel forgets the pulses not yet begun on its coils, and replies how many; those begun go on", COILS, arms=True
)
def _cancel(host: RawHost) -> str:
    host.arm()
    before = _played(host)
    start = host.tick_in(10)
    host.expect("pulse", start, 0b001, 0b001, _durations({0: 160}))
    for ms in (60, 80):
        host.expect("pulse", (start + ms * TICKS_PER_MS) % _WRAP, 0b011, 0, _MS)
    while signed_ticks(host.tick(), start) < 2 * TICKS_PER_MS:
        host.live(1)
    host.expect("cancel", 0b001, detail=2)
    host.expect("cancel", 0b001)
    host.wait_out(110)
    played = _played(host) - before
    need(played == 3, f"{played} pulses were played; expected 3")
    if host.simulated is None:
        return "two forgotten, three played"
    ends = [(start, 0, 1), (start + 160 * _UNIT_TICKS, 0, 0)]
    for ms in (60, 80):
        ends += [(start + ms * TICKS_PER_MS, 1, -1), (start + ms * TICKS_PER_MS + 20 * _UNIT_TICKS, 1, 0)]
    return f"two forgotten; {_edges(host, ends)}"


@RULES.rule(
    "pulse.wrap",
    "Times are compared across the wrap of the board's clock",
    COILS,
    arms=True,
    query=(f"tick_offset={_WRAP - TICK_HZ}",),
)
def _wrap(host: RawHost) -> str:
    left = _WRAP - host.tick()
    if left > _NEAR_WRAP_S * TICK_HZ:
        raise NotApplicable(f"its clock wraps in {left / TICK_HZ:.0f} s; tried within {_NEAR_WRAP_S} s after a boot")
    host.run(left / TICKS_PER_MS - 150)
    host.arm()
    edges: list[tuple[int, int, int]] = []
    before = _played(host)
    crossing = _WRAP - 4 * TICKS_PER_MS
    for channel, start in enumerate((crossing, crossing + 6 * TICKS_PER_MS, _WRAP)):
        host.expect("pulse", start % _WRAP, 1 << channel, 0x7FFF, _durations({channel: 160}))
        edges += [(start % _WRAP, channel, 1), ((start + 160 * _UNIT_TICKS) % _WRAP, channel, 0)]
    host.live(max(signed_ticks(0, host.tick()) / TICKS_PER_MS, 0) + 20)
    host.expect("pulse", _WRAP - 1, 1, 0, _MS, status=Status.LATE, detail=None)
    played = _played(host) - before
    need(played == 3, f"{played} pulses were played; expected 3")
    return "three played, one late" if host.simulated is None else _edges(host, edges)


@RULES.rule("pulse.flood", "Of pulses sent as fast as the line takes them none is lost, none plays twice", COILS, arms=True)
def _flood(host: RawHost) -> str:
    host.arm()
    before, start = host.telemetry().played, host.tick_in(80)
    kept = 0
    for group in range(6):
        data, numbers = b"", list[int]()
        for place in range(OPEN_COMMANDS):
            index = group * OPEN_COMMANDS + place
            payload = encode("pulse", (start + 2 * index * TICKS_PER_MS) % _WRAP, 1 << index % COIL_CHANNELS, 0, _MS)
            numbers.append(host.number())
            data += frame(BY_NAME["pulse"].type, numbers[-1], payload)
        found = host.answers(data, OPEN_COMMANDS)
        need([one.seq for one in found] == numbers, f"answered {[one.seq for one in found]}; sent {numbers}")
        refused = [reply_in_words(one.message) for one in found if one.message.status != Status.OK]
        need(not refused, f"refused: {refused}")
        kept += len(found)
    host.wait_out(220)
    telemetry = host.telemetry()
    played = sum(new - old for new, old in zip(telemetry.played, before, strict=True))
    need(played == kept, f"{played} played of {kept}")
    need(telemetry.state == State.ARMED, f"state {State(telemetry.state).name.lower()} after it")
    return f"{kept} sent, {played} played"
