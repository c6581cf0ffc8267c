"""What a level costs: CPU time for one event, and for a simulated second of many devices, on the machine this runs on."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from haptics.physics.brake.bank import BrakeBank
from haptics.physics.brake.levels import brake_plant
from haptics.physics.latch.bank import LatchBank
from haptics.physics.latch.parameters import NOMINAL_VOLTS
from haptics.physics.latch.pulse import latch_plant
from haptics.physics.thermal.one_node import PULSE_POWER_W, PULSE_S
from haptics.physics.thermal.plant import thermal_plant

DEVICES = (1, 15, 64, 1000)
SWITCHES_HZ = 2.0
"""How often each device acts in the simulated second (thesis 3.5.2 for the latch)."""
_PERIOD_S = 1.0 / SWITCHES_HZ
_BANK_STEP_S = {"lagged": 0.5e-3, "dynamic": 50e-6}
"""As the same levels step a single clutch."""
_REPEATS = 5
_ENOUGH_S = 0.2


Job = Callable[[float], None]
"""Carries its devices on by as many seconds as it was made for, from the time it is given."""
_Maker = Callable[[int, float], Job]
"""Of a job, for so many devices and seconds."""


@dataclass(frozen=True)
class Cost:
    """What a level costs on this machine.

    :param us_per_event: CPU time of one device's switch or engagement (us).
    :param s_per_sim_s: CPU seconds for a simulated second, by number of devices.
    """

    us_per_event: float
    s_per_sim_s: dict[str, float]


def latch_cost(level: str) -> Cost:
    """Cost of tactors that all switch twice a second. Levels ``table`` and ``dynamic`` go by bank from 64 devices on.

    :param level: one of ``latch_plant``'s.
    :return: the cost.
    """

    def single(count: int, seconds: float) -> Job:
        plants = [latch_plant(level, latched="off") for _ in range(count)]

        def job(from_s: float) -> None:
            for k in range(round(seconds * SWITCHES_HZ)):
                for plant in plants:
                    plant.drive(k * _PERIOD_S + from_s, NOMINAL_VOLTS if k % 2 == 0 else -NOMINAL_VOLTS)
                    plant.drive(k * _PERIOD_S + from_s + PULSE_S, 0.0)
                    plant.take_events()
            for plant in plants:
                plant.advance(from_s + seconds)

        return job

    def banked(count: int, seconds: float) -> Job:
        bank = LatchBank(count, level)

        def job(from_s: float) -> None:
            for k in range(round(seconds * SWITCHES_HZ)):
                bank.drive(k * _PERIOD_S + from_s, NOMINAL_VOLTS if k % 2 == 0 else -NOMINAL_VOLTS)
                bank.drive(k * _PERIOD_S + from_s + PULSE_S, 0.0)
            bank.advance(from_s + seconds)

        return job

    return _cost(single, banked if level in ("table", "dynamic") else None, SWITCHES_HZ)


def thermal_cost(level: str) -> Cost:
    """Cost of heat at two pulses a second: an event is a step under power and one without.

    :param level: exact or two_node.
    :return: the cost.
    """

    def single(count: int, seconds: float) -> Job:
        plants = [thermal_plant(level) for _ in range(count)]

        def job(_: float) -> None:
            for _ in range(round(seconds * SWITCHES_HZ)):
                for plant in plants:
                    plant.advance(PULSE_S, PULSE_POWER_W)
                    plant.advance(_PERIOD_S - PULSE_S, 0.0)

        return job

    return _cost(single, None, SWITCHES_HZ)


def brake_cost(level: str) -> Cost:
    """Cost of clutches driven for half of each second at 1000 V and 10 Hz while a hand pulls; stepped levels by bank from 64 on.

    :param level: one of ``brake_plant``'s.
    :return: the cost.
    """

    def single(count: int, seconds: float) -> Job:
        plants = [brake_plant(level) for _ in range(count)]

        def job(from_s: float) -> None:
            for k in range(round(seconds)):
                for plant in plants:
                    plant.move(0, from_s + k, 0.0, 5e-3)
                    plant.drive(from_s + k, 1, 1000.0, 10.0)
                    plant.drive(from_s + k + 0.5, 0, 0.0, 0.0)
                    plant.advance(from_s + k + 1.0)
                    plant.take_events()

        return job

    def banked(count: int, seconds: float) -> Job:
        step_s = _BANK_STEP_S[level]
        bank = BrakeBank(count, level, step_s=step_s)

        def job(_: float) -> None:
            for _ in range(round(seconds)):
                bank.move(0.0, 5e-3)
                bank.drive(1000.0, 10.0)
                bank.step(round(0.5 / step_s))
                bank.drive(0.0, 0.0)
                bank.step(round(0.5 / step_s))

        return job

    return _cost(single, banked if level in ("lagged", "dynamic") else None, 1.0)


def _cost(
    single: _Maker,
    banked: _Maker | None,
    events_hz: float,
) -> Cost:
    one_s = _cpu_s(single, 1)
    by_count = {1: one_s}
    for count in DEVICES[1:]:
        if banked is not None and count >= 64:
            by_count[count] = _cpu_s(banked, count)
        elif one_s * count < 2.0:
            by_count[count] = _cpu_s(single, count)
        else:
            by_count[count] = one_s * count  # alike and independent: what one costs, so many times
    return Cost(1e6 * one_s / events_hz, {str(count): cost_s for count, cost_s in by_count.items()})


def _cpu_s(make: _Maker, count: int) -> float:
    """CPU seconds for a simulated second: median of several, each long enough for the clock."""
    seconds = 2.0
    while True:
        job = make(count, seconds)
        job(0.0)  # compiled, cached, warm
        first_s = _timed(job, seconds)
        if first_s > _ENOUGH_S / _REPEATS or seconds > 1e3:
            break
        seconds *= 4.0
    if first_s > 1.0:
        return first_s / seconds
    return statistics.median([first_s, *(_timed(job, k * seconds) for k in range(2, _REPEATS + 1))]) / seconds


def _timed(job: Job, from_s: float) -> float:
    began = time.process_time()
    job(from_s)
    return time.process_time() - began
