"""Level ``event``: a state table with travel times; nothing is integrated.

Progress ``u`` runs from 0 (off) to 1 (on). Under voltage it moves at ``1/T`` with ``T = T5 ((5 - V0)/(V - V0))^q``, ``V`` being
the voltage that gives a coil at nominal temperature the same current. Without voltage it leaves the watershed ``u_c``
between the two plates exponentially, ``u - u_c ~ exp(t/escape)``, to whichever side it is on; ``u_c`` is where the shortest
pulse that switches leaves it. Current and energy are those of a coil whose pin does not move.

The constants are fitted to the equation of motion over ``FITTED_V``: for ``LatchParameters()`` they stand here and the tests
fit them again, for other parameters ``event_fit`` makes them when needed. Position is linear in time here, so only
arrivals, states and energies mean anything. What this level does not know it reports in ``outside``: other voltages, a skin under
the pin, and a pulse back in flight that ends before the pin has arrived.
"""

from __future__ import annotations

import math

from haptics.errors import InputError
from haptics.physics.latch.event_fit import fit_travel
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import Latched, LatchEvent, LatchPlant, checked_resistance, checked_time, latched_at
from haptics.physics.latch.travel import TRAVEL, TravelTable, outside_fit
from haptics.units import in_range

_SKIN = "a skin under the pin is not felt"


def travel_table(parameters: LatchParameters) -> TravelTable:
    """The constants of a parameter set; resistance and skin do not count, they act through the current or not at all.

    :param parameters: of the tactor.
    :return: constants of both directions.
    :raises InputError: see ``event_fit.fit_travel``.
    """
    same = {"resistance_ohm", "resistance_per_k", "near_stop_m", "skin_stiffness_n_m", "skin_at_m"}
    nominal = parameters.with_values(**{name: getattr(LATCH, name) for name in same})
    if nominal == LATCH:
        return TRAVEL
    return fit_travel(nominal)


def effective_volts(volts: float, resistance_ohm: float) -> float:
    """The voltage that gives a coil of nominal resistance the same current: what the constants are a function of.

    :param volts: at the terminals (V).
    :param resistance_ohm: of the coil as warm as it is (ohm), more than 0.
    :return: volts at nominal resistance, 1.38 ohm.
    """
    return volts * LATCH.resistance_ohm / resistance_ohm


class EventLatch(LatchPlant):
    """One tactor at level ``event``; see ``LatchPlant`` for the meaning of every member.

    :param parameters: of the tactor.
    :param latched: where it rests at first: on or off.
    :param start_s: time at the start (s).
    :raises InputError: a state it cannot rest in, or parameters with which it does not switch all over ``FITTED_V``.
    """

    def __init__(self, parameters: LatchParameters = LATCH, latched: Latched = "off", start_s: float = 0.0):
        if latched not in ("on", "off"):
            raise InputError(f"latched = {latched!r} is not allowed; allowed: on, off (a tactor cannot rest in between)")
        self.rise_k = 0.0
        self._parameters, self._table = parameters, travel_table(parameters)
        table = self._table
        self._events: list[LatchEvent] = []
        self._now_s = self._since_s = float(start_s)
        self._volts, self._resistance = 0.0, parameters.resistance_ohm
        self._energy_j = self._from_a = 0.0
        self._from = 1.0 if latched == "on" else 0.0
        self._watershed, self._escape_s = 0.5, table.on_escape_s
        self._speed = 0.0  # progress a second, under voltage
        self._coasting = False
        self._arrival_s = self._leave_s = math.inf
        self._touching_skin = latched == "on"
        self._changed_in_flight = False
        self._outside: dict[str, None] = {_SKIN: None} if parameters.skin_stiffness_n_m else {}

    def drive(self, time_s: float, volts: float) -> None:
        volts = in_range("volts", volts, -1e3, 1e3, "V")
        resistance = checked_resistance(self._parameters, self.rise_k)
        self.advance(time_s)
        u = self._progress()
        flying = 0.0 < u < 1.0
        if flying and self._changed_in_flight and self._speed != 0.0:
            self._outside["a pulse back in flight ended before the pin had arrived"] = None
        self._changed_in_flight = flying and volts != 0.0 and volts * self._volts <= 0.0
        self._energy_j, self._from_a = self.energy_j, self.current_a
        self._since_s, self._from, self._volts, self._resistance = time_s, u, volts, resistance
        self._speed, self._coasting, self._arrival_s, self._leave_s = 0.0, False, math.inf, math.inf
        toward_on = volts > 0
        effective_v = effective_volts(abs(volts), resistance)
        travel_s = self._table.travel_s(toward_on, effective_v, extrapolate=True)
        # Too weak to carry a pin that rests, it still pushes one that flies.
        acts = math.isfinite(travel_s) or (flying and volts != 0.0)
        if acts:
            self._outside |= dict.fromkeys(outside_fit(effective_v))
        if volts != 0.0 and math.isfinite(travel_s):
            left = 1.0 - u if toward_on else u
            if left > 0.0:
                self._speed = (1.0 if toward_on else -1.0) / travel_s
                self._arrival_s = time_s + left * travel_s
            share = self._table.min_s(toward_on, effective_v, extrapolate=True) / travel_s
            self._watershed = share if toward_on else 1.0 - share
            self._escape_s = self._table.on_escape_s if toward_on else self._table.off_escape_s
            if not toward_on and self._touching_skin:
                self._leave_s = time_s + max(0.0, self._table.off_leave_fraction - (1.0 - u)) * travel_s
        elif 0.0 < u < 1.0:
            self._coasting = True
            gap = u - self._watershed
            room = 1.0 - self._watershed if gap > 0 else self._watershed
            # On the watershed itself, rounding decides; the smallest gap stands for it.
            self._arrival_s = time_s + self._escape_s * math.log(room / max(abs(gap), 1e-12))
            if gap <= 0 and self._touching_skin:
                self._leave_s = time_s

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        self._parameters = self._parameters.with_values(skin_stiffness_n_m=stiffness_n_m, skin_at_m=at_m)
        self.advance(time_s)
        if stiffness_n_m:
            self._outside[_SKIN] = None

    def advance(self, to_s: float) -> None:
        self._now_s = checked_time(to_s, self._now_s)
        if self._leave_s <= to_s:
            self._events.append(LatchEvent(self._leave_s, "left_skin", self.speed_m_s))
            self._leave_s, self._touching_skin = math.inf, False
        if self._arrival_s <= to_s:
            on = self._target() == 1.0
            if on and not self._touching_skin:
                self._events.append(LatchEvent(self._arrival_s, "reached_skin", self._impact_m_s(on)))
            elif not on:
                self._events.append(LatchEvent(self._arrival_s, "reached_off", -self._impact_m_s(on)))
            self._touching_skin = on
            self._from, self._speed, self._coasting, self._arrival_s = self._target(), 0.0, False, math.inf

    def take_events(self) -> list[LatchEvent]:
        events, self._events = self._events, []
        return events

    @property
    def outside(self) -> tuple[str, ...]:
        return tuple(self._outside)

    @property
    def parameters(self) -> LatchParameters:
        """Of this tactor, the skin as it is now."""
        return self._parameters

    @property
    def position_m(self) -> float:
        """Position, m: 0 at the off stop, ``stroke_m`` at the skin's; in between only its arrivals are fitted."""
        return self._progress() * self._parameters.stroke_m

    @property
    def speed_m_s(self) -> float:
        if self._coasting:
            return (self._progress() - self._watershed) / self._escape_s * self._parameters.stroke_m
        return self._speed * self._parameters.stroke_m

    @property
    def current_a(self) -> float:
        settled_a = self._volts / self._resistance
        return settled_a + (self._from_a - settled_a) * math.exp(-(self._now_s - self._since_s) / self._coil_s)

    @property
    def energy_j(self) -> float:
        elapsed_s, settled_a = self._now_s - self._since_s, self._volts / self._resistance
        charge_c = settled_a * elapsed_s + (self._from_a - settled_a) * self._coil_s * -math.expm1(-elapsed_s / self._coil_s)
        return self._energy_j + self._volts * charge_c

    @property
    def _coil_s(self) -> float:
        """Time constant of the coil."""
        return self._parameters.inductance_h / self._resistance

    @property
    def at_rest(self) -> bool:
        return math.isinf(self._arrival_s)

    @property
    def latched(self) -> Latched:
        return latched_at(self.position_m, self._parameters)

    def _impact_m_s(self, on: bool) -> float:
        """A coasting pin meets a stop at the speed of its escape, a driven one the faster the sooner it comes."""
        table, stroke_m = self._table, self._parameters.stroke_m
        if self._coasting:
            return (1.0 - self._watershed if on else self._watershed) / self._escape_s * stroke_m
        at_nominal_m_s, at_nominal_s = (
            (table.on_impact_m_s, table.on_travel_s) if on else (table.off_impact_m_s, table.off_travel_s)
        )
        return at_nominal_m_s * at_nominal_s * abs(self._speed)

    def _target(self) -> float:
        rising = self._from > self._watershed if self._coasting else self._speed > 0
        return 1.0 if rising else 0.0

    def _progress(self) -> float:
        dt = self._now_s - self._since_s
        if self._coasting:
            return self._watershed + (self._from - self._watershed) * math.exp(dt / self._escape_s)
        return min(1.0, max(0.0, self._from + self._speed * dt))
