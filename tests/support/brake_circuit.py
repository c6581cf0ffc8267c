"""Five brakes on a current-limited supply behind a bridge, switched by the output word: what a C brake controller is tried on.

Written for these tests from the circuit in docs/reference/boards.md alone. Time is in ticks of 0.5 us, all else in SI units.
Between switching times every voltage is an exponential, followed exactly from one regime of the supply to the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

TICK_S = 0.5e-6
OUTPUTS = 5
ALL = 0x1F
ENABLED, POSITIVE, NEGATIVE = 1 << 10, 1 << 11, 1 << 12
BRIDGE, LOW, HIGHEST, CURRENT, BUS = range(5, 10)
NOMINAL_F = 2547e-12


@dataclass
class Circuit:
    """What hangs on the controller's pins. Fields may be changed while it runs: after ``advance``."""

    farads: list[float] = field(default_factory=lambda: [NOMINAL_F] * OUTPUTS)
    leak_ohm: list[float] = field(default_factory=lambda: [math.inf] * OUTPUTS)
    amps: float = 500e-6
    gain: float = 1.0  # volts made over volts asked for
    min_v: float = 0.0  # volts made whatever is asked for
    ohm: float = 20e3
    short_ohm: float = 20e3  # of the switches that short an output
    bleeder_ohm: float = 500e6
    stray_f: float = 0.2e-9
    stuck: bool = False  # the bridge keeps its polarity, and does not clamp

    def __post_init__(self) -> None:
        self.now = 0
        self.word = 0
        self.volts = [0.0] * OUTPUTS  # signed
        self.bridge_v = 0.0
        self.polarity = 0

    @property
    def _on(self) -> list[int]:
        return [k for k in range(OUTPUTS) if self.word >> k & 1]

    @property
    def set_v(self) -> float:
        return max((self.word >> 16) * self.gain, self.min_v) if self.word & ENABLED else 0.0

    @property
    def charging(self) -> bool:
        return bool(self.word & ENABLED) and self.polarity != 0

    def switch(self, word: int, now: int) -> None:
        """The word from tick ``now`` on."""
        self.advance(now)
        self.word = word
        wanted = bool(word & POSITIVE) - bool(word & NEGATIVE)
        if not (self.stuck and self.polarity and word & ALL):
            self.polarity = wanted
        on = self._on
        charge = self.stray_f * self.bridge_v + sum(self.farads[k] * self.volts[k] for k in on)
        self.bridge_v = charge / (self.stray_f + sum(self.farads[k] for k in on))
        for k in on:
            self.volts[k] = self.bridge_v

    def advance(self, now: int) -> None:
        left_s = (now - self.now) * TICK_S
        self.now = now
        on = self._on
        farads = self.stray_f + sum(self.farads[k] for k in on)
        leak_s = sum(1 / self.leak_ohm[k] for k in on)
        for k in range(OUTPUTS):
            if k not in on and self.volts[k]:
                tau = self.short_ohm * self.farads[k]
                self.volts[k] *= math.exp(-left_s / tau) if tau else 0.0
        if self.charging:
            self.bridge_v = self.polarity * self._charged(self.polarity * self.bridge_v, farads, leak_s, left_s)
        else:
            through = self.bleeder_ohm if self.polarity else self.ohm
            self.bridge_v *= math.exp(-left_s * (1 / through + leak_s) / farads)
        for k in on:
            self.volts[k] = self.bridge_v

    def _charged(self, u: float, farads: float, leak_s: float, left_s: float) -> float:
        """``u``, in the bridge's polarity, after ``left_s`` of charging: a ramp, an approach, or a fall."""
        set_v, knee_v = self.set_v, self.set_v - self.ohm * self.amps
        if u > set_v:
            g, border_v = 1 / self.bleeder_ohm + leak_s, set_v
            target = 0.0
        elif u < knee_v:
            g, border_v = 1 / self.bleeder_ohm + leak_s, knee_v
            target = self.amps / g
        else:
            g, border_v = 1 / self.ohm + leak_s, knee_v
            target = set_v / self.ohm / g
        tau = farads / g
        until_s = math.inf
        if (target < border_v <= u) or (u < border_v < target):
            until_s = tau * math.log((target - u) / (target - border_v))
        if until_s >= left_s:
            return target + (u - target) * math.exp(-left_s / tau)
        beyond = border_v if target > u else math.nextafter(border_v, -math.inf)
        return self._charged(beyond, farads, leak_s, left_s - until_s)

    @property
    def supply_a(self) -> float:
        bleeds = self.set_v / self.bleeder_ohm
        if not self.charging:
            return bleeds
        u = self.polarity * self.bridge_v
        return min(self.amps, max(0.0, (self.set_v - u) / self.ohm) + bleeds)

    @property
    def bus_v(self) -> float:
        if not self.charging:
            return self.set_v
        u = self.polarity * self.bridge_v
        return max(u, min(self.set_v, u + self.amps * self.ohm))

    def counts(self, sense: int) -> int:
        """One of the inputs, 0 to 1023."""
        value = {
            BRIDGE: 512 + self.bridge_v / 4,
            LOW: abs(self.bridge_v) * 16,
            HIGHEST: max(self.bus_v, *map(abs, self.volts)) / 2,
            CURRENT: self.supply_a * 1e6,
            BUS: self.bus_v / 2,
        }.get(sense)
        if value is None:
            value = abs(self.volts[sense]) / 2
        return min(1023, max(0, round(value)))
