"""Coil and body of one tactor as two thermal nodes, for what one node cannot show: a coil that stays on.

::

    C_c T_c' = P - G (T_c - T_b)
    C_b T_b' = G (T_c - T_b) - T_b / c

``T_c``, ``T_b`` (K) are the rises of coil and body above the room, ``C_c``, ``C_b`` (J/K) their heat capacities, ``G`` (W/K)
couples them, ``c`` (K/W) is the body's resistance to the room, ``P`` (W) the mean electrical power over the step. At 18 W the
copper gains some 70 K in half a second while the body shows 0.25 K: no reading of the body protects a coil that is stuck on,
only a limit on time does.

The body follows ``c / ((1 + s t1)(1 + s t2))`` of the power. ``C_b`` is set so that ``t1 + t2 = tau``, the stated time
constant: under power that varies slowly the body is the one node of ``thermal``, with the same steady rise and the same mean
delay; what is left is of second order, ``t1 t2`` over the square of the time scale (at most 1.1 K of the 25 K of the
published run, a quarter of a minute after it begins).

The two nodes cannot be distinguished on the published curve. Its time constant is known to 5 s; a fit with noise that leaves that
much gains less than 2 in chi squared from the second node. Quieter readings of a single tactor could (0.5 K each
second would), and so ``C_c`` and ``G`` are assumptions to be measured. The curve was heated by switching, with whatever the warm
coil's greater resistance took off: ``c`` holds that already. Power that falls as the coil warms at fixed volts is left out,
because the network would no longer be linear and no step of it exact; power computed cold is the upper bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range


@dataclass(frozen=True)
class TwoNodeParameters(Parameters):
    """Coil and body of one tactor (thesis 3.5.2 for the body).

    ``coil_j_per_k``: the coil's 1.38 ohm in tracks of 220 um by six layers of 105 and two of 75 um (thesis 3.4.3) are 0.32 g of
    the tactor's 1.8 g, however many boards share them; at 385 J/(kg K) 0.125 J/K. ``coupling_w_per_k``: boards held by dry
    pressure over a footprint of 8 x 9.5 mm, 240 W/(m2 K).

    :raises InputError: a value outside its range, or a coil so large or so loosely coupled that no body is left:
        ``C_c (1/G + c) < tau`` must hold.
    """

    tau_s: float = parameter(102.0, "s", "stated", "thesis 3.5.2, +- 5 s", low=1e-3, high=1e6)
    c_k_per_w: float = parameter(69.0, "K/W", "stated", "thesis 3.5.2, +- 10 K/W", low=1e-6, high=1e6)
    coil_j_per_k: float = parameter(0.125, "J/K", "assumed", "copper alone, from resistance and tracks", low=1e-9, high=1e6)
    coupling_w_per_k: float = parameter(0.018, "W/K", "assumed", "dry contact of board and body", low=1e-9, high=1e6)

    def __post_init__(self) -> None:
        super().__post_init__()
        through_s = self.coil_j_per_k * (1.0 / self.coupling_w_per_k + self.c_k_per_w)
        if not through_s < self.tau_s:
            raise InputError(
                f"coil_j_per_k (1 / coupling_w_per_k + c_k_per_w) = {through_s:g} s leaves no heat capacity for the body; "
                f"must be less than tau_s = {self.tau_s:g} s"
            )

    @property
    def body_j_per_k(self) -> float:
        """``C_b = (tau - C_c (1/G + c)) / c``, from the sum of the two time constants."""
        return (self.tau_s - self.coil_j_per_k * (1.0 / self.coupling_w_per_k + self.c_k_per_w)) / self.c_k_per_w


TWO_NODE = TwoNodeParameters()
_SERIES_BELOW = 0.5
"""Below this ``rate * dt`` the divided difference is summed as a series; above, subtracting loses less than two bits."""


class TwoNodeHeat:
    """A coil and its body, advanced exactly at any step in closed form (see ``propagate``). State is float64 throughout.

    :param parameters: of the network.
    :param rise_k: the body's rise at the start (K).
    :param coil_rise_k: the coil's (K); the body's if None.
    :raises InputError: a rise that is not finite.
    """

    def __init__(self, parameters: TwoNodeParameters = TWO_NODE, rise_k: float = 0.0, coil_rise_k: float | None = None) -> None:
        self.parameters = parameters
        self._body_k = in_range("rise_k", rise_k, -math.inf, math.inf, "K")
        self._coil_k = in_range("coil_rise_k", rise_k if coil_rise_k is None else coil_rise_k, -math.inf, math.inf, "K")
        self._network = network(parameters)

    def advance(self, dt_s: float, power_w: float) -> None:
        """Carry both nodes over a step at constant power; any step is exact.

        :param dt_s: step (s), 0 or more.
        :param power_w: mean power over the step (W), 0 or more.
        :raises InputError: a negative step or power, or anything not finite; the rises then stay as they were, so that a clock
            which stepped back cannot cool the coil.
        """
        in_s = in_range("dt_s", dt_s, 0.0, math.inf, "s")
        in_w = in_range("power_w", power_w, 0.0, math.inf, "W")
        self._coil_k, self._body_k = propagate(self._coil_k, self._body_k, in_w, in_s, *self._network)

    @property
    def rise_k(self) -> float:
        """The body's rise above the room (K): what a thermocouple on the tactor reads."""
        return self._body_k

    @property
    def coil_rise_k(self) -> float:
        """The copper's rise above the room (K)."""
        return self._coil_k


def time_constants_s(parameters: TwoNodeParameters = TWO_NODE) -> tuple[float, float]:
    """The slow and the fast time constant of the body: real and distinct in every passive network; their sum is ``tau``.

    :param parameters: of the network.
    :return: slow and fast (s).
    """
    made = network(parameters)
    return 1.0 / made[5], 1.0 / made[4]


def network(p: TwoNodeParameters) -> tuple[float, ...]:
    """What ``propagate`` needs.

    The rates are the roots of ``r^2 - (x + y) r + (x y - z) = 0``, with ``x = G/C_c``, ``y = (G + 1/c)/C_b`` and
    ``z = G^2/(C_c C_b)``.

    :param p: of the network.
    :return: ``(C_c, C_b, G, 1/c, f, s, f - x, f - y)``, SI, with decay rates ``f > s`` (1/s).
    """
    coil, body, coupling, loss = p.coil_j_per_k, p.body_j_per_k, p.coupling_w_per_k, 1.0 / p.c_k_per_w
    x, y, z = coupling / coil, (coupling + loss) / body, coupling * coupling / (coil * body)
    width = math.hypot(x - y, 2.0 * math.sqrt(z))
    fast = 0.5 * (x + y + width)
    # Roots and differences that are small beside x and y come from a product, never from subtracting like numbers.
    above_larger = 2.0 * z / (width + abs(x - y))
    above_smaller = 0.5 * (width + abs(x - y))
    above = (above_larger, above_smaller) if x >= y else (above_smaller, above_larger)
    return coil, body, coupling, loss, fast, coupling * loss / (coil * body) / fast, *above


def propagate(
    coil_k: float,
    body_k: float,
    power_w: float,
    dt_s: float,
    coil: float,
    body: float,
    coupling: float,
    loss: float,
    fast: float,
    slow: float,
    above_coil: float,
    above_body: float,
) -> tuple[float, float]:
    """Rises of coil and body after ``dt_s``: ``T + M r``, ``r`` the rates of change now, ``M`` the integral of ``exp(A u)``.

    ``M = p_f I + D (A + f I)`` (Newton's form of a function of a 2x2 matrix), ``p_r = -expm1(-r dt)/r``,
    ``D = (p_s - p_f)/(f - s)``, ``f`` and ``s`` the fast and slow rate (1/s). Every entry is a sum of positive terms, so that a
    step of any length costs no more digits than the state has. Plain numbers and unchecked, so that numba can compile it.

    :param coil_k: the coil's rise now (K).
    :param body_k: the body's rise now (K).
    :param power_w: into the coil (W).
    :param dt_s: step (s), 0 or more.
    :param coil: ``C_c`` (J/K).
    :param body: ``C_b`` (J/K).
    :param coupling: ``G`` (W/K).
    :param loss: ``1/c`` (W/K).
    :param fast: ``f`` (1/s).
    :param slow: ``s`` (1/s).
    :param above_coil: ``f - x`` (1/s), see ``network``.
    :param above_body: ``f - y`` (1/s).
    :return: rises of coil and body after the step (K).
    """
    p_fast = -math.expm1(-fast * dt_s) / fast
    if fast * dt_s > _SERIES_BELOW:
        divided = (-math.expm1(-slow * dt_s) / slow - p_fast) / (fast - slow)
    else:
        # dt^2/2! - (f + s) dt^3/3! + (f^2 + f s + s^2) dt^4/4! ...: subtracting would lose what the body gains in a short step.
        term, slow_power, sums, divided = 0.5 * dt_s * dt_s, 1.0, 1.0, 0.0
        for order in range(3, 18):
            divided += term * sums
            slow_power *= slow * dt_s
            sums = sums * fast * dt_s + slow_power
            term /= -order
    into_body_w = coupling * (coil_k - body_k)
    coil_rate = (power_w - into_body_w) / coil
    body_rate = (into_body_w - loss * body_k) / body
    coil_gain_k = (p_fast + divided * above_coil) * coil_rate + divided * coupling / coil * body_rate
    body_gain_k = divided * coupling / body * coil_rate + (p_fast + divided * above_body) * body_rate
    return coil_k + coil_gain_k, body_k + body_gain_k
