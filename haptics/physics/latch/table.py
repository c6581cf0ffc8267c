"""Level ``table``: free flight from a table, and no bounces where they cannot matter.

While the pin is free it goes by spans of half a millisecond that are looked up (``flow_map``); against a stop it is stepped
as at level ``dynamic``. A pin that lands with too little energy to leave again counts as at rest from that moment on; if the
coil drives it away before its bounces have died down, they are caught up with first, so that what follows begins where it
would have.
Where the table has no answer (a skin under the pin, more than 7 V at nominal resistance, parameters for which a span is too long)
flight is stepped too: slower, never wrong.

Bounces at a landing are thus neither seen nor reported, and position between them is that of rest.
"""

from __future__ import annotations

import math
from functools import lru_cache

from haptics.physics.latch.dynamic import STEP_S, DynamicLatch
from haptics.physics.latch.flow_map import UNTABLED, flight, flow_table
from haptics.physics.latch.kernel import FREE, ON_STOP, REACHED_OFF, REACHED_ON
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import Latched

_STILL_M_S = 1e-4
_SETTLED = 12.0
"""Time constants of the coil after which its current counts as settled."""


class TableLatch(DynamicLatch):
    """One tactor at level ``table``; members as ``LatchPlant``.

    :param parameters: of the tactor.
    :param latched: where it rests at first: on or off.
    :param start_s: time at the start (s).
    :param step_s: of what is stepped (s), 1 us to 1 ms.
    :param compiled: False: the same lines in plain Python.
    :raises InputError: a state it cannot rest in, or a step outside its range.
    """

    def __init__(
        self,
        parameters: LatchParameters = LATCH,
        latched: Latched = "off",
        start_s: float = 0.0,
        step_s: float = STEP_S,
        compiled: bool = True,
    ):
        super().__init__(parameters, latched, start_s, step_s, compiled)
        self._fly = flight(compiled)
        self._table = flow_table(parameters)
        self._wells = wells(parameters)
        self._landed: _Landing | None = None

    def drive(self, time_s: float, volts: float) -> None:
        super().drive(time_s, volts)
        landed = self._landed
        if landed is None:
            return
        if landed.energy_j(time_s, self._parameters) < landed.negligible_j(self._parameters):
            self._landed = None
        elif self._holds(landed, time_s) and time_s - landed.drives[-1][0] > _SETTLED * self._coil_s:
            landed.drives.append((time_s, self._volts, self._resistance))
            self._rest_now()
        else:
            self._catch_up(landed, time_s)

    def load_skin(self, time_s: float, stiffness_n_m: float, at_m: float) -> None:
        self._commit(time_s)
        if self._landed is not None:
            self._catch_up(self._landed, time_s)
        super().load_skin(time_s, stiffness_n_m, at_m)

    def _step(self, end: float, whole: bool, marker: float) -> int:
        table = self._table
        if self._touching != FREE or table is None or self._parameters.skin_stiffness_n_m:
            return super()._step(end, whole, marker)
        self._x, self._v, self._i, self._touching, self._t, why, self._charge = self._fly(
            self._x, self._v, self._i, self._t, end, whole,
            self._volts, self._resistance, marker, self._charge, self._packed, table.grid, table.nodes,
        )  # fmt: skip
        return super()._step(end, whole, marker) if why == UNTABLED else why

    def _report(self, why: int) -> None:
        time_s, speed = self._origin_s + self._t, self._v
        super()._report(why)
        if why not in (REACHED_ON, REACHED_OFF):
            return
        taken_j = self._energy_j + self._volts * self._charge
        landed = _Landing(time_s, speed, self._i, self._touching, taken_j, [(time_s, self._volts, self._resistance)])
        if self._holds(landed, time_s):
            self._landed = landed
            self._rest_now()

    @property
    def _coil_s(self) -> float:
        return self._parameters.inductance_h / self._resistance

    def _rest_now(self) -> None:
        """Count the pin as at rest and the current as settled, less the charge that its settling takes from it."""
        self._charge -= self._parameters.inductance_h * (self._volts / self._resistance - self._i) / self._resistance
        self._resting = True
        self._settle()

    def _holds(self, landed: _Landing, time_s: float) -> bool:
        """Whether plates and coil keep a pin that still bounces at the stop it landed on."""
        toward = 1.0 if landed.touching == ON_STOP else -1.0
        if toward * self._volts < 0.0 or self._parameters.skin_stiffness_n_m:
            return False
        plates_j, coil_j_a = self._wells[landed.touching == ON_STOP]
        return landed.energy_j(time_s, self._parameters) < plates_j + coil_j_a * abs(self._volts) / self._resistance

    def _catch_up(self, landed: _Landing, time_s: float) -> None:
        """Bounce from the landing to now, under what has driven the coil since."""
        ghost = DynamicLatch(
            self._parameters, "on" if landed.touching == ON_STOP else "off", landed.time_s, self._step_s, self._compiled
        )
        ghost._v, ghost._i = landed.speed_m_s, landed.current_a
        ghost._x = self._parameters.stroke_m if landed.touching == ON_STOP else 0.0
        for at_s, volts, resistance in landed.drives:
            ghost._commit(at_s)
            ghost._volts, ghost._resistance, ghost._resting = volts, resistance, False
        ghost._commit(time_s)
        self._x, self._v, self._i, self._touching = ghost._x, ghost._v, ghost._i, ghost._touching
        self._touch_on, self._touch_off = ghost._touch_on, ghost._touch_off
        self._energy_j = landed.taken_j + ghost._energy_j
        self._landed, self._resting, self._peeked = None, False, None


class _Landing:
    """A pin that has met a stop: when, how fast, the energy taken till then, and what has driven its coil since."""

    __slots__ = ("current_a", "drives", "speed_m_s", "taken_j", "time_s", "touching")

    def __init__(
        self,
        time_s: float,
        speed_m_s: float,
        current_a: float,
        touching: int,
        taken_j: float,
        drives: list[tuple[float, float, float]],
    ):
        self.time_s, self.speed_m_s, self.current_a, self.touching = time_s, speed_m_s, current_a, touching
        self.taken_j, self.drives = taken_j, drives

    def energy_j(self, time_s: float, p: LatchParameters) -> float:
        """What the bounces may still hold: drag takes energy at ``b/m`` in the mean over bounces; half of that is counted on."""
        decay = math.exp(-0.5 * p.drag_n_s_m / p.mass_kg * (time_s - self.time_s))
        return 0.5 * p.mass_kg * self.speed_m_s**2 * decay

    def negligible_j(self, p: LatchParameters) -> float:
        return 0.5 * p.mass_kg * _STILL_M_S**2


@lru_cache(maxsize=64)
def wells(p: LatchParameters) -> tuple[tuple[float, float], tuple[float, float]]:
    """How deep the wells of the off and of the on stop are against the watershed between the plates.

    :param p: of the tactor.
    :return: of each stop, off then on: work of the plates (J), and of the coil for each ampere (J/A).
    """
    watershed = watershed_m(p)
    return tuple(
        (_plates_j(p, stop) - _plates_j(p, watershed), abs(_coil_j_a(p, stop) - _coil_j_a(p, watershed)))
        for stop in (0.0, p.stroke_m)
    )  # type: ignore[return-value]


def watershed_m(p: LatchParameters) -> float:
    """Where the plates' pull turns from off to on, to a sixty-fourth of the stroke.

    :param p: of the tactor.
    :return: position (m); a stop's, if the pull never turns.
    """
    return min((p.stroke_m * k / 64 for k in range(65)), key=lambda x: _plates_j(p, x))


def _plates_j(p: LatchParameters, x: float) -> float:
    """Integral of the plates' force up to ``x``: minimal at the watershed, where the force turns from off to on."""
    d, q = p.plate_length_m, 1.0 - p.plate_power
    if abs(q) < 1e-9:
        return -p.hold_on_n * d * math.log(1.0 + (p.stroke_m - x) / d) - p.hold_off_n * d * math.log(1.0 + x / d)
    return -d / q * (p.hold_on_n * (1.0 + (p.stroke_m - x) / d) ** q + p.hold_off_n * (1.0 + x / d) ** q)


def _coil_j_a(p: LatchParameters, x: float) -> float:
    """Integral of the coil's force for each ampere."""
    norm = p.thrust_n_a * p.thrust_length_m / (1.0 + math.exp(-p.stroke_m / p.thrust_length_m))
    return norm * (math.exp((x - p.stroke_m) / p.thrust_length_m) - math.exp(-x / p.thrust_length_m))
