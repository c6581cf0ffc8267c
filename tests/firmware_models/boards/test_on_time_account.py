"""The coils' accounts of on-time: what hostile hosts can do to a tactor, seen in the plant; and what legal ones never meet."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator

import pytest
from core_bench import MS, SUPPLY, WRAP, Bench, CoilHeat as KeptHeat, Memory
from cores import on_every_core
from sim_host import Host

from firmware_models.boards.coil_heat import CoilHeat
from haptics.link.messages import COIL_CHANNELS, State, Status
from haptics.link_trial.workload import CoilCommands
from haptics.physics.thermal.one_node import ThermalParameters
from haptics.scheduling.thermal_budget import ThermalBudget

NS_PER_MS = 1_000_000
TAU_S = 102.0  # thesis 3.5.2
LIMIT_S = 2.5
TEN_MS = [200] * COIL_CHANNELS
WORST_W = 25.0 / 1.28  # 5 V on 1.38 - 0.1 ohm, thesis 3.4.3
NOMINAL_K = LIMIT_S * 69 * 25 / 1.38 / TAU_S  # as if all of it came at once: 30.6 K at the 18.1 W that a cold coil takes
WORST_K = LIMIT_S * 79 * WORST_W / 97  # thesis 3.5.2: 69 +- 10 K/W, 102 +- 5 s
WORST = {"c_k_per_w": 79, "tau_s": 97, "resistance_ohm": 1.28}


class Attacker(Host):
    """Asks one coil for all that a board will take, from a queue that is never empty."""

    def attack(self, seconds: float, channel: int = 1, duration: int = 200) -> dict[Status, int]:
        """Pulses of so many 50 us, 50 us apart."""
        before = len(self.heard)
        begun_ns, start, apart = self.now_ns, self.tick_in(10), 100 * (duration + 1)
        at_ns = begun_ns
        while at_ns < begun_ns + seconds * 1e9:
            self.send("pulse", start % WRAP, 1 << channel, 1 << channel, [duration] * COIL_CHANNELS)
            start, at_ns = start + apart, at_ns + apart * 500
            if self.now_ns < at_ns - 30 * NS_PER_MS:
                self.listen(at_ns - 30 * NS_PER_MS)
        self.live(50)
        statuses = [Status(one.message.status) for one in self.heard[before:] if one.name == "reply"]
        return {status: statuses.count(status) for status in set(statuses)}

    def reboot(self, how: str) -> None:
        """Cut the board short, in the middle of a frame it may be, and meet it again."""
        self.port.set_load(0, **{how: 1})
        self.run(25)
        self.send("identify")  # what answers it may be lost behind half a frame
        self.run(10)
        self.ask("identify")

    def rise_k(self) -> float:
        return max(self.port.truth()["rise_k"])


@pytest.fixture
def attacker() -> Iterator[Callable[..., Attacker]]:
    opened: list[Attacker] = []

    def armed(core: str, **query: object) -> Attacker:
        keys = "".join(f"&{key}={value}" for key, value in query.items())
        opened.append(Attacker(f"sim://tactiles?clock=virtual&core={core}{keys}"))
        opened[-1].run(20)  # a chip boots
        opened[-1].arm()
        return opened[-1]

    yield armed
    for one in opened:
        one.port.close()


# What a hostile host can do.


@on_every_core
def test_pulses_without_end_warm_a_tactor_to_what_the_account_allows_and_no_further(attacker, core):
    a = attacker(core, spread=0)
    statuses = a.attack(3.5)
    assert set(statuses) == {Status.OK, Status.HOT}
    assert 0.95 * NOMINAL_K < a.rise_k() < NOMINAL_K
    assert a.port.truth()["state"] == 2
    assert a.last("tactiles_telemetry").heat[1] == 125


@on_every_core
def test_the_worst_tactor_within_tolerance_stays_below_what_its_account_allows(attacker, core):
    a = attacker(core, spread=0, **WORST)
    a.attack(4.0)
    assert 0.9 * WORST_K < a.rise_k() < WORST_K < 41


@pytest.mark.soak
@on_every_core
def test_an_attack_of_minutes_is_worth_no_more(attacker, core):
    a = attacker(core, spread=0, **WORST)
    a.attack(60 if core == "avr" else 300)
    assert a.rise_k() < WORST_K


@on_every_core
@pytest.mark.parametrize("how", ["disarm", "stop", "silence", "reset", "brown_out"])
def test_no_form_of_ending_and_beginning_anew_gives_a_coil_more(attacker, core, how):
    """80 ms at a time, less than is noted without power, eight times over: were each to begin at nothing, 0.64 s more."""
    a = attacker(core, spread=0, **WORST)
    for _ in range(8):
        a.attack(0.08)
        if how in ("disarm", "stop"):
            a.ask(how)
        elif how == "silence":
            a.run(150)
        else:
            a.reboot(how)
        a.ask("disarm")
        assert a.status("arm", a.ask("identify").boot_id) == Status.OK
    a.attack(2.6)
    assert a.rise_k() < WORST_K + 0.1 / 97 * 79 * WORST_W  # the minimum that is noted


@on_every_core
def test_a_reset_charges_what_waited_as_if_it_had_played(attacker, core):
    """0.4 s of pulses wait when the board is cut short: of a queue the firmware no longer knows it can only think the worst."""
    a = attacker(core, spread=0)
    start = a.tick_in(300)
    for index in range(40):
        a.send("pulse", (start + index * 21_000) % WRAP, 2, 2, TEN_MS)
        a.listen(a.now_ns + NS_PER_MS)
    a.live(100)
    a.reboot("reset")
    a.live(50)
    assert 0.38 <= 0.02 * a.last("tactiles_telemetry").heat[1] <= 0.52


@on_every_core
def test_what_is_asked_for_and_called_off_again_makes_no_room(attacker, core):
    """Half an account warm, then 0.6 s at a time waiting and cancelled; it cools by itself, and no quicker."""
    a = attacker(core, spread=0)
    a.attack(1.2)
    begun_ns, begun_s = a.now_ns, 0.02 * a.last("tactiles_telemetry").heat[1]
    for _ in range(6):
        start = a.tick_in(300)
        for index in range(60):
            a.send("pulse", (start + index * 21_000) % WRAP, 2, 2, TEN_MS)
            a.listen(a.now_ns + NS_PER_MS)
        a.live(200)
        assert a.ask("cancel", 2).detail == 60
    a.live(25)
    left_s = begun_s * math.exp(-(a.now_ns - begun_ns) / 1e9 / TAU_S)
    assert 0.02 * a.last("tactiles_telemetry").heat[1] == pytest.approx(left_s, abs=0.021)  # two roundings up


@on_every_core
@pytest.mark.parametrize("how", ["disarm", "reset"])
def test_a_stuck_driver_gives_no_more_however_often_it_is_armed(attacker, core, how):
    a = attacker(core, spread=0, **WORST)
    a.attack(2.4)
    a.port.set_load(1, driver_stuck=1)
    answers = []
    for _ in range(30):
        a.live(20)
        if how == "reset":
            a.reboot("reset")
        a.ask("disarm")
        answers.append(a.status("arm", a.ask("identify").boot_id))
    assert Status.OK in answers
    assert answers.count(Status.HOT) > 15
    assert a.rise_k() < WORST_K + 0.014 / 97 * 79 * WORST_W


@on_every_core
@pytest.mark.parametrize(("how", "apart_ms"), [("disarm", 9), ("stop", 3), ("disarm", 0)])
def test_a_stuck_driver_gives_no_more_to_a_host_that_ends_before_anything_latches(attacker, core, how, apart_ms):
    """Fed for less than it takes to notice, and at the shortest for less than until the first look, over and over."""
    a = attacker(core, spread=0, **WORST)
    a.attack(2.4)
    a.port.set_load(1, driver_stuck=1)
    boot_id = a.ask("identify").boot_id
    answers = []
    for _ in range(900 // (apart_ms + 2)):
        a.ask(how)
        answers.append(a.status("arm", boot_id))
        a.run(apart_ms)
    assert Status.OK in answers
    assert answers[-1] == Status.HOT
    assert a.rise_k() < WORST_K + 0.014 / 97 * 79 * WORST_W


@on_every_core
@pytest.mark.parametrize("supply_ohm", [0.0, 0.45])
@pytest.mark.parametrize(("period_ms", "duration"), [(1, 1), (3, 30), (5, 99)])
def test_no_pulses_of_other_coils_hide_a_driver_that_is_stuck(attacker, core, period_ms, duration, supply_ohm):
    """Short ones at every look, as long as the pauses between them, and nearly without a pause; on a supply that sags, too."""
    a = attacker(core, spread=0, supply_ohm=supply_ohm, **WORST)
    a.port.set_load(1, driver_stuck=1)
    start = a.tick_in(5)
    for index in range(120 // period_ms):
        channel = 2 + index % 13
        a.send("pulse", (start + index * period_ms * 2000) % WRAP, 1 << channel, 0, [duration] * COIL_CHANNELS)
        a.listen(a.now_ns + period_ms * NS_PER_MS)
    assert a.port.truth()["state"] == State.FAULT
    assert a.rise_k() < 0.08 / 97 * 79 * WORST_W


@on_every_core
def test_a_sound_board_pays_nothing_for_being_armed_and_looked_at(attacker, core):
    a = attacker(core, spread=0)
    boot_id = a.ask("identify").boot_id
    for _ in range(40):
        a.live(3)
        a.ask("disarm")
        assert a.status("arm", boot_id) == Status.OK
    a.live(25)
    assert a.last("tactiles_telemetry").heat == (0,) * COIL_CHANNELS


# The C core, beside an account of the test's own.


@pytest.fixture
def bench(library) -> Iterator[Callable[..., Bench]]:
    opened: list[Bench] = []

    def boot(**keys) -> Bench:
        opened.append(Bench(library, **keys))
        opened[-1].senses = lambda sense: 500 if sense == SUPPLY else 0
        return opened[-1]

    yield boot
    for one in opened:
        one.close()


def test_the_account_is_the_integral_it_stands_for(bench):
    """Random pulses, cancels and stops: what is taken stays within the limit, and what is hot would not have."""
    rng = random.Random(5)
    limit_ms = 60
    h = bench(limits=(200, 12_000, 64, 3000, limit_ms), start=WRAP - 30_000 * MS)
    h.arm()
    account = [0.0] * COIL_CHANNELS  # ms, of what began
    waiting: list[tuple[int, int, float]] = []  # start, channel, ms
    at = h.now
    seen = {Status.OK: 0, Status.HOT: 0}

    def carry() -> None:
        nonlocal at, account, waiting
        begun = sorted(pulse for pulse in waiting if pulse[0] <= h.now)
        waiting = [pulse for pulse in waiting if pulse[0] > h.now]
        for start, channel, ms in [*begun, (h.now, 0, 0.0)]:
            account = [one * math.exp(-max(start - at, 0) / 2e6 / TAU_S) for one in account]
            at = max(at, start)
            account[channel] += ms

    for _ in range(1500):
        carry()
        channel = rng.randrange(4)
        duration = rng.choice((1, 5, 20, 100, 200))
        start = h.now + rng.randrange(10, 400_000)
        status, detail = h.answer("pulse", start % WRAP, 1 << channel, 0, [duration] * 15)
        wanted_ms = account[channel] + sum(ms for _, one, ms in waiting if one == channel) + duration / 20
        if status == Status.OK:
            waiting.append((start, channel, duration / 20))
            assert wanted_ms <= limit_ms * 1.0001
        elif status == Status.HOT:
            assert detail == 1 << channel
            assert wanted_ms > limit_ms * 0.9995
        if status in seen:
            seen[status] += 1
        if rng.random() < 0.02:
            assert h.answer("cancel", 0b11)[0] == Status.OK
            waiting = [pulse for pulse in waiting if pulse[1] > 1]
        if rng.random() < 0.005:
            assert h.answer("stop")[0] == Status.OK
            waiting.clear()
            h.arm()
        h.live(rng.choice((1, 100, 10_000, 100_000, 1_000_000)))
    carry()
    h.ask("identify", seq=0)
    expected = [math.ceil((account[k] + sum(ms for _, one, ms in waiting if one == k)) / 20) for k in range(15)]
    assert all(0 <= shown - true <= 1 for shown, true in zip(h.telemetry().heat, expected, strict=True))
    assert min(seen.values()) > 150


def test_a_long_time_after_its_last_pulse_a_coil_is_cold_and_the_board_has_nothing_to_do(bench):
    h = bench()
    h.arm()
    assert h.answer("pulse", h.now + MS, 1, 0, TEN_MS) == (Status.OK, 0)
    h.run(50 * MS)
    assert h.answer("stop") == (Status.OK, 0)
    assert h.next < 100 * MS
    h.jump(3600 * 2_000_000 // 4 * 3)
    h.jump(1800 * 2_000_000 // 4 * 3)
    assert h.memory.heat[0].on_time == 0
    assert h.next > 1000 * MS


GARBAGE = [0, 1, 0xFFFF_FFFF, 0x1234_5678]


@pytest.mark.parametrize("left", GARBAGE)
@pytest.mark.parametrize(("notes", "worst"), [(0, 0), (1, 5), (3, 125), (2, 125)])
def test_memory_that_lost_its_power_is_not_believed(bench, left, notes, worst):
    memory = Memory(notes=notes)
    for heat in memory.heat:
        heat.on_time, heat.check = left, left & 0xFFFF
    h = bench(memory=memory)
    h.ask("identify", seq=0)
    assert h.telemetry().heat == (worst,) * COIL_CHANNELS


def test_an_account_torn_by_a_reset_costs_that_coil_alone(bench):
    h = bench()
    h.arm()
    assert h.answer("pulse", h.now + MS, 0b11, 0, TEN_MS) == (Status.OK, 0)
    h.run(20 * MS)
    h.memory.heat[0].check ^= 1
    again = bench(memory=h.memory)
    again.ask("identify", seq=0)
    assert again.telemetry().heat[:3] == (5, 1, 0)
    assert isinstance(again.memory.heat[0], KeptHeat)


def test_notes_without_power_change_minutes_apart_at_most(bench):
    """A coil kept about the threshold by one pulse after another: a cell of the EEPROM stands 100,000 changes."""
    h = bench()
    h.arm()
    changes, before = 0, h.memory.notes
    for _ in range(2000):
        if h.memory.heat[0].on_time < 2000 << 16:  # 100 ms
            h.answer("pulse", (h.now + MS) % WRAP, 1, 0, TEN_MS)
        h.live(40 * MS)
        changes += h.memory.notes != before
        before = h.memory.notes
    assert before == 3
    assert changes == 2  # used, then warm
    h.answer("stop")
    h.jump(69 * 2_000_000)
    assert h.memory.notes == 3
    h.jump(15 * 2_000_000)
    assert h.memory.notes == 1


# What legal hosts never meet.


@pytest.mark.parametrize("ms", [10, 5, 1])
def test_a_host_that_keeps_a_tactor_below_25_k_never_meets_the_limit(bench, ms):
    """As fast as its heat account lets it, from cold, for five minutes."""
    h = bench()
    h.arm()
    budget = ThermalBudget(ThermalParameters())
    refused = 0
    for _ in range(300_000 // 20 if ms == 10 else 4000):
        now_ns = h.now * 500
        if budget.allows(18e-3 * ms, now_ns):
            status, _ = h.answer("pulse", (h.now + MS) % WRAP, 1, 0, [20 * ms] * 15)
            refused += status != Status.OK
            budget.spend(18e-3 * ms, now_ns)
        h.live(20 * MS)
    assert refused == 0
    assert budget.rise_k(h.now * 500) > (24 if ms == 10 else 0)


def test_the_trials_own_commands_stay_within_the_account():
    rng = random.Random(3)
    commands, heat = CoilCommands((200, 12_000, 64, 3000, 2500), rng), CoilHeat(0)
    nothing = [0.0] * COIL_CHANNELS
    now_ns, on_s = 0, 0.0
    for _ in range(12_000):
        command = commands.next(now_ns)
        now_ns += rng.randint(2, 5) * NS_PER_MS
        if command is None:
            continue
        wanted = [5e-5 * duration for duration in command.values[2]]
        assert heat.hot(wanted, nothing, LIMIT_S, now_ns) == 0
        for channel, duration_s in enumerate(wanted):
            heat.begin(channel, duration_s, now_ns)
            on_s += duration_s
    assert on_s > 15 * LIMIT_S  # more than fits from cold
