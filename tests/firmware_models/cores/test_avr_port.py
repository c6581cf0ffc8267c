"""The image of each board on the simulated chip: edges at their ticks whatever else goes on, no byte lost, safe in resets."""

from __future__ import annotations

import random
import subprocess
from itertools import pairwise

import pytest
from avr_bench import (
    BYTE_CYCLES,
    CYCLES_PER_US,
    FEED,
    MS,
    MS_TICKS,
    WRAP,
    AvrBench,
    Edge,
    frame,
    needs_avr,
)

from firmware_models.cores.avr_board import boot_id
from firmware_models.cores.core_settings import CoreSettings
from firmware_models.cores.lockstep import RAM_SIZE, Cause
from firmware_models.cores.toolchain import FIRMWARE
from haptics.link.messages import TICK_HZ, Board, Fault, State, Status

pytestmark = needs_avr

LATEST_US = 10.0  # docs/reference/boards.md
APART_TICKS = 300  # edges further apart than this do not wait for each other, not even on a busy line
ON = [200] * 15
BOTH = pytest.mark.parametrize("kind", [Board.TACTILES, Board.BRAKE])


def lateness_us(bench: AvrBench, wanted: list[tuple[int, int, bool]]) -> list[float]:
    """How late each edge came; ``wanted`` are tick, channel, on. All must come, and nothing else."""
    wanted = sorted(wanted, key=lambda e: (e[1], e[0], e[2]))
    seen = sorted(bench.edges(), key=lambda e: (e.channel, e.cycle, e.on))
    assert [(e.channel, e.on) for e in seen] == [(channel, on) for _, channel, on in wanted]
    late = [(e.cycle - bench.cycle_of(tick)) / CYCLES_PER_US for e, (tick, _, _) in zip(seen, wanted, strict=True)]
    assert min(late) >= 0.0
    return late


def edges_of(start: int, channels: list[int], durations: list[int]) -> list[tuple[int, int, bool]]:
    ends = [(start + 100 * durations[c], c, False) for c in channels]
    return [(start, c, True) for c in channels] + ends


def far_from_others(wanted: list[tuple[int, int, bool]]) -> set[int]:
    """Ticks of edges before which no other lies within ``APART_TICKS``."""
    ticks = sorted({tick for tick, _, _ in wanted})
    return {ticks[0]} | {b for a, b in pairwise(ticks) if b - a >= APART_TICKS}


def mask_of(channels: list[int]) -> int:
    return sum(1 << c for c in channels)


# Start-up, resets, EEPROM.


@BOTH
def test_nothing_moves_before_a_host_asks_for_it(kind) -> None:
    bench = AvrBench(kind)
    bench.run(1000 * MS)
    assert bench.words == []
    assert bench.heard == []
    assert (bench.chip.state, bench.chip.faults) == (State.DISARMED, 0)


@BOTH
def test_each_boot_has_an_id_of_its_own(kind) -> None:
    bench = AvrBench(kind, boots=0xFFFF_FFFF)  # as the EEPROM comes from the factory
    ids = [bench.ask("identify").boot_id]
    for cause in (Cause.EXTERNAL, Cause.POWER_ON, Cause.BROWN_OUT):
        bench.reset(cause)
        ids.append(bench.ask("identify").boot_id)
    assert ids == [boot_id(n) for n in range(4)]
    assert len({boot_id(n) for n in range(10_000)}) == 10_000


def test_the_image_says_which_it_is() -> None:
    builds = {kind: AvrBench(kind).ask("identify").build for kind in (Board.TACTILES, Board.BRAKE)}
    assert builds == {Board.TACTILES: b"avr-tac1", Board.BRAKE: b"avr-brk1"}


def test_settings_in_the_eeprom_hold_where_they_are_stricter_and_whole() -> None:
    stricter = CoreSettings((150, 8000, 32, 3500, 2000), 0)
    assert AvrBench(settings=stricter).ask("identify").limits == stricter.limits
    looser = CoreSettings((250, 20_000, 200, 1000, 9000), 0)
    assert AvrBench(settings=looser).ask("identify").limits == (200, 12_000, 64, 3000, 2500)
    bench = AvrBench(settings=stricter, on=False)
    bench.chip.eeprom[0] ^= 1
    bench.reset(Cause.POWER_ON)
    assert bench.ask("identify").limits == (200, 12_000, 64, 3000, 2500)


def test_a_brown_out_switches_off_at_once_and_is_latched() -> None:
    bench = AvrBench().armed()
    assert bench.ask("pulse", (bench.tick() + 2 * MS_TICKS) % WRAP, 0b1, 0, ON).status == Status.OK
    bench.run(4 * MS)
    assert bench.words[-1][1] == FEED | 1
    at = bench.chip.cycle
    bench.reset(Cause.BROWN_OUT)
    assert bench.words[-1] == (at, 0)
    identity = bench.ask("identify")
    assert bench.chip.faults == 1 << Fault.BROWN_OUT
    assert bench.ask("arm", identity.boot_id).status == Status.INTERLOCK
    assert bench.ask("disarm").detail == 0
    assert bench.ask("arm", identity.boot_id).status == Status.OK
    bench.run(300 * MS)
    assert not any(word & ~FEED for cycle, word in bench.words if cycle >= at)


@pytest.mark.parametrize("cause", [Cause.EXTERNAL, Cause.POWER_ON])
def test_another_reset_latches_nothing(cause) -> None:
    bench = AvrBench().armed()
    bench.reset(cause)
    assert bench.words[-1][1] == 0
    assert (bench.chip.state, bench.chip.faults) == (State.DISARMED, 0)


def hang(bench: AvrBench) -> int:
    """Let the main loop jump to itself where it would sleep; returns where. Interrupts go on."""
    sleep, forever = 0x9588, 0xCFFF
    where = [at for at in range(0, len(bench.chip.flash), 2) if int.from_bytes(bench.chip.flash[at : at + 2], "little") == sleep]
    assert len(where) == 1
    bench.chip.flash[where[0] : where[0] + 2] = forever.to_bytes(2, "little")
    return where[0]


def test_a_hung_main_loop_ends_what_it_began_and_is_reset_by_the_watchdog() -> None:
    bench = AvrBench().armed()
    identity = bench.ask("identify")
    start = bench.tick() + 10 * MS_TICKS
    assert bench.ask("pulse", start % WRAP, 0b1, 0, ON).status == Status.OK
    where = hang(bench)
    at = bench.chip.cycle
    bench.run(100 * MS)
    assert bench.resets == []
    assert max(lateness_us(bench, edges_of(start, [0], ON))) <= LATEST_US
    bench.run(50 * MS)
    bench.chip.flash[where : where + 2] = (0x9588).to_bytes(2, "little")
    # 120 ms nominal; the data sheet lets the watchdog's own oscillator be 10 % off, simavr's is not
    assert 100 * MS < bench.resets[0] - at < 140 * MS
    assert bench.words[-1] == (bench.resets[0], 0)
    bench.run(300 * MS)
    assert bench.ask("identify").boot_id != identity.boot_id
    assert (bench.chip.state, bench.chip.faults) == (State.DISARMED, 0)


USED_AT, WARM_AT = 18, 19  # in the EEPROM
NOT_NOTED = 0xFF


def heat(bench: AvrBench) -> tuple[int, ...]:
    """As the next telemetry has it."""
    bench.ask("identify")
    bench.keep_alive(45)
    return [h for h in bench.heard if h.name == "tactiles_telemetry"][-1].message.heat


def play(bench: AvrBench, count: int) -> None:
    """Pulses of 10 ms on coil 0, one behind the other."""
    start = bench.tick() + 20 * MS_TICKS
    for index in range(count):
        assert bench.ask("pulse", (start + index * 21 * MS_TICKS) % WRAP, 0b1, 0, ON).status == Status.OK
        bench.keep_alive(20)
    bench.keep_alive(60)


def test_what_a_coil_was_on_outlives_a_reset_and_the_watchdog() -> None:
    bench = AvrBench().armed()
    play(bench, 7)
    before = heat(bench)
    assert before[:2] == (4, 0)
    bench.reset(Cause.EXTERNAL)
    assert heat(bench) == before
    where = hang(bench)
    bench.run(300 * MS)
    bench.chip.flash[where : where + 2] = (0x9588).to_bytes(2, "little")
    bench.run(300 * MS)
    assert bench.resets
    assert heat(bench) == before


@pytest.mark.parametrize("cause", [Cause.POWER_ON, Cause.BROWN_OUT])
def test_after_a_loss_of_power_the_eeprom_says_how_warm_coils_may_be(cause) -> None:
    bench = AvrBench()
    bench.reset(cause)
    assert heat(bench) == (0,) * 15
    assert list(bench.chip.eeprom[USED_AT : WARM_AT + 1]) == [NOT_NOTED, NOT_NOTED]
    bench.ask("disarm")
    bench.armed()
    play(bench, 2)
    assert bench.chip.eeprom[USED_AT] != NOT_NOTED
    assert bench.chip.eeprom[WARM_AT] == NOT_NOTED
    bench.reset(cause)
    assert heat(bench) == (5,) * 15
    bench.ask("disarm")
    bench.armed()
    play(bench, 1)
    assert bench.chip.eeprom[WARM_AT] != NOT_NOTED
    bench.reset(cause)
    assert heat(bench) == (125,) * 15
    assert bench.ask("disarm").detail == 0
    bench.armed()
    assert bench.ask("pulse", (bench.tick() + 20 * MS_TICKS) % WRAP, 0b10, 0, ON).status == Status.HOT


def test_a_busy_main_loop_feeds_the_watchdog() -> None:
    bench = AvrBench().armed()
    bench.keep_alive(1000)
    assert bench.resets == []
    assert bench.chip.state == State.ARMED


def test_silence_switches_off_within_the_dead_man_time() -> None:
    bench = AvrBench().armed()
    last = bench.send(frame("keepalive", 0))
    bench.run(200 * MS)
    cycle, word = bench.words[-1]
    assert word == 0
    assert cycle - last <= 100.2 * MS
    assert bench.chip.faults == 1 << Fault.DEAD_MAN


# Edges.


def random_pulses(bench: AvrBench, count: int, between, seed: int) -> list[tuple[int, int, bool]]:
    """Pulses of one to three coils at random ticks; ``between()`` is what else goes on. The edges of those that were taken."""
    rng = random.Random(seed)
    wanted: list[tuple[int, int, bool]] = []
    waiting: dict[int, list[tuple[int, int, bool]]] = {}

    def collect() -> None:
        for heard in bench.heard:
            if heard.name == "reply" and heard.seq in waiting:
                asked = waiting.pop(heard.seq)
                wanted.extend(asked if heard.message.status == Status.OK else [])
        bench.heard.clear()

    for _ in range(count):
        channels = rng.sample(range(15), rng.choice([1, 1, 2, 3]))
        durations = [rng.randint(1, 60) for _ in range(15)]
        start = bench.tick() + 15_000 + rng.randint(0, 15_000)
        seq = bench.command("pulse", start % WRAP, mask_of(channels), 0x5555, durations)
        waiting[seq] = edges_of(start, channels, durations)
        between()
        collect()
    bench.keep_alive(100)
    collect()
    assert not waiting
    return wanted


def test_edges_come_at_their_ticks_and_never_before() -> None:
    bench = AvrBench().armed()
    wanted = random_pulses(bench, 300, lambda: bench.keep_alive(4.5), seed=1)
    late = lateness_us(bench, wanted)
    alone = far_from_others(wanted)
    by_channel = sorted(wanted, key=lambda e: (e[1], e[0], e[2]))
    undisturbed = [us for us, (tick, _, _) in zip(late, by_channel, strict=True) if tick in alone]
    assert len(undisturbed) > 600
    assert max(undisturbed) <= LATEST_US


def test_no_byte_is_lost_and_no_edge_is_late_while_the_line_is_full() -> None:
    bench = AvrBench().armed()
    keepalives = frame("keepalive", 0) * 25

    def flood() -> None:
        end = bench.send(keepalives)
        bench.chip.run(end - BYTE_CYCLES)

    wanted = random_pulses(bench, 160, flood, seed=2)
    assert bench.chip.lost == 0
    late = lateness_us(bench, wanted)
    alone = far_from_others(wanted)
    by_channel = sorted(wanted, key=lambda e: (e[1], e[0], e[2]))
    undisturbed = [us for us, (tick, _, _) in zip(late, by_channel, strict=True) if tick in alone]
    assert len(undisturbed) > 200
    assert max(undisturbed) <= LATEST_US
    bench.run(25 * MS)
    assert [h for h in bench.heard if h.name == "tactiles_telemetry"][-1].message.bad_frames == 0


@pytest.mark.parametrize("apart", [1, 8, 20, 60])
def test_edges_a_few_microseconds_apart_all_come_in_their_order(apart) -> None:
    """Each needs the time in which the chain of shift registers is filled, and the core's for the next."""
    bench = AvrBench().armed()
    start = bench.tick() + 60 * MS_TICKS
    durations = [10] * 15
    wanted = []
    for k in range(3):
        assert bench.ask("pulse", (start + apart * k) % WRAP, 1 << k, 0, durations).status == Status.OK
        wanted += edges_of(start + apart * k, [k], durations)
    bench.keep_alive(100)
    late = lateness_us(bench, wanted)
    assert [(e.channel, e.on) for e in bench.edges()] == [(0, True), (1, True), (2, True), (0, False), (1, False), (2, False)]
    assert max(late) <= 60.0


def test_a_word_is_taken_over_as_a_whole() -> None:
    bench = AvrBench().armed()
    start = bench.tick() + 30 * MS_TICKS
    durations = [20, 20, 20] + [1] * 12
    assert bench.ask("pulse", start % WRAP, 0b111, 0b101, durations).status == Status.OK
    before = len(bench.words)
    bench.keep_alive(60)
    assert [word for _, word in bench.words[before:]] == [FEED | 0b111 | 0b101 << 16, FEED]


@pytest.mark.parametrize("lead_ms", [0.4, 15, 17, 32.768, 33, 500, 999])
def test_a_lead_longer_or_shorter_than_the_timer_is_kept(lead_ms) -> None:
    bench = AvrBench().armed()
    bench.run(3 * MS)
    seq = bench.seq + 1
    start = bench.tick() + 2000 + round(lead_ms * MS_TICKS)
    bench.command("pulse", start % WRAP, 1, 0, ON)
    bench.keep_alive(lead_ms + 30)
    assert [h.message.status for h in bench.heard if h.seq == seq and h.name == "reply"] == [Status.OK]
    assert max(lateness_us(bench, edges_of(start, [0], ON))) <= LATEST_US


@pytest.mark.parametrize("low", [0, 1, 2, 31, 32, 33, 0x7FFF, 0x8000, 0xFFFF])
def test_any_count_of_the_timer_can_be_an_edge(low) -> None:
    bench = AvrBench().armed()
    start = (bench.tick() + 40_000 & ~0xFFFF) + 0x10000 + low
    durations = [1] + [0] * 14
    bench.command("pulse", start % WRAP, 1, 0, durations)
    bench.keep_alive(100)
    assert max(lateness_us(bench, edges_of(start, [0], durations))) <= LATEST_US


def test_edges_and_stamps_are_right_across_the_wrap_of_the_count() -> None:
    bench = AvrBench().armed()
    bench.keep_alive((WRAP - bench.tick()) / MS_TICKS - 300)
    assert 0 < WRAP - bench.tick() < TICK_HZ
    wanted = []
    for start in (WRAP - 30_000, WRAP - 5_000, WRAP - 1, WRAP + 30_000):  # the second is on at the wrap
        channel = len(wanted) // 2
        assert bench.ask("pulse", start % WRAP, 1 << channel, 0, ON).status == Status.OK
        wanted += edges_of(start, [channel], ON)
        bench.keep_alive(10)
    bench.keep_alive(400)
    late = lateness_us(bench, wanted)
    assert max(late) <= LATEST_US
    assert abs(bench.ask("sync", 1).sent - bench.tick() % WRAP) < MS_TICKS


def test_stop_is_at_once_past_the_queue() -> None:
    bench = AvrBench().armed()
    start = bench.tick() + 40 * MS_TICKS
    for k in range(3):
        assert bench.ask("pulse", (start + 30 * MS_TICKS * k) % WRAP, 1 << k, 0, ON).status == Status.OK
    bench.chip.run(bench.cycle_of(start + 1000))
    assert bench.words[-1][1] == FEED | 1
    bench.command("stop")
    asked = bench.line_free
    bench.run(300 * MS)
    cycle, word = bench.words[-1]
    assert word == 0
    assert cycle - asked < MS // 2
    assert bench.edges()[-1] == Edge(cycle, 0, False)


# The line and the clock.


def test_stamps_of_sync_are_what_the_protocol_says() -> None:
    """``received`` not before the last bit is in, ``sent`` not after the first one goes out; both as near as they can be had."""
    bench = AvrBench().armed()
    rng = random.Random(3)
    for _ in range(200):
        arrived = bench.send(frame("sync", 0, rng.getrandbits(32)), bench.chip.cycle + rng.randrange(20_000))
        known = len(bench.heard)
        bench.run(arrived - bench.chip.cycle + 3 * MS)
        (answer,) = [h for h in bench.heard[known:] if h.name == "sync_reply"]
        received = answer.message.received - bench.tick(arrived) % WRAP
        sent = bench.tick(answer.begun) % WRAP - answer.message.sent
        assert 0 <= received <= 30
        assert 0 <= sent <= 100


def test_bytes_go_out_one_behind_the_other() -> None:
    bench = AvrBench()
    bench.ask("identify")
    (identity,) = bench.heard
    # begun is the end less the bytes' own time: a gap would make it earlier than what was asked
    assert identity.begun >= bench.line_free
    assert identity.ended - identity.begun == BYTE_CYCLES * len(frame("identity", 0, *identity.message))


def test_a_window_of_eight_commands_is_taken_whole() -> None:
    bench = AvrBench().armed()
    start = bench.tick() + 100 * MS_TICKS
    for k in range(8):
        bench.command("pulse", (start + 20 * MS_TICKS * k) % WRAP, 1 << k, 0, ON)
    bench.run(20 * MS)
    replies = [h.message.status for h in bench.heard if h.name == "reply" and h.seq > 1]
    assert replies == [Status.OK] * 8
    assert bench.chip.lost == 0


def test_every_count_of_the_converter_gets_through() -> None:
    bench = AvrBench()
    bench.ask("identify")
    for count in range(1024):
        bench.senses = {0: count, 1: 1023 - count}
        known = len(bench.heard)
        bench.run(41 * MS)
        telemetry = bench.heard[-1].message
        assert len(bench.heard) - known >= 2  # the first may have begun before
        assert (telemetry.supply, telemetry.current) == (10 * count, 64 * (1023 - count))


# The simulator.


def test_what_happens_does_not_depend_on_the_steps_in_which_it_is_asked_for() -> None:
    def run(slices: random.Random | None) -> tuple:
        bench = AvrBench().armed()
        begun, rng = bench.chip.cycle, random.Random(4)
        for k in range(20):
            ends = begun + k * 10 * MS
            bench.send(frame("pulse", k + 10, (bench.tick(ends) + 9000) % WRAP, 1 << k % 15, 0, [rng.randint(1, 40)] * 15), ends)
        while bench.chip.cycle < begun + 250 * MS:
            step = slices.randrange(1, 3000) if slices else 250 * MS
            bench.chip.run(min(bench.chip.cycle + step, begun + 250 * MS))
        return bench.words, bench.heard, bench.converted

    assert run(None) == run(random.Random(5))


def test_a_frame_is_known_of_before_it_ends_to_who_steps_from_event_to_event() -> None:
    bench = AvrBench().armed()
    keep_alive_at = bench.chip.cycle
    while len(bench.heard) < 40:
        if bench.chip.cycle >= keep_alive_at:
            bench.send(frame("sync", 0, 7))
            keep_alive_at += 30 * MS
        known, until = len(bench.heard), bench.chip.next
        assert until >= bench.chip.cycle
        bench.chip.run(until + 1)
        assert all(heard.ended >= until for heard in bench.heard[known:])


def test_the_stack_keeps_well_clear_of_the_variables() -> None:
    bench = AvrBench(on=False)
    paint = 0xA5
    bench.chip.ram[:] = bytes([paint]) * RAM_SIZE
    bench.reset(Cause.POWER_ON)
    bench.armed()

    def flood() -> None:
        bench.send(frame("keepalive", 0) * 30)
        bench.run(4 * MS)

    random_pulses(bench, 60, flood, seed=6)
    untouched = 0
    longest = 0
    for byte in bench.chip.ram:
        untouched = untouched + 1 if byte == paint else 0
        longest = max(longest, untouched)
    assert longest >= 128  # bytes never used between the variables and the deepest stack


# Sizes.


@pytest.mark.slow
def test_an_image_that_is_too_big_is_not_made(tmp_path) -> None:
    command = ["make", "-C", str(FIRMWARE), "tactiles", f"OUT={tmp_path}"]
    for limit in ("RAM_LIMIT=1000", "FLASH_LIMIT=5000"):
        done = subprocess.run([*command, limit], capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert "too big for the board" in done.stderr
        assert list(tmp_path.iterdir()) == []
