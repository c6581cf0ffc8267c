"""Many tactors at once: from one glove's fifteen to the fifteen thousand of a thousand gloves, as arrays.

The same models as ``latch_plant``, level ``dynamic`` or ``table``, in one compiled loop: for sweeps, tolerance studies and
populations, where a Python object for each tactor would cost more than its physics.

>>> bank = LatchBank(15)
>>> bank.drive(0.0, 5.0)
>>> bank.drive(0.010, 0.0)
>>> bank.advance(0.5)
>>> bool((bank.latched == 1).all())
True
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.physics.latch.dynamic import STEP_S
from haptics.physics.latch.flow_map import flow_table
from haptics.physics.latch.kernel import kernel_parameters
from haptics.physics.latch.parameters import LATCH, LatchParameters
from haptics.physics.latch.plant import beyond_stop
from haptics.physics.latch.table import wells
from haptics.units import in_range, one_of

LEVELS = ("table", "dynamic")
Floats = NDArray[np.float64]


class LatchBank:
    """``count`` tactors at rest, to be driven through time together.

    All share ``parameters`` but for ``resistance_ohm`` (a number, or one each). Times are seconds since the bank was made and
    never go back. Bounces after a landing are followed as in ``TableLatch``.

    :param count: tactors, 1 to 10 million.
    :param level: table or dynamic.
    :param parameters: shared by all.
    :param resistance_ohm: of each coil at room temperature (ohm), a number or (count,), more than 0; the parameters' by default.
    :param latched: ``off`` or ``on``, where all begin.
    :param step_s: of what is stepped (s), 1 us to 1 ms.
    :raises InputError: a count outside 1 to 10 million, an unknown level or state, a resistance that is not positive.
    """

    def __init__(
        self,
        count: int,
        level: str = "table",
        parameters: LatchParameters = LATCH,
        resistance_ohm: ArrayLike | None = None,
        latched: str = "off",
        step_s: float = STEP_S,
    ):
        from haptics.physics.latch import bank_kernel as loop

        self._loop = loop
        count = int(in_range("count", count, 1, 1e7))
        table = flow_table(parameters) if one_of("level", level, LEVELS) == "table" else None
        side = 1.0 if one_of("latched", latched, ("off", "on")) == "on" else -1.0
        self.parameters = parameters
        self._step_s = in_range("step_s", step_s, 1e-6, 1e-3, "s")
        self._now_s = 0.0
        self._ohms = self._each("resistance_ohm", parameters.resistance_ohm if resistance_ohm is None else resistance_ohm, count)
        if not (self._ohms > 0.0).all():
            raise InputError(f"resistance_ohm = {self._ohms.min():g} ohm; expected more than 0 ohm")
        none = np.zeros((0, 4, 4, 2))
        self._model = (
            self._step_s,
            float(parameters.near_stop_m),
            kernel_parameters(parameters),
            (1.0, 1.0, 1.0, 1.0) if table is None else table.grid,
            none if table is None else table.nodes,
            wells(parameters),
        )
        self._state = np.zeros((count, loop.WIDTH))
        self._seen = np.full((count, 4), math.nan)
        self._seen[:, loop.ARRIVALS] = 0.0
        self._state[:, loop.LANDED] = math.nan
        self._state[:, loop.OHMS] = self._ohms
        self._state[:, loop.X] = parameters.stroke_m if side > 0 else 0.0
        self._state[:, loop.TOUCHING] = self._state[:, loop.LAST] = side
        for row in self._state:
            loop.rest(row, self._model[2])

    def drive(self, time_s: float, volts: ArrayLike, rise_k: ArrayLike = 0.0) -> None:
        """From ``time_s`` on, volts on the terminals.

        :param time_s: when (s), not before the time advanced to.
        :param volts: a number or (count,), within 1 kV; positive toward the skin; 0 shorts the coil.
        :param rise_k: the coils' rise above the room (K), a number or (count,).
        :raises InputError: time going back, anything not finite, more than 1 kV, a rise that leaves no resistance, or (here or in
            ``advance``) volts that press a pin deeper into a stop than the forces are known for.
        """
        count = len(self._state)
        each_v = self._each("volts", volts, count)
        if (np.abs(each_v) > 1e3).any():
            raise InputError(f"volts = {each_v[np.abs(each_v).argmax()]:g} V; must be -1000 to 1000 V")
        ohms = self._ohms * (1.0 + self.parameters.resistance_per_k * self._each("rise_k", rise_k, count))
        if not (ohms > 0.0).all():
            raise InputError(f"rise_k makes a coil's resistance {ohms.min():g} ohm; it must stay positive")
        self._forward(time_s)
        self._loop.drive(self._state, self._seen, self._now_s, each_v, ohms, *self._model)
        self._check_depth()

    def advance(self, to_s: float) -> None:
        """Carry every tactor to a time.

        :param to_s: time (s), not before the time advanced to.
        :raises InputError: time going back, or a pin pressed too deep, as in ``drive``.
        """
        self._forward(to_s)
        self._loop.carry(self._state, self._seen, self._now_s, *self._model)
        self._check_depth()

    @property
    def position_m(self) -> Floats:
        """(count,), m, up to a step (half a millisecond in flight at level ``table``) before the time advanced to."""
        return self._state[:, self._loop.X].copy()

    @property
    def energy_j(self) -> Floats:
        """(count,), electrical energy taken since the beginning (J)."""
        s, loop = self._state, self._loop
        resting = np.where(s[:, loop.RESTS] != 0.0, self._now_s - s[:, loop.FROM] - s[:, loop.TIME], 0.0)
        return s[:, loop.ENERGY] + s[:, loop.VOLTS] * (s[:, loop.CHARGE] + s[:, loop.VOLTS] / s[:, loop.OHMS] * resting)

    @property
    def latched(self) -> NDArray[np.int8]:
        """(count,), 1 on, -1 off, 0 between; as ``position_m``."""
        x, p = self._state[:, self._loop.X], self.parameters
        return np.where(x > p.stroke_m - p.near_stop_m, 1, np.where(x < p.near_stop_m, -1, 0)).astype(np.int8)

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """(count,), whether the pin rests."""
        return self._state[:, self._loop.RESTS] != 0.0

    @property
    def reached_skin_s(self) -> Floats:
        """(count,), when the skin stop was last reached (s); nan if never."""
        return self._seen[:, self._loop.SKIN_S].copy()

    @property
    def reached_off_s(self) -> Floats:
        """(count,), when the off stop was last reached (s); nan if never."""
        return self._seen[:, self._loop.OFF_S].copy()

    @property
    def impact_m_s(self) -> Floats:
        """(count,), speed at the last stop reached (m/s), positive toward the skin; nan if none."""
        return self._seen[:, self._loop.IMPACT].copy()

    @property
    def arrivals(self) -> NDArray[np.int64]:
        """(count,), how many times a stop was reached."""
        return self._seen[:, self._loop.ARRIVALS].astype(np.int64)

    def _forward(self, to_s: float) -> None:
        if not to_s >= self._now_s or math.isinf(to_s):
            raise InputError(
                f"time = {to_s!r} s lies before the bank's {self._now_s!r} s or never comes; time only moves forward"
            )
        self._now_s = float(to_s)

    def _check_depth(self) -> None:
        lost = np.isnan(self._state[:, self._loop.X])
        if lost.any():
            raise beyond_stop(self.parameters, float(self._state[lost, self._loop.VOLTS][0]))

    @staticmethod
    def _each(name: str, values: ArrayLike, count: int) -> Floats:
        try:
            each = np.broadcast_to(np.asarray(values, dtype=np.float64), (count,)).copy()
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} is neither a number nor {count} numbers") from error
        if not np.isfinite(each).all():
            raise InputError(f"{name} holds {each[~np.isfinite(each)][0]}; expected finite numbers")
        return each
