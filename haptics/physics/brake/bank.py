"""Many clutches at once, each on a supply of its own, as arrays: for garments, sweeps and populations.

The same models as ``brake_plant``, level ``lagged`` or ``dynamic``, in one compiled loop a step.

>>> bank = BrakeBank(64)
>>> bank.drive(1500.0, 20.0)
>>> bank.step(200)
>>> bool((bank.capacity_n > 18.0).all())
True
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.physics.brake import kernel as loop
from haptics.physics.brake.dynamic import FRICTIONS
from haptics.physics.brake.finger import finger_parameters
from haptics.physics.brake.lagged import CAPACITANCE_EVERY_S, MAX_STEP_S, MIN_STEP_S
from haptics.physics.brake.system import BrakeSystem, ForceTable
from haptics.units import in_range, one_of

LEVELS = ("lagged", "dynamic")
STEP_S = 1e-3
MAX_COUNT = 10_000_000
Floats = NDArray[np.float64]


class BrakeBank:
    """``count`` clutches at rest, shorted, hands at 0; time begins at 0 and goes on in whole steps.

    All share the ``system``'s first output but for ``force_gain`` and ``overlap_m2`` (a number, or one each). The output stage is
    that of ``OutputStage`` with one output, clamped reversal, no leak.

    :param count: clutches, 1 to 10 million.
    :param level: lagged or dynamic.
    :param system: whose first output all are made from; one published brake by default.
    :param step_s: length of a step (s), 1 us to 100 ms.
    :param force_gain: a clutch's force over its law's, 0 to 10; a number or (count,).
    :param overlap_m2: overlap at first (m2), 0 to 1; a number or (count,); the system's by default.
    :param friction: of level ``dynamic``: coulomb or lugre.
    :param compiled: False: plain Python, far slower.
    :raises InputError: a count outside 1 to 10 million, an unknown level or friction, direct reversal, a reservoir, or a number
        out of range.
    """

    def __init__(
        self,
        count: int,
        level: str = "lagged",
        system: BrakeSystem | None = None,
        *,
        step_s: float = STEP_S,
        force_gain: ArrayLike = 1.0,
        overlap_m2: ArrayLike | None = None,
        friction: str = "coulomb",
        compiled: bool = True,
    ):
        self.count = int(in_range("count", count, 1, MAX_COUNT))
        self.system = system = BrakeSystem() if system is None else system
        one_of("reversal", system.reversal, ("clamped",))
        in_range("reservoir_f", system.drive.reservoir_f, 0.0, 0.0, "F")
        one_of("friction", friction, FRICTIONS)
        self._model = 0 if one_of("level", level, LEVELS) == "lagged" else 1 + FRICTIONS.index(friction)
        self.step_s = in_range("step_s", step_s, MIN_STEP_S, MAX_STEP_S, "s")
        self._every = max(1, round(CAPACITANCE_EVERY_S / self.step_s))
        self._steps = 0
        self._force = ForceTable(system, 0)
        self._table = self._force.array(0.0)
        self._tabled_v = 0.0
        full_m2 = system.overlap_m2(0)
        areas_m2 = self._each("overlap_m2", full_m2 if overlap_m2 is None else overlap_m2, 0.0, 1.0)
        if full_m2 <= 0.0:
            raise InputError("overlaps_m2 = 0 m2; the clutch that all others are scaled from needs more than 0 m2")
        # Laws are linear in overlap but for the off force, which stays; a clutch without overlap holds nothing.
        self._gain = self._each("force_gain", force_gain, 0.0, 10.0) * (areas_m2 > 0.0)
        self._share = areas_m2 / full_m2
        self._farad = system.capacitance_f(0) * self._share
        self._lost = np.divide(system.brake.width_m, areas_m2, out=np.zeros(self.count), where=areas_m2 > 0.0)
        self._set_v, self._hz, self._clamp = np.zeros(self.count), np.zeros(self.count), np.zeros(self.count)
        self._hands = np.zeros((self.count, 2))
        drive, contact = system.drive, system.contact
        self._limits = tuple(
            float(x) for x in (drive.output_resistance_ohm, drive.bleeder_ohm, drive.supply_current_a, drive.stray_f)
        )
        self._lag = (float(contact.tau_on_s), float(contact.tau_off_s))
        self._finger = finger_parameters(system.finger)
        self._state = np.zeros((self.count, loop.B_WIDTH))
        self._state[:, loop.B_FORCE] = self._gain * self._table[0]
        self._state[:, loop.B_FARAD] = self._farad
        self._state[:, loop.B_POLARITY] = 1.0
        self._state[:, loop.B_FROM] = self._state[:, loop.B_REVERSAL] = math.inf
        self._carry = loop.kernel("carry_bank", compiled)

    def drive(self, volts: ArrayLike, frequency_hz: ArrayLike) -> None:
        """From now on: a square wave on every clutch. See ``OutputStage.drive``.

        :param volts: amplitude (V), a number or (count,); 0 shorts a clutch.
        :param frequency_hz: of the wave (Hz), a number or (count,); 0: constant volts.
        :raises InputError: volts above the supply's or past breakdown, a frequency above the bridge's, anything not finite.
        """
        drive, s, now_s = self.system.drive, self._state, self.now_s
        set_v = self._each("volts", volts, 0.0, drive.supply_volts)
        self.system.check_volts(float(set_v.max()))
        hz = np.where(set_v > 0.0, self._each("frequency_hz", frequency_hz, 0.0, drive.bridge_hz), 0.0)
        on, was_on = set_v > 0.0, self._set_v > 0.0
        fresh = on & ~was_on
        anew = fresh | (on & (hz != self._hz))
        one_f, u = s[:, loop.B_FARAD], s[:, loop.B_VOLTS]
        # What is left on a clutch is shared with the bridge's stray capacitance.
        u[fresh] *= one_f[fresh] / np.maximum(one_f[fresh] + drive.stray_f, 1e-12)
        s[:, loop.B_FROM] = np.where(anew, now_s, np.where(on, s[:, loop.B_FROM], math.inf))
        # A wave too slow to count never turns.
        slow = np.where(hz > 1e-300, hz, 1e-300)
        quarter_s = np.where(hz > 0.0, 0.25 / slow, math.inf)
        s[:, loop.B_REVERSAL] = np.where(anew, now_s + quarter_s, np.where(on, s[:, loop.B_REVERSAL], math.inf))
        s[:, loop.B_POLARITY] = np.where(anew & (u * s[:, loop.B_POLARITY] < 0.0), -s[:, loop.B_POLARITY], s[:, loop.B_POLARITY])
        self._clamp = np.minimum(drive.clamp_s, 0.05 / slow)
        self._set_v, self._hz = set_v, hz
        highest_v = max(float(set_v.max()), float(np.abs(u).max()))
        if highest_v > self._tabled_v:
            self._table, self._tabled_v = self._force.array(highest_v), highest_v

    def move(self, position_m: ArrayLike, speed_m_s: ArrayLike = 0.0) -> None:
        """From now on every hand is at ``position + speed * (t - now)``.

        :param position_m: within 10 m, a number or (count,).
        :param speed_m_s: within 100 m/s, a number or (count,).
        :raises InputError: a number outside its range.
        """
        position_m = self._each("position_m", position_m, -10.0, 10.0)
        speed_m_s = self._each("speed_m_s", speed_m_s, -100.0, 100.0)
        self._hands = np.stack([position_m - speed_m_s * self.now_s, speed_m_s], axis=1)

    def step(self, steps: int = 1) -> None:
        """Carry every clutch through whole steps.

        :param steps: how many, 0 or more.
        :raises InputError: a negative number of steps.
        """
        steps = int(in_range("steps", steps, 0, 1e12))
        self._carry(
            self._state,
            self._steps,
            steps,
            self.step_s,
            self._every,
            self._set_v,
            self._hz,
            self._clamp,
            self._hands,
            self._limits,
            self._table,
            self._force.per_volt,
            self._gain,
            self._share,
            self._farad,
            self._lost,
            self._lag,
            self._finger,
            self._model,
        )
        self._steps += steps

    @property
    def now_s(self) -> float:
        """Time advanced to (s), 0 at first."""
        return self._steps * self.step_s

    @property
    def voltages_v(self) -> Floats:
        """(count,), volts, signed."""
        return self._state[:, loop.B_VOLTS].copy()

    @property
    def capacity_n(self) -> Floats:
        """(count,), what each clutch can hold now (N)."""
        return self._state[:, loop.B_FORCE].copy()

    @property
    def tension_n(self) -> Floats:
        """(count,), what is held (N)."""
        return self._state[:, loop.B_T].copy()

    @property
    def slip_m(self) -> Floats:
        """(count,), how far the strips were pulled apart (m)."""
        return self._state[:, loop.B_S].copy()

    @property
    def finger_m(self) -> Floats:
        """(count,), where the pulled ends are (m)."""
        return self._state[:, loop.B_Y].copy()

    def _each(self, name: str, values: ArrayLike, low: float, high: float) -> Floats:
        try:
            each = np.broadcast_to(np.asarray(values, dtype=np.float64), (self.count,)).copy()
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} is neither a number nor {self.count} numbers; must be {low:g} to {high:g}") from error
        wrong = ~((each >= low) & (each <= high))
        if wrong.any():
            raise InputError(f"{name} = {each[wrong][0]:g}; must be {low:g} to {high:g}")
        return each
