"""Where tracked points will be a few tens of milliseconds on, and how far that guess may be off.

Two frames give a velocity, but a hand that swings or slows is off that line by ``a h^2/2``; the acceleration of the last frames
is mostly noise. So the acceleration is taken over a longer base and only a share of it is believed: more of what all
points of the hand do together (it is averaged over them, and the arm behind it is heavy), less of what one does by itself::

    x(h) = x + v h (1 - k h) + (g_c a_c + g_o a_o) (h^2 + h T)/2

with ``v`` over the latest ``T`` (at least 8 ms), which is the velocity of ``T/2`` ago, hence ``h T``; ``a_c`` the mean of the
accelerations of all points, ``a_o`` what is a point's own. The doubt is a standard deviation along any direction, such as an
object's normal::

    s(h) = A (h^2 + h T)/2 + s_0 (1 + h/T),    A^2 = (w_l |a|)^2 + (w_d |a' - a|)^2 + (w_r)^2 <|a'|^2>

``a'`` is the acceleration between the last two velocities and ``<>`` a mean over the last frames: a point is hard to foresee
if it accelerates, if its accelerations disagree, or if they did lately. How the constants were found:
``docs/explanation/onset.md``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.errors import InputError
from haptics.time import NS_PER_MS, NS_PER_S

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PredictionParameters:
    """The constants of the two equations above; defaults fitted on recorded hands.

    :param damping_per_s: ``k``, 1/s: how fast a velocity is taken to fade.
    :param common_gain: ``g_c``, share of the mean acceleration that is believed.
    :param own_gain: ``g_o``, share of a point's own acceleration that is believed.
    :param level_weight: ``w_l``, weight of the acceleration in the doubt.
    :param disagreement_weight: ``w_d``, weight of the change of acceleration in the doubt.
    :param recent_weight: ``w_r``, weight of the last frames' accelerations in the doubt.
    :param noise_m: ``s_0``, standard deviation of a tracked point, metres.
    """

    velocity_span_ns: int = 8 * NS_PER_MS
    """Least time a velocity is taken over; closer frames are merged, so that noise over time does not grow with the rate."""
    acceleration_span_ns: int = 24 * NS_PER_MS
    """Least time between the middles of the two velocities of ``a``."""
    recent_ns: int = 45 * NS_PER_MS
    """How far ``<>`` looks back."""
    longest_gap_ns: int = 50 * NS_PER_MS
    """After a longer gap all frames before it are forgotten."""
    damping_per_s: float = 1.5
    common_gain: float = 0.64
    own_gain: float = 0.43
    level_weight: float = 0.2
    disagreement_weight: float = 0.2
    recent_weight: float = 0.15
    noise_m: float = 0.12e-3


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """The near future as one frame shows it. Points have d coordinates: 3 for places, 1 for a scalar signal in metres.

    :param time_ns: when the frame was sampled.
    :param position_m: (n, d); not finite where a point was not seen.
    :param velocity_m_s: (n, d), over the last ``span_s``.
    :param acceleration_m_s2: (n, d), the believed share of it.
    :param doubt_m_s2: (n,), ``A``.
    :param span_s: ``T``, s.
    :param damping_per_s: ``k``, 1/s; 0 where nothing is known but the last pose.
    :param noise_m: ``s_0``, metres.
    """

    time_ns: int
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    doubt_m_s2: Floats
    span_s: float
    damping_per_s: float
    noise_m: float

    def path(self, ahead_s: Floats, points: NDArray[np.intp] | slice = slice(None)) -> Floats:
        """Forecast positions.

        :param ahead_s: (k,), seconds after the frame.
        :param points: which of the n points; default all.
        :return: (points, k, d), metres.
        """
        along_s = ahead_s * (1.0 - self.damping_per_s * ahead_s)
        return (
            self.position_m[points, None]
            + self.velocity_m_s[points, None] * along_s[:, None]
            + self.acceleration_m_s2[points, None] * self._bend_s2(ahead_s)[:, None]
        )

    def deviation(self, ahead_s: Floats) -> Floats:
        """Standard deviation of the forecast positions along any direction.

        :param ahead_s: (k,), seconds after the frame.
        :return: (n, k), metres.
        """
        return self.doubt_m_s2[:, None] * self._bend_s2(ahead_s) + self.noise_m * (1.0 + ahead_s / self.span_s)

    def reach_m(self, ahead_s: float) -> Floats:
        """How far each point gets at most.

        :param ahead_s: within this time, s, after the frame.
        :return: (n,), metres.
        """
        speed = np.sqrt(np.einsum("nd,nd->n", self.velocity_m_s, self.velocity_m_s))
        bend = np.sqrt(np.einsum("nd,nd->n", self.acceleration_m_s2, self.acceleration_m_s2))
        return speed * ahead_s + bend * (0.5 * ahead_s * (ahead_s + self.span_s))

    def _bend_s2(self, ahead_s: Floats) -> Floats:
        return 0.5 * ahead_s * (ahead_s + self.span_s)


@dataclass(frozen=True, slots=True, eq=False)
class _Velocity:
    middle_ns: int
    end_ns: int
    velocity_m_s: Floats
    squared_change: Floats | None  # |a'|^2, (n,)


class Predictor:
    """Frames of one hand in, forecasts out. Until there is an acceleration (24 ms or more), the last pose is the forecast.

    :param parameters: constants of the forecast; None: as shipped.
    """

    def __init__(self, parameters: PredictionParameters | None = None):
        self._p = parameters or PredictionParameters()
        self._frames: deque[tuple[int, Floats]] = deque()
        self._velocities: deque[_Velocity] = deque()

    def forget(self) -> None:
        """Begin anew, as when another hand comes."""
        self._frames.clear()
        self._velocities.clear()

    def observe(self, time_ns: int, position_m: ArrayLike) -> Forecast | None:
        """Take a frame.

        :param time_ns: when it was sampled.
        :param position_m: (n, d), metres; a row with a number that is not finite is a point that was not seen.
        :return: the forecast from it, or None if it is not later than the one before.
        :raises InputError: not two-dimensional, or another shape than before.
        """
        position = np.array(position_m, dtype=float)
        if position.ndim != 2 or (self._frames and position.shape != self._frames[-1][1].shape):
            wanted = self._frames[-1][1].shape if self._frames else "(points, coordinates)"
            raise InputError(f"position_m has shape {position.shape}; expected {wanted}, metres")
        if self._frames:
            elapsed_ns = time_ns - self._frames[-1][0]
            if elapsed_ns <= 0:
                return None
            if elapsed_ns > self._p.longest_gap_ns:
                self.forget()
        earlier = next((frame for frame in reversed(self._frames) if time_ns - frame[0] >= self._p.velocity_span_ns), None)
        self._frames.append((time_ns, position))
        while len(self._frames) > 1 and time_ns - self._frames[1][0] >= self._p.longest_gap_ns:
            self._frames.popleft()
        if earlier is None:
            return self._still(time_ns, position)
        return self._moving(time_ns, position, *earlier)

    def _moving(self, time_ns: int, position: Floats, earlier_ns: int, earlier_position: Floats) -> Forecast:
        p, span_s = self._p, (time_ns - earlier_ns) / NS_PER_S
        velocity = (position - earlier_position) / span_s
        middle_ns = (time_ns + earlier_ns) // 2
        short = self._velocity_before(middle_ns - p.velocity_span_ns)
        long = self._velocity_before(middle_ns - p.acceleration_span_ns)
        if short is None:
            self._velocities.append(_Velocity(middle_ns, time_ns, velocity, None))
            return self._still(time_ns, position)
        latest = (velocity - short.velocity_m_s) * (NS_PER_S / (middle_ns - short.middle_ns))
        squared = np.einsum("nd,nd->n", latest, latest)
        self._velocities.append(_Velocity(middle_ns, time_ns, velocity, squared))
        kept_ns = min(time_ns - p.recent_ns, middle_ns - p.acceleration_span_ns)
        while self._velocities[1].middle_ns <= kept_ns:
            self._velocities.popleft()
        if long is None:
            return self._still(time_ns, position)

        steady = (velocity - long.velocity_m_s) * (NS_PER_S / (middle_ns - long.middle_ns))
        seen = np.isfinite(steady).all(axis=1)
        common = steady[seen].mean(axis=0) if seen.any() else np.zeros(position.shape[1])
        recent = [v.squared_change for v in self._velocities if v.squared_change is not None and time_ns - v.end_ns < p.recent_ns]
        lately = sum(recent) / len(recent)
        level = np.einsum("nd,nd->n", steady, steady)
        disagreement = np.einsum("nd,nd->n", latest - steady, latest - steady)
        doubt = np.sqrt(p.level_weight**2 * level + p.disagreement_weight**2 * disagreement + p.recent_weight**2 * lately)
        bending = p.own_gain * steady + (p.common_gain - p.own_gain) * common
        return Forecast(time_ns, position, velocity, bending, doubt, span_s, p.damping_per_s, p.noise_m)

    def _velocity_before(self, middle_ns: int) -> _Velocity | None:
        return next((v for v in reversed(self._velocities) if v.middle_ns <= middle_ns), None)

    def _still(self, time_ns: int, position: Floats) -> Forecast:
        zero = np.zeros_like(position)
        return Forecast(time_ns, position, zero, zero, zero[:, 0], self._p.velocity_span_ns / NS_PER_S, 0.0, self._p.noise_m)
