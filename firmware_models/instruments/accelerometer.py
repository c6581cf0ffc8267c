"""An accelerometer (ADXL345) on the pendulum that carries one actuator, read out sample by sample: ``sim://accelerometer``.

::

    # accelerometer rate_hz=3200 range_g=16 g_per_count=0.00390625 bandwidth_hz=1600
    0 23
    1 -1874

One axis, along the pin, in counts. Each landing of the actuator's pin rings (thesis 3.5.1, ``haptics.physics.latch.recoil``)::

    a(t) = peak (v/v0)^n exp(-t/tau) ring(t),   ring = (cos(w1 t + p1) + s cos(w2 t + p2)) / sqrt(1 + s^2)

so the envelope is ``sqrt(2)`` times the root mean square of the ring. Thesis and sensor leave the ring open: its frequency, a
second partial and how both change from one landing to the next are assumed. Behind it come the sensor's low-pass of first
order (exact for these oscillations), gain, offset, noise, the slow swing of the pendulum, steps, and the end of the range.
What the coil's push does to the pendulum before the landing, 0.1 g, is left out. Faults to play: ``loose_at_s``, from when on
the sensor feels ``loose_share`` of the pendulum; ``drop``, the share of lines that get lost.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmware_models.instruments.instrument import INDEX_MODULUS, Instrument
from firmware_models.line.uart import Line
from firmware_models.options import Option
from firmware_models.plants.tactiles_plant import Landing
from firmware_models.world import World
from haptics.physics.latch.recoil import SAMPLE_RATE_HZ
from haptics.units import STANDARD_GRAVITY_M_S2

G_PER_COUNT = 1.0 / 256  # data sheet: 256 counts/g at every range in full resolution
NOMINAL_SPEED_M_S = 0.6634  # landing on the off plate after a nominal switch (predict latch, level reference)
BANDWIDTH_SD = 0.05  # assumed: scatter of the low-pass from part to part
GAIN_SD = 0.01  # data sheet: typical deviation from ideal sensitivity
OFFSET_SD_G = 0.05  # data sheet: 0 g offset, 35 mg typical, 150 mg at most
CLOCK_SD = 0.005  # assumed: the sensor's own oscillator, which the data sheet does not specify
DELAY_S, DELAY_SD_S, MIN_DELAY_S = 0.3e-3, 0.05e-3, 0.1e-3  # assumed: from a sample to the first bit of its line
SWING_HZ = math.sqrt(STANDARD_GRAVITY_M_S2) / (2.0 * math.pi)  # of a pendulum of 1 m (3.5.1)
FREQUENCY_SCATTER, AMPLITUDE_SCATTER = 0.04, 0.03  # assumed: sd from landing to landing, as shares
PHASE_SCATTER_RAD = 0.8  # assumed: sd about a ring that begins at its maximum
PARTIAL_RATIO, PARTIAL_SHARE = 1.9, 0.15  # assumed: second partial of the ring
_GROUP = 4
"""Samples between two looks at the plant. Each line still goes out at its own time; the world is woken up less often."""
_BLOCK = 1024
"""Samples whose times, swing and noise are worked out at once."""
_FORGET_AFTER_TAUS = 25.0


class _Ring(NamedTuple):
    """One landing: ``amplitude`` (g, complex, one for each partial) of ``exp(rates (t - start))``, and its low-pass."""

    start_ns: int
    end_ns: int
    rates: NDArray[np.complex128]
    amplitudes: NDArray[np.complex128]


class _Block(NamedTuple):
    """What no landing changes of the samples from number ``first`` on: when they are taken, and all that is read but a ring."""

    first: int
    taken_ns: list[int]
    swing_g: NDArray[np.float64]
    noise_g: NDArray[np.float64]
    quiet: list[int]


class Accelerometer(Instrument):
    """Acceleration of the pendulum along the pin, in counts.

    :param options: values of ``options()`` and ``INSTRUMENT_OPTIONS``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the coil board is.
    """

    kind = "accelerometer"
    board = "tactiles"
    clock_sd = CLOCK_SD

    @classmethod
    def options(cls) -> dict[str, Option]:
        return {
            "rate_hz": Option(SAMPLE_RATE_HZ, "samples a second", "Hz", 100.0, 3200.0),
            "range_g": Option("16", "end of the range, g", choices=("2", "4", "8", "16")),
            "bandwidth_hz": Option(None, f"of the low-pass; default drawn, half the rate, sd {BANDWIDTH_SD:g}", "Hz", 10.0, 1e4),
            "noise_g": Option(0.012, "standard deviation of one sample", "g", 0.0, 1.0),
            "gain": Option(None, f"reading over truth; default drawn, sd {GAIN_SD:g}", "", 0.5, 2.0),
            "offset_g": Option(None, f"reading at rest; default drawn, sd {OFFSET_SD_G:g}", "g", -1.0, 1.0),
            "swing_g": Option(0.02, "amplitude of the pendulum's slow swing", "g", 0.0, 1.0),
            "delay_s": Option(None, f"from sample to line; default drawn, {DELAY_S:g}, sd {DELAY_SD_S:g}", "s", MIN_DELAY_S, 0.1),
            "ring_hz": Option(620.0, "mean frequency of the ring", "Hz", 10.0, 5000.0),
            "partial": Option(PARTIAL_SHARE, "second partial of the ring over the first", "", 0.0, 1.0),
            "skin_share": Option(0.3, "recoil of a landing on the skin side over that on the off side (assumed)", "", 0.0, 10.0),
            "loose_at_s": Option(None, "it comes loose so long after power-on", "s", 0.0, 1e6),
            "loose_share": Option(0.005, "what a loose sensor still feels", "", 0.0, 1.0),
            "drop": Option(0.0, "share of the lines that get lost", "", 0.0, 1.0),
        }

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        self.range_g = float(options["range_g"])
        super().__init__(options, transmitter, start_ns, world)
        gain, offset, bandwidth, delay = (float(one) for one in self.rng.standard_normal(4))
        self._swing_rad = float(self.rng.uniform(0.0, 2.0 * math.pi))
        self.gain = 1.0 + GAIN_SD * gain if options["gain"] is None else options["gain"]
        self.offset_g = OFFSET_SD_G * offset if options["offset_g"] is None else options["offset_g"]
        drawn_hz = 0.5 * options["rate_hz"] * (1.0 + BANDWIDTH_SD * bandwidth)
        self.bandwidth_hz = drawn_hz if options["bandwidth_hz"] is None else options["bandwidth_hz"]
        drawn_s = max(MIN_DELAY_S, DELAY_S + DELAY_SD_S * delay)
        self._delay_ns = round(1e9 * (drawn_s if options["delay_s"] is None else options["delay_s"]))
        self._landing_rng, self._drop_rng = self.rng.spawn(2)
        self._rings: deque[_Ring] = deque()
        self._listening = False
        self._block = self._next_block(0)
        self._due_ns = self._block.taken_ns[_GROUP - 1] + self._delay_ns

    def header(self) -> dict[str, float | str]:
        return {
            "rate_hz": self.settings["rate_hz"],
            "range_g": self.range_g,
            "g_per_count": G_PER_COUNT,
            "bandwidth_hz": 0.5 * self.settings["rate_hz"],
        }

    def truth(self) -> dict[str, Any]:
        return {**super().truth(), "gain": self.gain, "offset_g": self.offset_g, "delay_s": self._delay_ns / 1e9}

    # In groups: what a sample reads is settled by its own time, whenever it is worked out.

    def next_event(self) -> int:
        """When the next group of lines is due.

        :return: world time, ns.
        """
        return self._due_ns

    def advance(self, to_ns: int) -> None:
        """Send the lines due up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        """
        self.now_ns = to_ns
        latest_ns, first = to_ns - self._delay_ns, self._count
        while True:
            block, at = self._block, self._count - self._block.first
            end = bisect_right(block.taken_ns, latest_ns, at)
            if end > at:
                if self._count == first:
                    self._listen()
                self._send(at, end)
            if end < len(block.taken_ns):
                break
            self._block = self._next_block(self._count)
        if self._count > first:
            self._plan()

    def _plan(self) -> None:
        """When the next group is whole."""
        last = self._count - self._block.first + _GROUP - 1
        taken_ns = self._block.taken_ns
        self._due_ns = (taken_ns[last] if last < len(taken_ns) else self._taken_ns(self._count + _GROUP - 1)) + self._delay_ns

    def _send(self, low: int, high: int) -> None:
        """The lines of these samples of the block."""
        block, drop = self._block, self.settings["drop"]
        times_ns = block.taken_ns[low:high]
        counts = self._counts(low, high) if self._rings else block.quiet[low:high]
        lost = (self._drop_rng.random(len(counts)) < drop).tolist() if drop else [False] * len(counts)
        for k, (time_ns, count, gone) in enumerate(zip(times_ns, counts, lost, strict=True), block.first + low):
            if not gone:
                self._line.send(b"%d %d\n" % (k % INDEX_MODULUS, count), time_ns + self._delay_ns)
        self._count = block.first + high

    def _taken_ns(self, k: int) -> int:
        return self.start_ns + round(self._period_ns * (k + 1))

    def _next_block(self, first: int) -> _Block:
        times_ns = np.rint(self._period_ns * np.arange(first + 1, first + _BLOCK + 1)).astype(np.int64) + self.start_ns
        since_s = (times_ns - self.start_ns) / 1e9
        swing_g = self.settings["swing_g"] * np.sin(2.0 * math.pi * SWING_HZ * since_s + self._swing_rad)
        noise_g = self.settings["noise_g"] * self.rng.standard_normal(_BLOCK)
        return _Block(first, times_ns.tolist(), swing_g, noise_g, self._read(swing_g, noise_g))

    def _read(self, true_g: NDArray[np.float64], noise_g: NDArray[np.float64]) -> list[int]:
        """Counts of a true acceleration."""
        seen_g = self.gain * true_g + self.offset_g + noise_g
        end = round(self.range_g / G_PER_COUNT)
        return np.clip(np.rint(seen_g / G_PER_COUNT), -end, end - 1).astype(np.int64).tolist()

    def _listen(self) -> None:
        """Carry the actuator to now: 0.1 ms past the last sample at least, so that no landing before it is still to be told."""
        plant = self.plant()
        if plant is None:
            return
        if not self._listening:
            self._listening = True
            plant.listeners.append(self._hear)
        plant.carry(self.channel, self.now_ns)

    def _hear(self, landing: Landing) -> None:
        """Draw how this landing rings."""
        plant = self.plant()
        if landing.channel != self.channel:
            return
        recoil = plant.recoils[self.channel]
        tau_s = recoil.tau_s(plant.surface if landing.at_off else "bare")
        share = 1.0 if landing.at_off else self.settings["skin_share"]
        draw = self._landing_rng.standard_normal(3)
        peak_g = share * recoil.peak_g * (landing.speed_m_s / NOMINAL_SPEED_M_S) ** recoil.speed_power
        peak_g *= max(0.0, 1.0 + AMPLITUDE_SCATTER * draw[0])
        hertz = self.settings["ring_hz"] * (1.0 + FREQUENCY_SCATTER * draw[1]) * np.array([1.0, PARTIAL_RATIO])
        phases = np.array([PHASE_SCATTER_RAD * draw[2], self._landing_rng.uniform(0.0, 2.0 * math.pi)])
        shares = np.array([1.0, self.settings["partial"]]) / math.hypot(1.0, self.settings["partial"])
        rates = -1.0 / tau_s + 2j * np.pi * hertz
        end_ns = landing.time_ns + round(1e9 * _FORGET_AFTER_TAUS * tau_s)
        self._rings.append(_Ring(landing.time_ns, end_ns, rates, peak_g * shares * np.exp(1j * phases)))

    def _counts(self, low: int, high: int) -> list[int]:
        """Readings of these samples of the block, with what rings."""
        block = self._block
        times_ns = np.array(block.taken_ns[low:high], dtype=np.int64)
        true_g = np.zeros(len(times_ns))
        cutoff = 2.0 * math.pi * self.bandwidth_hz
        for ring in self._rings:
            after_s = np.maximum((times_ns - ring.start_ns) / 1e9, 0.0)[:, np.newaxis]
            passed = ring.amplitudes * cutoff / (cutoff + ring.rates) * (np.exp(ring.rates * after_s) - np.exp(-cutoff * after_s))
            true_g += passed.real.sum(axis=1)
        while self._rings and self._rings[0].end_ns < times_ns[-1]:
            self._rings.popleft()
        loose_at_s = self.settings["loose_at_s"]
        if loose_at_s is not None:
            true_g *= np.where((times_ns - self.start_ns) / 1e9 >= loose_at_s, self.settings["loose_share"], 1.0)
        return self._read(true_g + block.swing_g[low:high], block.noise_g[low:high])
