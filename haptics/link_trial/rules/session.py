"""Rules of frames, identity, clock and numbers: what a board does with bytes, and that no command is carried out twice."""

from __future__ import annotations

from haptics.link.clock import signed_ticks
from haptics.link.messages import (
    BRAKE_CHANNELS,
    BY_NAME,
    COIL_CHANNELS,
    MESSAGES,
    PROTOCOL_VERSION,
    REMEMBERED_REPLIES,
    TICK_HZ,
    Board,
    State,
    Status,
    schema_hash,
)
from haptics.link_trial.examples import EXAMPLES, example_frame
from haptics.link_trial.raw_frames import frame
from haptics.link_trial.raw_host import Heard, RawHost, need, reply_in_words
from haptics.link_trial.rules.rule import Rules
from haptics.time import NS_PER_US

RULES = Rules()

_BYTE_NS = 20 * NS_PER_US
_STAMP_NS = 2 * NS_PER_US  # the jitter that hosts allow for
_ASKED, _ANSWERED = 10, 18  # bytes of sync and sync_reply on the wire, where no byte is stuffed
_NUMBER = 200  # of a command that stands for any


@RULES.rule("identify.unasked", "Before identify, a board sends nothing but its identity", simulated=True, met=False)
def _nothing_unasked(host: RawHost) -> str:
    host.run(150)
    names = {one.name for one in host.heard} - {"identity"}
    need(not names, f"unasked, it sent {', '.join(sorted(names))}")
    return "nothing else in 150 ms"


@RULES.rule("identify.always", "identify is answered each time, under the number of the question")
def _identify_always(host: RawHost) -> str:
    for seq in (0, 0, 7, 7, 255):
        found = host.answers(frame(BY_NAME["identify"].type, seq))
        names = [one.name for one in found]
        need(names == ["identity"] and found[0].seq == seq, f"number {seq} brought {[(one.name, one.seq) for one in found]}")
    return "five questions, five identities"


@RULES.rule("identify.armed", "identify is answered while armed, and disarms nothing", arms=True)
def _identify_armed(host: RawHost) -> str:
    host.arm()
    host.ask("identify")
    state = host.telemetry().state
    need(state == State.ARMED, f"state {State(state).name.lower()} after it")
    return "still armed"


@RULES.rule("identity.fields", "identity contains version, board, channels, tick rate, dead-man time and limits of this protocol")
def _identity_fields(host: RawHost) -> str:
    identity = host.ask("identify")
    channels = COIL_CHANNELS if host.board == Board.TACTILES else BRAKE_CHANNELS
    seen = (identity.protocol, identity.channels, identity.tick_hz, identity.dead_man)
    need(seen == (PROTOCOL_VERSION, channels, TICK_HZ, 100), f"protocol, channels, ticks a second, dead-man: {seen}")
    need(all(identity.limits), f"limits {identity.limits}")
    return f"protocol {identity.protocol}, {channels} channels, limits {identity.limits}"


@RULES.rule("identity.schema", "identity carries the hash of the message table")
def _identity_schema(host: RawHost) -> str:
    found = host.ask("identify").schema_hash
    need(found == schema_hash(), f"{found:08x}, this table is {schema_hash():08x}")
    return f"{found:08x}"


@RULES.rule("identity.boot-id", "The boot id does not change until the board reboots")
def _boot_id(host: RawHost) -> str:
    first = host.identity.boot_id
    for _ in range(3):
        host.ask("disarm")
        again = host.ask("identify").boot_id
        need(again == first, f"{first:08x}, then {again:08x}")
    return f"{first:08x}"


@RULES.rule("frames.golden", "The golden frames of the protocol page are understood")
def _golden(host: RawHost) -> str:
    before = host.telemetry().bad_frames
    tried = [message.name for message in MESSAGES if message.sender == "host" and host.board in message.boards]
    if host.simulated is None:
        tried.remove("configure")  # its limits would last until the next boot
    for name in tried:
        seq = EXAMPLES[name].seq
        found = host.answers(example_frame(name), wait_ms=2 if name == "keepalive" else None)
        if name == "keepalive":
            need(not found, "keepalive was answered")
            continue
        need(len(found) == 1, f"{name} brought {len(found)} answers")
        need(found[0].seq == seq, f"{name} number {seq} was answered under {found[0].seq}")
        status = getattr(found[0].message, "status", Status.OK)
        need(status not in (Status.UNKNOWN, Status.BAD_LENGTH), f"{name} was answered {Status(status).name.lower()}")
    bad = host.telemetry().bad_frames - before
    need(bad == 0, f"{bad} of them counted as bad")
    return f"{len(tried)} frames"


@RULES.rule("sync.token", "sync_reply carries the token, and was sent no earlier than sync was received")
def _sync_token(host: RawHost) -> str:
    turns: list[int] = []
    for token in (0, 1, 0xFFFFFFFF, 0x01020304):
        reply = host.ask("sync", token)
        need(reply.token == token, f"token {token:#x} came back as {reply.token:#x}")
        turns.append(signed_ticks(reply.sent, reply.received))
        need(turns[-1] >= 0, f"sent {-turns[-1]} ticks before it was received")
    return f"turned round within {max(turns) / 2:g} us"


@RULES.rule("sync.rate", "The board counts 2 MHz, within 0.6 %")
def _sync_rate(host: RawHost) -> str:
    first_ns, first = host.now_ns, host.ask("sync", 1).received
    host.run(500)
    second_ns, second = host.now_ns, host.ask("sync", 2).received
    rate = signed_ticks(second, first) / (second_ns - first_ns) * 1e9
    allowed = 0.006 if host.simulated is not None else 0.05  # a busy machine reads late
    need(abs(rate / TICK_HZ - 1) <= allowed, f"{rate:.0f} ticks a second")
    return f"{rate:.0f} ticks a second"


@RULES.rule(
    "sync.stamps", "A sync is stamped at its last byte's arrival, its answer at its first byte's departure", simulated=True
)
def _sync_stamps(host: RawHost) -> str:
    early_ns = late_ns = 0
    for token in (0x11111111, 0x22222222, 0x33333333):
        begun_ns = host.now_ns
        reply = host.ask("sync", token)
        arrived_ns, left_ns = begun_ns + _ASKED * _BYTE_NS, host.now_ns - _ANSWERED * _BYTE_NS
        received_ns, sent_ns = host.outputs.tick_ns(reply.received), host.outputs.tick_ns(reply.sent)
        early_ns = max(early_ns, arrived_ns - received_ns, sent_ns - left_ns)
        late_ns = max(late_ns, received_ns - arrived_ns, left_ns - sent_ns)
        host.run(3.3)
    need(early_ns <= _STAMP_NS, f"received {early_ns / 1000:g} us before it was, or sent so much after")
    need(late_ns <= 50 * NS_PER_US, f"{late_ns / 1000:g} us beside the byte")
    return f"within {max(early_ns, late_ns) / 1000:g} us of the byte"


@RULES.rule("reply.number", "Each command is answered once, by reply, under its own number")
def _reply_number(host: RawHost) -> str:
    numbers = [1, 2, 254, 255, 1, 17]
    for seq in numbers:
        host.ask("identify")
        found = host.answers(frame(BY_NAME["disarm"].type, seq))
        host.run(3)
        need([(one.name, one.seq) for one in found] == [("reply", seq)], f"number {seq} brought {found}")
    return f"{len(numbers)} commands, {len(numbers)} replies"


@RULES.rule("reply.time", "A reply carries the tick at which the command was dealt with")
def _reply_time(host: RawHost) -> str:
    before = host.ask("sync", 1).sent
    reply = host.ask("disarm")
    after = host.ask("sync", 2).received
    inside = signed_ticks(reply.time, before) >= 0 and signed_ticks(after, reply.time) >= 0
    need(inside, f"{reply.time}, between {before} and {after}")
    return f"{signed_ticks(reply.time, before)} ticks after the question before it"


def _again(host: RawHost, seq: int, name: str = "disarm") -> Heard:
    host.run(2)
    found = host.answers(frame(BY_NAME[name].type, seq))
    need(len(found) == 1, f"number {seq} brought {len(found)} answers")
    return found[0]


@RULES.rule("repeat.same", "A number that is kept gets the first reply again, whatever the frame contains")
def _repeat_same(host: RawHost) -> str:
    first = _again(host, _NUMBER).message
    need(_again(host, _NUMBER).message == first, "the same frame got another reply")
    for name, data in (
        ("an arm", frame(BY_NAME["arm"].type, _NUMBER, bytes(4))),
        ("an unknown message", frame(0x33, _NUMBER)),
        ("a message of a wrong length", frame(BY_NAME["configure"].type, _NUMBER, b"123")),
    ):
        host.run(2)
        found = host.answers(data)
        need(len(found) == 1 and found[0].message == first, f"{name} with its number got another reply")
    return f"reply of tick {first.time} five times"


@RULES.rule("repeat.refusal", "Refusals are kept like any reply")
def _repeat_refusal(host: RawHost) -> str:
    found = host.answers(frame(0x33, _NUMBER))
    need(bool(found), "an unknown message was not answered")
    again = _again(host, _NUMBER).message
    need(again == found[0].message, f"unknown, then {reply_in_words(again)}")
    return "unknown twice"


@RULES.rule("repeat.sixteen", "Sixteen replies are kept, and no more")
def _sixteen(host: RawHost) -> str:
    host.ask("identify")
    numbers = range(50, 50 + REMEMBERED_REPLIES)
    first = {seq: _again(host, seq).message for seq in numbers}
    for seq in reversed(numbers):  # repetitions push nothing out
        need(_again(host, seq).message == first[seq], f"number {seq} was forgotten within {REMEMBERED_REPLIES}")
    _again(host, 150)
    need(_again(host, numbers[1]).message == first[numbers[1]], "a seventeenth pushed two out")
    need(_again(host, numbers[0]).message != first[numbers[0]], "a seventeenth pushed none out")
    return "sixteen repeated, the seventeenth before them not"


@RULES.rule("repeat.zero", "Number 0 is never kept")
def _zero(host: RawHost) -> str:
    first, second = _again(host, 0).message, _again(host, 0).message
    need(first.time != second.time, "the second was answered by the first one's reply")
    kept = _again(host, _NUMBER).message
    for _ in range(REMEMBERED_REPLIES):
        _again(host, 0)
    need(_again(host, _NUMBER).message == kept, "it takes the place of a kept one")
    return "answered afresh each time"


@RULES.rule("repeat.identify", "identify empties the kept replies")
def _identify_empties(host: RawHost) -> str:
    first = _again(host, _NUMBER).message
    host.ask("identify")
    need(_again(host, _NUMBER).message != first, "a number from before it was still kept")
    return "carried out anew after it"


@RULES.rule("repeat.stop", "stop is carried out whatever its number", arms=True)
def _repeat_stop(host: RawHost) -> str:
    host.arm()
    host.expect("configure", host.identity.limits, status=Status.INTERLOCK, detail=None, seq=_NUMBER)
    host.expect("stop", seq=_NUMBER)
    need(host.telemetry().state in (State.DISARMED, State.DISCHARGING), "it was taken for a repetition")
    return "carried out under a kept number"
