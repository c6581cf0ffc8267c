"""Fifteen actuators on one supply: motion, heat and sag, each actuator a little different from the next.

Heat follows what the coil took from the supply, as a cold coil would have taken it: the published ``c`` is a rise over 0.36 W,
that is 18 W a pulse, which a warm coil no longer takes, so that the rise of its resistance is in ``c`` already. The supply's
resistance is shared, so that coils which are on together see less: ``V = V0 / (1 + Rs * sum(1/R))`` over the coils that are on
(their motion's back-voltage left out).

Nothing reaches the drivers but through the feed, a switch in the supply. Faults to play: a driver that is stuck on drives its
coil toward the skin as long as it is fed; a short lies across a coil's wires and draws from the supply whenever the coil is on.

Each landing of a pin is reported to its listeners (an accelerometer); what the pin lands on at the off side is ``surface``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from firmware_models.options import Option
from firmware_models.plants.jammed import JammedLatch
from haptics.errors import InputError
from haptics.link.messages import COIL_CHANNELS
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS
from haptics.physics.latch.plant import Latched, LatchPlant
from haptics.physics.latch.pulse import LEVELS, latch_plant
from haptics.physics.latch.recoil import RECOIL, SURFACES
from haptics.physics.parameters import provenance
from haptics.physics.thermal.one_node import THERMAL, relax
from haptics.units import in_range

RESISTANCE_SPREAD_OHM = 0.1
"""Half-width of the coils' resistance (thesis 3.4.3)."""
RECOIL_SPREAD = 0.05
"""Half-width of peak and decay of the recoil from actuator to actuator, as a share (assumed)."""
COIL_SHORT_OHM = 0.3
"""Of a short across a coil's wires (assumed: wires and driver)."""
_ALL = (1 << COIL_CHANNELS) - 1
_EVENTS_KEPT = 1 << 16
_LOADS = ("stiffness_n_m", "at_m", "driver_stuck", "coil_short", "supply_v", "supply_ohm")
_THERMAL_ROWS = [row for row in provenance(THERMAL) if "sd" not in row.name.split("_")]
_RECOIL_ROWS = [row for row in provenance(RECOIL) if row.name != "pendulum_kg"]  # the pendulum is not the board's
_RECOIL_DRAWN = ("peak_g", *(f"tau_{surface}_s" for surface in SURFACES))

PLANT_OPTIONS: dict[str, Option] = {
    "level": Option("dynamic", "model of the tactor", choices=tuple(LEVELS)),
    "fitted": Option(_ALL, "channels that have an actuator, as a bit mask", "", 0, _ALL, whole=True),
    "stuck": Option(0, "channels whose pin is stuck at the off stop, as a bit mask", "", 0, _ALL, whole=True),
    "driver_stuck": Option(0, "channels whose driver is stuck on, toward the skin, as a bit mask", "", 0, _ALL, whole=True),
    "coil_short": Option(
        0, f"channels with {COIL_SHORT_OHM:g} ohm across their coil's wires, as a bit mask", "", 0, _ALL, whole=True
    ),
    "supply_v": Option(NOMINAL_VOLTS, "coil supply without load", "V", 0.0, NOMINAL_VOLTS),
    "supply_ohm": Option(0.0, "resistance all coils share", "ohm", 0.0, 10.0),
    "surface": Option("foam", "what the magnets land on at the off plate", choices=SURFACES),
    **{
        row.name: Option(None, f"every actuator has this; default {row.value:g}", row.unit, row.low, row.high)
        for row in (*provenance(LATCH), *_THERMAL_ROWS, *_RECOIL_ROWS)
    },
}


class Landing(NamedTuple):
    """A pin reached a stop.

    :param time_ns: world time, to the nanosecond.
    :param channel: actuator, 0 to 14.
    :param at_off: at the off plate; else at the skin's side.
    :param speed_m_s: unsigned, m/s.
    """

    time_ns: int
    channel: int
    at_off: bool
    speed_m_s: float


class Actuators:
    """Plants of all channels. Times are world nanoseconds and never go back.

    ``recoils``: what a landing on the off side does at each channel. ``listeners``: called with each ``Landing`` of any channel
    once the plant is carried past it, in the order of time for each channel. ``switched``: called with time, "coil", channel
    and 1, -1 or 0 whenever what drives a coil changes.

    :param options: values of ``PLANT_OPTIONS`` and ``spread``: coil resistance, tau and c are drawn uniformly within ``spread``
        times what the thesis states for their uncertainty (3.4.3, 3.5.2), the recoil's peak and decay within ``spread`` times
        ``RECOIL_SPREAD``; a parameter that was given is exact.
    :param rng: of these draws.
    :param start_ns: world time at which the plant begins, ns; cold, all pins off.
    :param fed: whether the feed is on at first: a board begins without, a bench that has no such switch with it.
    """

    def __init__(self, options: Mapping[str, Any], rng: np.random.Generator, start_ns: int, fed: bool = True):
        given = {row.name: options[row.name] for row in provenance(LATCH) if options[row.name] is not None}
        heat = {row.name: options[row.name] for row in _THERMAL_ROWS if options[row.name] is not None}
        draws = rng.uniform(-1.0, 1.0, (COIL_CHANNELS, 3)) * options["spread"]
        around = {
            "resistance_ohm": LATCH.resistance_ohm + RESISTANCE_SPREAD_OHM * draws[:, 0],
            "tau_s": THERMAL.tau_s + THERMAL.tau_sd_s * draws[:, 1],
            "c_k_per_w": THERMAL.c_k_per_w + THERMAL.c_sd_k_per_w * draws[:, 2],
        }
        self.latches = [
            LATCH.with_values(**{"resistance_ohm": float(around["resistance_ohm"][channel]), **given})
            for channel in range(COIL_CHANNELS)
        ]
        self.thermals = [
            THERMAL.with_values(**{name: float(around[name][channel]) for name in ("tau_s", "c_k_per_w")} | heat)
            for channel in range(COIL_CHANNELS)
        ]
        landing = {row.name: options[row.name] for row in _RECOIL_ROWS if options[row.name] is not None}
        # A stream of its own, so that what was drawn above does not depend on how much is drawn here.
        shares = 1.0 + RECOIL_SPREAD * options["spread"] * rng.spawn(1)[0].uniform(-1.0, 1.0, (COIL_CHANNELS, 4))
        self.recoils = [
            RECOIL.with_values(
                **{name: getattr(RECOIL, name) * float(share) for name, share in zip(_RECOIL_DRAWN, row, strict=True)} | landing
            )
            for row in shares
        ]
        self.surface: str = options["surface"]
        self.listeners: list[Callable[[Landing], None]] = []
        self.switched: list[Callable[[int, str, int, int], None]] = []
        self.supply_volts: float = options["supply_v"]
        self.supply_ohm: float = options["supply_ohm"]
        self.rise_k = [0.0] * COIL_CHANNELS
        self.switches = [0] * COIL_CHANNELS
        self.events: deque[tuple[int, int, str, float]] = deque(maxlen=_EVENTS_KEPT)
        self._plants: dict[int, LatchPlant] = {
            channel: JammedLatch(self.latches[channel])
            if options["stuck"] >> channel & 1
            else latch_plant(options["level"], self.latches[channel])
            for channel in range(COIL_CHANNELS)
            if options["fitted"] >> channel & 1
        }
        _warm_up(options["level"])
        self._start_ns = start_ns
        self._awake: set[int] = set()  # driven or touched at least once; the others are cold and still, and time passes them by
        self._settled_ns = [start_ns] * COIL_CHANNELS
        self._energy_j = [0.0] * COIL_CHANNELS
        self._position_m = [0.0] * COIL_CHANNELS
        self._latched: list[Latched] = ["off"] * COIL_CHANNELS
        for channel, plant in self._plants.items():
            self._position_m[channel] = plant.position_m
        self._last_stop = ["reached_off"] * COIL_CHANNELS
        self._fed = fed
        self._driver_stuck: int = options["driver_stuck"]
        self._coil_short: int = options["coil_short"]
        self._asked = [0] * COIL_CHANNELS
        self._signs = [0] * COIL_CHANNELS

    @property
    def volts(self) -> float:
        """At the coils' terminals, with what is on now."""
        siemens = sum(1.0 / latch.resistance_ohm for latch, sign in zip(self.latches, self._signs, strict=True) if sign)
        return self.supply_volts / (1.0 + self.supply_ohm * (siemens + self._short_siemens()))

    def current_a(self, now_ns: int) -> float:
        """What all coils draw, and what short-circuits them.

        :param now_ns: world time, ns.
        :return: A, not below 0.
        """
        for channel, sign in enumerate(self._signs):
            if sign:
                self._settle(channel, now_ns)
        return self.sensed_current_a(now_ns)

    def sensed_current_a(self, now_ns: int) -> float:
        """As ``current_a``, but looking leaves the steps in which heat is counted as they are.

        :param now_ns: world time, ns.
        :return: A, not below 0.
        """
        total = self.volts * self._short_siemens()
        for channel, sign in enumerate(self._signs):
            if sign:
                self._plants[channel].advance((now_ns - self._start_ns) / 1e9)
                total += abs(self._plants[channel].current_a)
        return total

    @property
    def energised(self) -> list[int]:
        """Channels whose coil is on now, by command or by a driver that is stuck."""
        return [channel for channel, sign in enumerate(self._signs) if sign]

    def rise(self, channel: int, now_ns: int) -> float:
        """Temperature rise of one actuator now.

        :param channel: actuator, 0 to 14.
        :param now_ns: world time, ns.
        :return: K.
        """
        self.carry(channel, now_ns)
        return self.rise_k[channel]

    def carry(self, channel: int, now_ns: int) -> None:
        """Carry one actuator to now; listeners hear its landings, each at most 50 us after it was passed.

        :param channel: actuator, 0 to 14.
        :param now_ns: world time, ns.
        """
        if channel in self._awake:
            self._settle(channel, now_ns)

    def switch(self, changes: Mapping[int, int], now_ns: int) -> None:
        """Command coils; the others that are on feel it through the supply, if that has a resistance.

        A coil is on as commanded only while the feed is on and its driver is not stuck; channels that are not fitted stay off.

        :param changes: by channel, 0 to 14: 1 toward the skin, -1 back, 0 off; channels left out stay as they are.
        :param now_ns: world time, ns.
        """
        for channel, sign in changes.items():
            self._asked[channel] = sign
        self._drive(now_ns, set(changes))

    def feed(self, on: bool, now_ns: int) -> None:
        """Switch what feeds all drivers.

        :param on: whether they are fed from now on.
        :param now_ns: world time, ns.
        """
        self._fed = on
        self._drive(now_ns, set())

    def load(self, channel: int, now_ns: int, **load: float) -> None:
        """Act on an actuator from outside.

        ``stiffness_n_m`` (0: none) and ``at_m``: a skin under the pin, from so much travel on. ``driver_stuck``, ``coil_short``
        (0 or 1): this channel's fault begins or ends. ``supply_v``, ``supply_ohm``: the supply that all share, from now on.

        :param channel: actuator, 0 to 14.
        :param now_ns: world time, ns.
        :param load: numbers by the keys above, in SI units.
        :raises InputError: no such channel, another key, or a number outside its range.
        """
        in_range("channel", channel, 0, COIL_CHANNELS - 1)
        unknown = set(load) - set(_LOADS)
        if unknown:
            raise InputError(f"load {', '.join(sorted(unknown))} is unknown to an actuator; known keys: {', '.join(_LOADS)}")
        if channel not in self._plants:
            raise InputError(f"channel = {channel} has no actuator; allowed: {', '.join(map(str, sorted(self._plants)))}")
        for key in set(load) - {"stiffness_n_m", "at_m"}:
            option = PLANT_OPTIONS[key]
            in_range(key, load[key], option.low, 1 if option.whole else option.high, option.unit)
        if "stiffness_n_m" in load or "at_m" in load:
            self._wake(channel, now_ns)
            at_m = load.get("at_m", self.latches[channel].skin_at_m)
            self._plants[channel].load_skin((now_ns - self._start_ns) / 1e9, load.get("stiffness_n_m", 0.0), at_m)
        if set(load) - {"stiffness_n_m", "at_m"}:
            self._driver_stuck = _with_bit(self._driver_stuck, channel, load.get("driver_stuck"))
            self._coil_short = _with_bit(self._coil_short, channel, load.get("coil_short"))
            self.supply_volts = load.get("supply_v", self.supply_volts)
            self.supply_ohm = load.get("supply_ohm", self.supply_ohm)
            self._drive(now_ns, set(self.energised))

    def _drive(self, now_ns: int, changed: set[int]) -> None:
        """Put every coil that changed, or feels a change through the supply, to what it sees now."""
        for channel in self._plants:
            sign = 0 if not self._fed else 1 if self._driver_stuck >> channel & 1 else self._asked[channel]
            if sign != self._signs[channel]:
                self._signs[channel] = sign
                changed.add(channel)
                for seen in self.switched:
                    seen(now_ns, "coil", channel, sign)
        volts = self.volts
        for channel, sign in enumerate(self._signs):
            if channel in self._plants and (channel in changed or (sign and self.supply_ohm > 0.0)):
                self._wake(channel, now_ns)
                self._plants[channel].rise_k = self.rise_k[channel]
                self._plants[channel].drive((now_ns - self._start_ns) / 1e9, sign * volts)

    def _short_siemens(self) -> float:
        if not self._coil_short:
            return 0.0
        return sum(self._coil_short >> channel & 1 for channel in self.energised) / COIL_SHORT_OHM

    def truth(self, now_ns: int) -> dict[str, Any]:
        """All channels as they are now.

        :param now_ns: world time, ns.
        :return: by name, lists over channels but for ``time_ns``, ``fitted`` (channels), ``outside`` (words), ``supply_v`` and
            ``events`` (those since the last call).
        """
        for channel in self._awake:
            self._settle(channel, now_ns)
        events, self.events = sorted(self.events), deque(maxlen=_EVENTS_KEPT)
        return {
            "time_ns": now_ns,
            "rise_k": list(self.rise_k),
            "position_m": list(self._position_m),
            "latched": list(self._latched),
            "energy_j": list(self._energy_j),
            "switches": list(self.switches),
            "coils_on": [sign != 0 for sign in self._signs],
            "fitted": sorted(self._plants),
            "outside": sorted({reason for plant in self._plants.values() for reason in plant.outside}),
            "supply_v": self.volts,
            "events": events,
        }

    def _wake(self, channel: int, now_ns: int) -> None:
        """Carry one actuator to now, from where on it counts."""
        if channel not in self._awake:
            self._awake.add(channel)
            self._settled_ns[channel] = now_ns
        self._settle(channel, now_ns)

    def _settle(self, channel: int, now_ns: int) -> None:
        """Carry one actuator to now, and let what it took warm it."""
        elapsed_ns = now_ns - self._settled_ns[channel]
        if elapsed_ns == 0:
            return
        plant = self._plants[channel]
        plant.advance((now_ns - self._start_ns) / 1e9)
        self._settled_ns[channel] = now_ns
        self._position_m[channel], self._latched[channel] = plant.position_m, plant.latched
        before_j = self._energy_j[channel]
        self._energy_j[channel] = max(plant.energy_j, before_j)
        cold_j = (self._energy_j[channel] - before_j) * (1.0 + self.latches[channel].resistance_per_k * plant.rise_k)
        elapsed_s = elapsed_ns / 1e9
        self.rise_k[channel] = relax(self.rise_k[channel], cold_j / elapsed_s, elapsed_s, self.thermals[channel])
        for event in plant.take_events():
            time_ns = self._start_ns + round(event.time_s * 1e9)
            self.events.append((time_ns, channel, event.kind, event.speed_m_s))
            if event.kind != "left_skin":
                landing = Landing(time_ns, channel, event.kind == "reached_off", abs(event.speed_m_s))
                for heard in self.listeners:
                    heard(landing)
            if event.kind != "left_skin" and event.kind != self._last_stop[channel]:
                self._last_stop[channel] = event.kind
                self.switches[channel] += 1


def _with_bit(mask: int, channel: int, value: float | None) -> int:
    """``mask`` with this channel's bit set or cleared; None leaves it."""
    if value is None:
        return mask
    return mask | 1 << channel if value else mask & ~(1 << channel)


def _warm_up(level: str) -> None:
    """Compile the level's inner loop now: on the real clock a board that stalls for it later would look dead."""
    plant = latch_plant(level)
    plant.drive(0.0, NOMINAL_VOLTS)
    plant.advance(1e-3)
