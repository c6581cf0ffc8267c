"""What a board's telemetry shows of a coil: the current of its pulses, the power they take, and whether the pin moves.

Telemetry comes every 20 ms and a pulse lasts 10 ms at most, so pulses are timed for telemetry to meet them, each at another
phase; many samples then stand for the mean over a pulse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.link.port_url import is_simulated
from haptics.time import seconds_to_ns
from rigs.bench import Bench, BenchOptions
from rigs.fitting import Vector, least_squares_fit

TELEMETRY_S = 20e-3
"""How often a board reports."""
ON_A = 0.3
"""Telemetry above this current saw a pulse: a tenth of what a coil draws, and far more than a board draws without."""
POWER_SD = 0.003
"""Standard deviation of measured over true power: the board's current and voltage senses (assumed)."""
MIN_DIP, MAX_DIP = 0.0015, 0.05
"""Share of the current that a pin takes just before it lands, if it moves."""
_FEWEST = 50
_EDGE_S = 0.2e-3
_FLIGHT_S = (3.4e-3, 4.4e-3)
_REST_S = 7.0e-3
"""Before the pin lands, moving, and when it has surely landed (``predict latch``: 4.8 and 6.0 ms)."""


@dataclass(frozen=True)
class PulseRecord:
    """Pulses as they were played, and the telemetry that met them. Times are from ``origin_ns``.

    :param start_s: start of each pulse (n,), s.
    :param length_s: of every pulse, s.
    :param pulse: number of the pulse that each telemetry sample met (m,).
    :param phase_s: time of the sample since that pulse's start (m,), s.
    :param current_a: coil current (m,), A.
    :param volts: supply at the coil (m,), V.
    :param origin_ns: zero of the times on the bench's clock, ns.
    """

    start_s: Vector
    length_s: float
    pulse: NDArray[np.int64]
    phase_s: Vector
    current_a: Vector
    volts: Vector
    origin_ns: int = 0

    @classmethod
    def of(cls, starts_ns: Sequence[int], length_s: float, seen: Sequence[tuple[int, float, float]]) -> PulseRecord:
        """From start times and ``seen``: time (ns), current (A) and volts at which telemetry saw a coil on.

        :param starts_ns: start of each pulse (n,), ns, ascending.
        :param length_s: of every pulse, s.
        :param seen: time (ns), current (A) and supply (V) of each telemetry message that saw a coil on.
        :return: the record; messages outside all pulses are left out.
        :raises InputError: no pulse was seen.
        """
        starts = np.array(starts_ns, dtype=np.int64)
        if not len(starts):
            raise InputError("no pulse was played; nothing to fit")
        origin_ns = int(starts[0])
        start_s = (starts - origin_ns) / 1e9
        rows: list[tuple[int, float, float, float]] = []
        for time_ns, current_a, volts in seen:
            at_s = (time_ns - origin_ns) / 1e9
            pulse = int(np.searchsorted(start_s, at_s, side="right")) - 1
            if pulse >= 0 and at_s - start_s[pulse] < length_s:
                rows.append((pulse, at_s - start_s[pulse], current_a, volts))
        table = np.array(rows, dtype=float).reshape(-1, 4)
        pulse, phase_s, current_a, volts = table.T
        return cls(start_s, length_s, pulse.astype(np.int64), phase_s, current_a, volts, origin_ns)

    def relative_to(self, time_ns: int) -> PulseRecord:
        """The same with times counted from ``time_ns``.

        :param time_ns: the new origin on the bench's clock, ns.
        :return: a record with shifted times.
        """
        shift_s = (self.origin_ns - time_ns) / 1e9
        return PulseRecord(self.start_s + shift_s, self.length_s, self.pulse, self.phase_s, self.current_a, self.volts, time_ns)

    @property
    def mean_current_a(self) -> float:
        """Of all samples, which meet pulses at all phases alike; 0 if none was met."""
        return float(self.current_a.mean()) if len(self.current_a) else 0.0

    @property
    def inner(self) -> NDArray[np.bool_]:
        """Which samples (m,) lie away from the edges of their pulse."""
        return (self.phase_s > _EDGE_S) & (self.phase_s < self.length_s - _EDGE_S)

    @property
    def landing_dip(self) -> float:
        """Share of the current that the moving pin's own voltage takes just before it lands, against after; nan if not met."""
        moving = (self.phase_s > _FLIGHT_S[0]) & (self.phase_s < _FLIGHT_S[1])
        resting = self.phase_s > _REST_S
        if moving.sum() < 5 or resting.sum() < 5:
            return float("nan")
        # Heating lowers the current by far more than motion does: compare each with its neighbours in time.
        slope = np.polyfit(self.pulse[resting], self.current_a[resting], 4)
        return float(np.mean(1.0 - self.current_a[moving] / np.polyval(slope, self.pulse[moving])))

    def power(self, rise_k: Vector) -> tuple[float, float]:
        """Power (W) of a cold pulse, and by how much each kelvin of rise divides it, ``P = P0 / (1 + a rise)``.

        Fitted to all samples of an actuator that was ``rise_k`` (n,) warm at its pulses. They meet the pulses at all phases
        alike, which averages over what the pin's motion takes. What the current takes to rise (0.1 % of the energy) is left
        out: samples on an edge depend on the clock more than on the coil.

        :param rise_k: rise of the actuator at each pulse (n,), K.
        :return: cold power (W) and its relative decrease per kelvin (1/K).
        :raises InputError: telemetry met too few pulses.
        """
        inner = self.inner
        if inner.sum() < _FEWEST:
            raise InputError(f"telemetry met {inner.sum()} of {len(self.start_s)} pulses; at least {_FEWEST} are needed")
        power_w, warm_k = (self.current_a * self.volts)[inner], rise_k[self.pulse[inner]]
        cold_w = float(power_w.max())
        fit = least_squares_fit(
            lambda values: values[0] / (1.0 + values[1] * warm_k), power_w, 0.01 * cold_w, {"cold_w": cold_w, "per_k": 0.004}
        )
        return fit.value("cold_w"), fit.value("per_k")


def meeting_telemetry(bench: Bench, near_ns: int, phase_s: float) -> int:
    """A time close to ``near_ns`` for a pulse to begin, such that telemetry comes ``phase_s`` into it.

    :param bench: with telemetry so far.
    :param near_ns: wanted start, ns.
    :param phase_s: time from the pulse's start to the telemetry sample, s.
    :return: start within half a telemetry period of ``near_ns``, ns; ``near_ns`` itself if no telemetry came yet.
    """
    if not bench.telemetry:
        return near_ns
    period_ns = seconds_to_ns(TELEMETRY_S)
    begin_ns = bench.telemetry[-1][0] - seconds_to_ns(phase_s)
    return begin_ns + round((near_ns - begin_ns) / period_ns) * period_ns


def currents(bench: Bench) -> list[tuple[int, float, float]]:
    """Time, current (A) and supply (V) of each telemetry message that saw a coil on.

    :param bench: with telemetry so far.
    :return: time (ns), current (A) and supply (V) of each, oldest first.
    """
    return [
        (time_ns, message.current * 1e-3, message.supply * 1e-3)
        for time_ns, message in bench.telemetry
        if message.current * 1e-3 > ON_A
    ]


def tells_motion(options: BenchOptions) -> bool:
    """Whether the coil's current shows that a pin moves: not on a board simulated at level event, where it is constant.

    :param options: of the rig.
    :return: True on hardware and on every level but ``event``.
    """
    url = options.board_url("tactiles")
    return not (is_simulated(url) and ("level=event" in url or options.level == "event"))
