"""Five brakes on one high-voltage supply: volts in closed form, holding capacity behind them with the contact's lag.

Capacity follows on a fixed grid while volts change, so that it does not depend on who looks when; while they are held, or
gone, time passes in one exact step. Output 0 is the index finger's brake, output 1 the thumb's; further ones follow the
index's law.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_models.options import Option
from haptics.errors import InputError
from haptics.link.messages import BRAKE_CHANNELS
from haptics.physics.brake_contact import CONTACT
from haptics.physics.brake_drive import DRIVE
from haptics.physics.brake_force import LAWS, force_law
from haptics.physics.brake_output import OutputStage
from haptics.physics.brake_parameters import BRAKE, capacitance_f
from haptics.physics.parameters import provenance
from haptics.units import in_range

FORCE_SPREAD = 0.10
"""Half-width of a device's force about the law (thesis 4.7.3: 20 N +- 10 %)."""
OVERLAP_SPREAD = 0.05  # assumed: how well strips are cut and aligned
VOLTS_SPREAD = 0.01  # assumed: the supply's regulation
_FINGERS = ("index", "thumb", "index", "index", "index")
_GRID_NS = 500_000
_EVENTS_KEPT = 1 << 16
_STILL_V = 1.0
_EVER = 1 << 62
_HELD = 0.9999  # of the setpoint: from here on volts do not change till the next reversal
_GEOMETRY = ("overlap_m2", "thickness_m", "permittivity", "width_m")
_ELECTRIC = ("supply_current_a", "supply_volts", "output_resistance_ohm", "bleeder_ohm", "stray_f", "clamp_s")
_ROWS = [
    *(row for row in provenance(BRAKE) if row.name in _GEOMETRY),
    *(row for row in provenance(DRIVE) if row.name in _ELECTRIC),
    *provenance(CONTACT),
]

PLANT_OPTIONS: dict[str, Option] = {
    "law": Option("threshold", "law of the holding force", choices=tuple(LAWS)),
    "fitted": Option(BRAKE_CHANNELS, "outputs that have a brake, from output 0 on", "", 0, BRAKE_CHANNELS, whole=True),
    "volts_gain": Option(None, f"volts made over volts asked for; default drawn within {VOLTS_SPREAD:g} of 1", "", 0.5, 1.3),
    **{row.name: Option(row.value, row.source, row.unit, row.low, row.high) for row in _ROWS},
}


class Brakes:
    """Plants of all outputs. Times are world nanoseconds and never go back.

    :param options: values of ``PLANT_OPTIONS`` and ``spread``: overlap, force and volts of this device stray from nominal
        uniformly within ``spread`` times the half-widths above.
    """

    def __init__(self, options: Mapping[str, Any], rng: np.random.Generator, start_ns: int):
        overlap, force, volts = rng.uniform(-1, 1, BRAKE_CHANNELS), rng.uniform(-1, 1, BRAKE_CHANNELS), rng.uniform(-1, 1)
        spread = options["spread"]
        drawn_gain = 1.0 + VOLTS_SPREAD * spread * float(volts)
        self._volts_gain = drawn_gain if options["volts_gain"] is None else options["volts_gain"]
        self._force_gain = [1.0 + FORCE_SPREAD * spread * float(draw) for draw in force]
        self._brake = BRAKE.with_values(**{name: options[name] for name in _GEOMETRY})
        self._full_m2 = [
            options["overlap_m2"] * (1.0 + OVERLAP_SPREAD * spread * float(overlap[channel])) * (channel < options["fitted"])
            for channel in range(BRAKE_CHANNELS)
        ]
        self._overlap_m2 = list(self._full_m2)
        self.drive_parameters = DRIVE.with_values(**{name: options[name] for name in _ELECTRIC})
        self._contact = CONTACT.with_values(tau_on_s=options["tau_on_s"], tau_off_s=options["tau_off_s"])
        self._laws = [force_law(finger, options["law"]) for finger in _FINGERS]
        self._tables: list[dict[int, float]] = [{} for _ in range(BRAKE_CHANNELS)]
        self.stage = OutputStage([self._capacitance_f(channel) for channel in range(BRAKE_CHANNELS)], self.drive_parameters)
        self._off_n = [self._force_n(channel, 0.0) for channel in range(BRAKE_CHANNELS)]
        self.capacity_n = list(self._off_n)
        self._set_v = 0.0
        self._half_n = [math.inf] * BRAKE_CHANNELS
        self._pull_n = [0.0] * BRAKE_CHANNELS
        self._piezos = 0
        self._events: deque[tuple[int, int, str, float]] = deque(maxlen=_EVENTS_KEPT)
        self._start_ns = start_ns
        self._sampled_ns = start_ns
        self._told_ns, self._told_j = start_ns, 0.0
        self._rise = -math.expm1(-_GRID_NS / 1e9 / self._contact.tau_on_s)
        self._fall = -math.expm1(-_GRID_NS / 1e9 / self._contact.tau_off_s)

    # What the firmware does and senses.

    def drive(self, mask: int, volts: float, frequency_hz: float, now_ns: int) -> None:
        """A square wave of this setpoint on the outputs in ``mask``, all others shorted; 0 shorts everything."""
        self.advance(now_ns)
        driven = mask if volts else 0
        for channel in range(BRAKE_CHANNELS):
            if (driven ^ self.stage.mask) >> channel & 1:
                on = driven >> channel & 1
                self._events.append((now_ns, channel, "driven" if on else "shorted", volts if on else 0.0))
            self._half_n[channel] = 0.5 * self._force_n(channel, volts * self._volts_gain) if driven >> channel & 1 else math.inf
            if self.capacity_n[channel] >= self._half_n[channel]:
                self._half_n[channel] = math.inf  # it holds half already: nothing to be told
        self._set_v = volts * self._volts_gain
        self.stage.drive(self._seconds(now_ns), driven, self._set_v, frequency_hz)

    def volts(self, now_ns: int) -> list[float]:
        """Signed volts on each output."""
        self.advance(now_ns)
        return self.stage.voltages_v

    def highest_v(self, now_ns: int) -> float:
        """Greatest magnitude anywhere behind the supply."""
        volts = self.volts(now_ns)
        return max(self.stage.bus_v, *map(abs, volts))

    def supply_current_a(self) -> float:
        """What the supply gives, as of the last look at volts."""
        return self.stage.supply_current_a

    def set_piezos(self, mask: int, now_ns: int) -> None:
        """Vibrate the piezos in ``mask`` and no others."""
        for channel in range(BRAKE_CHANNELS):
            if (mask ^ self._piezos) >> channel & 1:
                self._events.append((now_ns, channel, "piezo_on" if mask >> channel & 1 else "piezo_off", 0.0))
        self._piezos = mask

    # What the world does and sees.

    def load(self, channel: int, now_ns: int, **load: float) -> None:
        """``pull_n``: tension of the finger; ``travel_m``: how far the strips have slid apart; ``leak_ohm``: across the output.

        :raises InputError: no such channel, or another key.
        """
        in_range("channel", channel, 0, BRAKE_CHANNELS - 1)
        unknown = set(load) - {"pull_n", "travel_m", "leak_ohm"}
        if unknown:
            raise InputError(f"load {', '.join(sorted(unknown))} is unknown to a brake; allowed: pull_n, travel_m, leak_ohm")
        self.advance(now_ns)
        if "pull_n" in load:
            self._pull_n[channel] = in_range("pull_n", load["pull_n"], 0.0, 1e4, "N")
        if "travel_m" in load:
            lost_m2 = self._brake.width_m * in_range("travel_m", load["travel_m"], 0.0, 10.0, "m")
            self._overlap_m2[channel] = max(self._full_m2[channel] - lost_m2, 0.0)
            self._tables[channel].clear()
            self._off_n[channel] = self._force_n(channel, 0.0)
            self.stage.set_output(self._seconds(now_ns), channel, capacitance_f=self._capacitance_f(channel))
        if "leak_ohm" in load:
            self.stage.set_output(self._seconds(now_ns), channel, leak_ohm=load["leak_ohm"])

    def truth(self, now_ns: int) -> dict[str, Any]:
        """All outputs as they are now; ``events`` are those since the last call, ``supply_power_w`` the mean since then."""
        self.advance(now_ns)
        elapsed_s = (now_ns - self._told_ns) / 1e9
        given_j, self._told_j = self.stage.energy_j - self._told_j, self.stage.energy_j
        self._told_ns = now_ns
        events, self._events = sorted(self._events), deque(maxlen=_EVENTS_KEPT)
        channels = range(BRAKE_CHANNELS)
        return {
            "time_ns": now_ns,
            "volts": self.stage.voltages_v,
            "amplitude_v": [self.stage.amplitude_v(channel) for channel in channels],
            "capacity_n": list(self.capacity_n),
            "held_n": [min(self._pull_n[channel], self.capacity_n[channel]) for channel in channels],
            "slipping": [self._pull_n[channel] > self.capacity_n[channel] for channel in channels],
            "energy_j": [self.stage.output_energy_j(channel) for channel in channels],
            "supply_energy_j": self.stage.energy_j,
            "supply_power_w": given_j / elapsed_s if elapsed_s > 0.0 else 0.0,
            "piezo": [bool(self._piezos >> channel & 1) for channel in channels],
            "events": events,
        }

    def advance(self, now_ns: int) -> None:
        """Carry volts and capacity to ``now_ns``."""
        while self._sampled_ns + _GRID_NS <= now_ns:
            steps = min(self._steady_steps(), (now_ns - self._sampled_ns) // _GRID_NS)
            self._sampled_ns += max(steps, 1) * _GRID_NS
            if steps <= 1:
                self.stage.advance(self._seconds(self._sampled_ns))
            self._follow(max(steps, 1))
        self.stage.advance(self._seconds(now_ns))

    def _steady_steps(self) -> int:
        """For how many grid steps from the last one volts will not change; 0 if they do."""
        stage = self.stage
        if stage.mask == 0:
            return _EVER if max(map(abs, stage.voltages_v)) < _STILL_V else 0
        first = (stage.mask & -stage.mask).bit_length() - 1
        if stage.next_event_s is None or abs(stage.voltage_v(first)) < _HELD * self._set_v:
            return 0
        return int((stage.next_event_s - self._seconds(self._sampled_ns)) * 1e9 / _GRID_NS)

    def _follow(self, steps: int) -> None:
        """Let every output's capacity follow the force of its volts now."""
        if steps == 1:
            rise, fall = self._rise, self._fall
        else:
            elapsed_s = steps * _GRID_NS / 1e9
            rise, fall = -math.expm1(-elapsed_s / self._contact.tau_on_s), -math.expm1(-elapsed_s / self._contact.tau_off_s)
        for channel, volts in enumerate(map(abs, self.stage.voltages_v)):
            before_n = self.capacity_n[channel]
            target_n = self._force_n(channel, volts) if volts >= _STILL_V else self._off_n[channel]
            if target_n == before_n:
                continue
            after_n = before_n + (target_n - before_n) * (rise if target_n > before_n else fall)
            self.capacity_n[channel] = after_n
            if after_n >= self._half_n[channel]:
                share = (self._half_n[channel] - before_n) / (target_n - before_n)
                ago_ns = steps * _GRID_NS + round(self._contact.tau_on_s * math.log1p(-share) * 1e9)
                self._events.append((self._sampled_ns - ago_ns, channel, "half_capacity", self._half_n[channel]))
                self._half_n[channel] = math.inf

    def _force_n(self, channel: int, volts: float) -> float:
        """Steady capacity at ``volts``, between whole volts by straight lines: within 10 uN of the law and far cheaper."""
        low = int(volts)
        below, above = self._tabled_n(channel, low), self._tabled_n(channel, low + 1)
        return below + (above - below) * (volts - low)

    def _tabled_n(self, channel: int, volts: int) -> float:
        table = self._tables[channel]
        if volts not in table:
            area_m2, brake = self._overlap_m2[channel], self._brake
            law_n = self._laws[channel].force_n(float(volts), area_m2, brake.thickness_m, brake.permittivity)
            table[volts] = self._force_gain[channel] * law_n if self._full_m2[channel] else 0.0
        return table[volts]

    def _capacitance_f(self, channel: int) -> float:
        return capacitance_f(self._overlap_m2[channel], self._brake.thickness_m, self._brake.permittivity)

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._start_ns) / 1e9
