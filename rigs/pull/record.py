"""What a pull tester recorded of one brake: the pulls, the rests between them, and the force with its zero taken off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigs.fitting import Vector, quadrature
from rigs.instruments import Samples


@dataclass(frozen=True)
class OnePull:
    """One pull. Times are on the bench's clock.

    :param volts: amplitude, V.
    :param slow: the published pull at 1 mm/s; False is the fast one.
    :param speed_m_s: of the stage, m/s.
    :param rest_ns: start of the rest before it, ns.
    :param moved_ns: when the move was sent, ns.
    :param until_ns: end of the samples to use, ns.
    """

    volts: float
    slow: bool
    speed_m_s: float
    rest_ns: int
    moved_ns: int
    until_ns: int


@dataclass(frozen=True)
class PullRecord:
    """All pulls of one brake and the force while they ran; the stage went home after each.

    :param force: as read, N.
    :param pulls: in the order they were made.
    :param end_ns: end of the last rest on the bench's clock, ns.
    :param travel_m: travel of each pull, m.
    :param capacitance_f: of the output by the board's self test, F.
    """

    force: Samples
    pulls: tuple[OnePull, ...]
    end_ns: int
    travel_m: float
    capacitance_f: float

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return (len(self.force.time_s) - 1) / float(self.force.time_s[-1] - self.force.time_s[0])

    def raw(self, from_ns: int, to_ns: int) -> tuple[Vector, Vector]:
        """Seconds since ``from_ns`` and force as read, until ``to_ns``.

        :param from_ns: start on the bench's clock, ns.
        :param to_ns: end on the bench's clock, ns; samples there are left out.
        :return: times (n,), s, and forces (n,), N.
        """
        since_s = self.force.since(from_ns)
        here = (since_s >= 0.0) & (since_s < (to_ns - from_ns) / 1e9)
        return since_s[here], self.force.column()[here]

    def rest_force_n(self) -> Vector:
        """Force as read in the first rest, which is the longest.

        :return: (n,), N.
        """
        first = self.pulls[0]
        return self.raw(first.rest_ns, first.moved_ns)[1]

    @cached_property
    def _rests(self) -> list[tuple[int, int]]:
        """Beginning and end of each rest: one before every pull, and the last."""
        first = self.pulls[0]
        last = (self.end_ns - (first.moved_ns - first.rest_ns), self.end_ns)
        return [*((one.rest_ns, one.moved_ns) for one in self.pulls), last]

    @cached_property
    def _zeros(self) -> tuple[Vector, Vector]:
        """The middle of each rest, in seconds from the first pull's, and what was read then, with the strips loose."""
        start_ns = self.pulls[0].rest_ns
        at_s = [((low + high) / 2 - start_ns) / 1e9 for low, high in self._rests]
        return np.array(at_s), np.array([self.raw(low, high)[1].mean() for low, high in self._rests])

    def zero_sd_n(self, pull: OnePull, noise_n: float, seconds: float) -> float:
        """Standard deviation of the zero, so long after the pull's move: that of the rests about it, each with its weight.

        :param pull: one of ``pulls``.
        :param noise_n: standard deviation of one sample, N.
        :param seconds: since its move was sent, s.
        :return: N.
        """
        at = self.pulls.index(pull)
        samples = [len(self.raw(low, high)[0]) for low, high in self._rests[at : at + 2]]
        before_s, after_s = self._zeros[0][at : at + 2]
        since_s = (pull.moved_ns - self.pulls[0].rest_ns) / 1e9 + seconds - before_s
        later = since_s / (after_s - before_s)
        return noise_n * quadrature([(1.0 - later) * samples[0] ** -0.5, later * samples[1] ** -0.5])

    def of(self, pull: OnePull) -> tuple[Vector, Vector]:
        """Seconds since its move was sent, and force less the zero, which is taken from the rests before and after.

        :param pull: one of ``pulls``.
        :return: times (n,), s, and forces (n,), N.
        """
        seconds, force_n = self.raw(pull.moved_ns, pull.until_ns)
        at_s, zero_n = self._zeros
        later_s = (pull.moved_ns - self.pulls[0].rest_ns) / 1e9
        return seconds, force_n - np.interp(seconds + later_s, at_s, zero_n)
