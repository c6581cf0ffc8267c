"""Five brakes on one high-voltage supply, as the firmware and the world see them: world nanoseconds, channels, truth.

The physics is ``haptics.physics.brake.levels.brake_plant`` at any of its levels. Output 0 is the index finger's brake, output 1
the thumb's; further ones follow the index's law.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from firmware_models.options import Option
from haptics.errors import InputError
from haptics.link.messages import BRAKE_CHANNELS
from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.contact import CONTACT
from haptics.physics.brake.finger import FINGER
from haptics.physics.brake.force_laws import LAWS, force_law
from haptics.physics.brake.levels import LEVELS, brake_plant
from haptics.physics.brake.output_stage import OutputStage
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.parameters import provenance
from haptics.units import in_range

FORCE_SPREAD = 0.10
"""Half-width of a device's force about the law (thesis 4.7.3: 20 N +- 10 %)."""
OVERLAP_SPREAD = 0.05  # assumed: how well strips are cut and aligned
VOLTS_SPREAD = 0.01  # assumed: the supply's regulation
DISCHARGED_VOLTS = 60.0
"""Below them an output that is shorted counts as empty."""
_FINGERS = ("index", "thumb", "index", "index", "index")
_EVENTS_KEPT = 1 << 16
_SWITCHES = ("bridge_stuck", "lid_open")
_LOADS = ("pull_n", "travel_m", "leak_ohm", "breakdown_v", "hand_m", "hand_m_s", *_SWITCHES)
_THINNEST_M = 1e-6  # the self test's volts would break down what is much thinner
_GEOMETRY = ("overlap_m2", "thickness_m", "permittivity", "width_m")
_ELECTRIC = ("supply_current_a", "supply_volts", "output_resistance_ohm", "bleeder_ohm", "stray_f", "clamp_s")
_ROWS = [
    *(row for row in provenance(BRAKE) if row.name in _GEOMETRY),
    *(row for row in provenance(DRIVE) if row.name in _ELECTRIC),
    *provenance(CONTACT),
    *provenance(FINGER),
]

PLANT_OPTIONS: dict[str, Option] = {
    "level": Option("lagged", "fidelity of the brakes", choices=LEVELS),
    "law": Option("threshold", "law of the holding force", choices=tuple(LAWS)),
    "fitted": Option(BRAKE_CHANNELS, "outputs that have a brake, from output 0 on", "", 0, BRAKE_CHANNELS, whole=True),
    "volts_gain": Option(None, f"volts made over volts asked for; default drawn within {VOLTS_SPREAD:g} of 1", "", 0.5, 1.3),
    "breakdown_v": Option(
        None, "volts at which every dielectric breaks down; default its thickness times 300 V/um", "V", 0.0, 1e5
    ),
    "bridge_stuck": Option(0, "1: the bridge misses its reversals", low=0, high=1, whole=True),
    "lid_open": Option(0, "1: the lid's interlock is open", low=0, high=1, whole=True),
    **{row.name: Option(row.value, row.source, row.unit, row.low, row.high) for row in _ROWS},
    "thickness_m": Option(BRAKE.thickness_m, "polyimide, thesis 4.4.2", "m", _THINNEST_M, 1e-2),
}


class Brakes:
    """Plants of all outputs. Times are world nanoseconds and never go back.

    ``switched``: called with time, "brake" or "piezo", channel and 1 or 0 whenever an output's drive or a piezo goes on or off.

    :param options: values of ``PLANT_OPTIONS`` and ``spread``: overlap, force and volts of this device stray from nominal
        uniformly within ``spread`` times the half-widths above.
    :param rng: of these draws.
    :param start_ns: world time at which the plant begins, ns; cold and without volts.
    """

    def __init__(self, options: Mapping[str, Any], rng: np.random.Generator, start_ns: int):
        overlap, force, volts = rng.uniform(-1, 1, BRAKE_CHANNELS), rng.uniform(-1, 1, BRAKE_CHANNELS), rng.uniform(-1, 1)
        spread = options["spread"]
        drawn_gain = 1.0 + VOLTS_SPREAD * spread * float(volts)
        self._volts_gain = drawn_gain if options["volts_gain"] is None else options["volts_gain"]
        full_m2 = [options["overlap_m2"] * (1.0 + OVERLAP_SPREAD * spread * float(draw)) for draw in overlap]
        system = BrakeSystem(
            brake=BRAKE.with_values(**{name: options[name] for name in _GEOMETRY}),
            drive=DRIVE.with_values(**{name: options[name] for name in _ELECTRIC}),
            contact=CONTACT.with_values(**{row.name: options[row.name] for row in provenance(CONTACT)}),
            finger=FINGER.with_values(**{row.name: options[row.name] for row in provenance(FINGER)}),
            laws=tuple(force_law(finger, options["law"]) for finger in _FINGERS),
            force_gain=tuple(1.0 + FORCE_SPREAD * spread * float(draw) for draw in force),
            overlaps_m2=tuple(min(one_m2, 1.0) if channel < options["fitted"] else 0.0 for channel, one_m2 in enumerate(full_m2)),
        )
        self._plant = brake_plant(options["level"], system)
        if options["breakdown_v"] is not None:
            for channel in range(BRAKE_CHANNELS):
                self._plant.set_output(0.0, channel, breakdown_v=options["breakdown_v"])
        self.stage.stuck = bool(options["bridge_stuck"])
        self.lid_open = bool(options["lid_open"])
        self._driven = 0
        self._pull_n = [0.0] * BRAKE_CHANNELS
        self._piezos = 0
        self._events: deque[tuple[int, int, str, float]] = deque(maxlen=_EVENTS_KEPT)
        self.switched: list[Callable[[int, str, int, int], None]] = []
        self._start_ns = start_ns
        self._reported_ns, self._reported_j = start_ns, 0.0

    @property
    def stage(self) -> OutputStage:
        """Supply and bridge."""
        return self._plant.stage

    # What the firmware does and senses.

    def drive(self, mask: int, volts: float, frequency_hz: float, now_ns: int) -> None:
        """A square wave on some outputs, all others shorted.

        :param mask: outputs, bit 0 for output 0.
        :param volts: setpoint, V; 0 shorts everything.
        :param frequency_hz: of the square wave, Hz.
        :param now_ns: world time, ns.
        """
        driven = mask if volts else 0
        self._plant.drive(self._seconds(now_ns), driven, self._made_v(volts), frequency_hz)
        self._note_driven(driven, volts, now_ns)

    def pins(self, mask: int, volts: float, polarity: int, enabled: bool, now_ns: int) -> None:
        """What a controller's pins set; see ``OutputStage.pins``.

        :param mask: outputs on the bridge, bit 0 for output 0; the others are shorted.
        :param volts: setpoint of the supply, V.
        :param polarity: of the bridge, +1 or -1; 0: its legs shorted.
        :param enabled: whether the supply is on.
        :param now_ns: world time, ns.
        """
        self._plant.pins(self._seconds(now_ns), mask, self._made_v(volts), polarity, enabled)
        self._note_driven(mask if enabled and volts else 0, volts, now_ns)

    def energised(self, now_ns: int) -> list[int]:
        """Outputs that the supply is on, or that have dangerous volts.

        :param now_ns: world time, ns.
        :return: output numbers, 0 to 4, rising.
        """
        volts = enumerate(self.volts(now_ns))
        return [channel for channel, one_v in volts if self._driven >> channel & 1 or abs(one_v) >= DISCHARGED_VOLTS]

    def volts(self, now_ns: int) -> list[float]:
        """Signed volts on each output.

        :param now_ns: world time, ns.
        :return: V (5,).
        """
        self.advance(now_ns)
        return self._plant.voltages_v

    def highest_v(self, now_ns: int) -> float:
        """Maximum magnitude of the volts anywhere behind the supply.

        :param now_ns: world time, ns.
        :return: V.
        """
        volts = self.volts(now_ns)
        return max(self._plant.bus_v, *map(abs, volts))

    def supply_current_a(self) -> float:
        """What the supply gives, as of the last look at volts.

        :return: A.
        """
        return self._plant.supply_current_a

    def supply_charge_c(self, now_ns: int) -> float:
        """All charge that the supply has given so far, its bleeder's included; looking changes nothing.

        :param now_ns: world time, ns.
        :return: C.
        """
        self.advance(now_ns)
        return self._plant.supply_charge_c

    def set_piezos(self, mask: int, now_ns: int) -> None:
        """Vibrate the piezos in ``mask`` and no others.

        :param mask: bit 0 for piezo 0.
        :param now_ns: world time, ns.
        """
        for channel in range(BRAKE_CHANNELS):
            if (mask ^ self._piezos) >> channel & 1:
                self._events.append((now_ns, channel, "piezo_on" if mask >> channel & 1 else "piezo_off", 0.0))
                self._notify(now_ns, "piezo", channel, mask >> channel & 1)
        self._piezos = mask

    # What the world does and sees.

    def load(self, channel: int, now_ns: int, **load: float) -> None:
        """Act on a brake from outside.

        ``pull_n``: a steady pull, to be compared with the capacity; ``travel_m``: how far the strips have slid apart, besides
        what a hand does (off each other altogether: an open output); ``leak_ohm``: across the output (a short: 1 kohm, none:
        inf); ``breakdown_v``: what its dielectric stands from now on; ``hand_m``, and ``hand_m_s`` (0 if left out): where the
        hand is that pulls the finger, and how fast it moves from now on. ``bridge_stuck``, ``lid_open`` (0 or 1): whatever the
        channel.

        :param channel: output, 0 to 4.
        :param now_ns: world time, ns.
        :param load: numbers by the keys above, in SI units.
        :raises InputError: no such channel, another key, or a number outside its range.
        """
        in_range("channel", channel, 0, BRAKE_CHANNELS - 1)
        unknown = set(load) - set(_LOADS)
        if unknown:
            raise InputError(f"load {', '.join(sorted(unknown))} is unknown to a brake; known keys: {', '.join(_LOADS)}")
        if "hand_m_s" in load and "hand_m" not in load:
            raise InputError(f"hand_m_s = {load['hand_m_s']:g} m/s needs hand_m with it: where the hand is")
        at_s = self._seconds(now_ns)
        if "pull_n" in load:
            self._pull_n[channel] = in_range("pull_n", load["pull_n"], 0.0, 1e4, "N")
        electric = {key: load[key] for key in ("travel_m", "leak_ohm", "breakdown_v") if key in load}
        if electric:
            self._plant.set_output(at_s, channel, **electric)
        for key in _SWITCHES:
            in_range(key, load.get(key, 0), 0, 1)
        if "bridge_stuck" in load:
            self._plant.advance(at_s)
            self.stage.stuck = bool(load["bridge_stuck"])
        self.lid_open = bool(load.get("lid_open", self.lid_open))
        if "hand_m" in load:
            self._plant.move(channel, at_s, load["hand_m"], load.get("hand_m_s", 0.0))

    def tension(self, channel: int, now_ns: int) -> float:
        """What the hand of one output feels: what a load cell between hand and brake reads.

        :param channel: output, 0 to 4.
        :param now_ns: world time, ns.
        :return: N.
        :raises InputError: no such channel.
        """
        in_range("channel", channel, 0, BRAKE_CHANNELS - 1)
        self.advance(now_ns)
        return self._plant.tension_n[channel]

    def truth(self, now_ns: int) -> dict[str, Any]:
        """All outputs as they are now.

        :param now_ns: world time, ns.
        :return: by name; lists over outputs but for ``time_ns``, ``supply_energy_j``, ``supply_power_w`` (the mean since the last
            call) and ``events`` (those since the last call). ``held_n`` and ``slipping`` are about ``pull_n``; ``tension_n`` and
            ``slip_m`` about the hand.
        """
        self.advance(now_ns)
        plant, channels = self._plant, range(BRAKE_CHANNELS)
        elapsed_s = (now_ns - self._reported_ns) / 1e9
        given_j, self._reported_j = plant.supply_energy_j - self._reported_j, plant.supply_energy_j
        self._reported_ns = now_ns
        events, self._events = sorted(self._events), deque(maxlen=_EVENTS_KEPT)
        capacity_n = plant.capacity_n
        return {
            "time_ns": now_ns,
            "volts": plant.voltages_v,
            "amplitude_v": [plant.amplitude_v(channel) for channel in channels],
            "capacity_n": capacity_n,
            "held_n": [min(self._pull_n[channel], capacity_n[channel]) for channel in channels],
            "slipping": [self._pull_n[channel] > capacity_n[channel] for channel in channels],
            "tension_n": plant.tension_n,
            "slip_m": plant.slip_m,
            "energy_j": [plant.stage.output_energy_j(channel) for channel in channels],
            "supply_energy_j": plant.supply_energy_j,
            "supply_power_w": given_j / elapsed_s if elapsed_s > 0.0 else 0.0,
            "piezo": [bool(self._piezos >> channel & 1) for channel in channels],
            "events": events,
        }

    def advance(self, now_ns: int) -> None:
        """Carry everything to ``now_ns``.

        :param now_ns: world time, ns.
        """
        plant = self._plant
        plant.advance((now_ns - self._start_ns) / 1e9)
        for event in plant.take_events():
            self._events.append((self._start_ns + round(event.time_s * 1e9), event.output, event.kind, event.force_n))

    def _made_v(self, volts: float) -> float:
        """What the supply makes of a setpoint; no setpoint makes more than it can."""
        return min(volts * self._volts_gain, self._plant.system.drive.supply_volts)

    def _note_driven(self, driven: int, volts: float, now_ns: int) -> None:
        for channel in range(BRAKE_CHANNELS):
            if (driven ^ self._driven) >> channel & 1:
                on = driven >> channel & 1
                self._events.append((now_ns, channel, "driven" if on else "shorted", volts if on else 0.0))
                self._notify(now_ns, "brake", channel, on)
        self._driven = driven

    def _notify(self, now_ns: int, kind: str, channel: int, on: int) -> None:
        for seen in self.switched:
            seen(now_ns, kind, channel, on)

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._start_ns) / 1e9
