"""The edges of a brake's force: steps laid over each other at the moment of their volts, and where they pass a level.

A sample is the force at its own time; the host knows that time from when the sample's line came, less the latency that is
assumed for the load cell. Times of an edge carry that latency's uncertainty; the time between two points of an edge does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from haptics.errors import InputError
from haptics.physics.brake.charging import DRIVE
from rigs.fitting import Vector, quadrature
from rigs.instruments import Samples
from rigs.instruments.loadcell import GAIN_SD, LATENCY_S, LATENCY_SD_S
from rigs.result import Quantity

LOW, HIGH = 0.1, 0.9
CLOCK_SD_S = 0.1e-3
"""Between the board's clock and the host's (assumed; the link knows it better)."""
_NEAREST = 12
"""Samples about a crossing, of all steps together."""
_HELD_S = (0.05, 0.11)
"""Since volts on: the force has risen, and falls with the overlap only."""
_LAST_S = 10e-3
_DRAG_S = 20e-3
_MIN_N = 1.0
_AFTER_S = 0.15


@dataclass(frozen=True)
class Step:
    """One step. Times are on the bench's clock.

    :param rest_ns: start of the rest before it, ns.
    :param moved_ns: when the move was sent, ns.
    :param on_ns: volts on, ns.
    :param off_ns: volts off, ns.
    :param end_ns: until then the stage pulls, ns.
    """

    rest_ns: int
    moved_ns: int
    on_ns: int
    off_ns: int
    end_ns: int


@dataclass(frozen=True)
class ResponseRecord:
    """Force while the steps ran. Times are on the bench's clock.

    :param force: as read, N.
    :param rest_ns: start and end of the first rest, ns.
    :param loading_ns: start and end of the slow pull of a brake that holds, ns.
    :param steps: in their order.
    :param pull_m_s: speed of the stage in the steps, m/s.
    :param capacitance_f: of the output by the board's self test, F.
    """

    force: Samples
    rest_ns: tuple[int, int]
    loading_ns: tuple[int, int]
    steps: tuple[Step, ...]
    pull_m_s: float
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
        since_s = self.force.since(from_ns) - LATENCY_S
        here = (since_s >= 0.0) & (since_s < (to_ns - from_ns) / 1e9)
        return since_s[here], self.force.column()[here]

    def zero_n(self, step: Step) -> float:
        """What is read while the strips hang loose before a step.

        :param step: one of ``steps``.
        :return: N.
        """
        return float(self.raw(step.rest_ns, step.moved_ns)[1].mean())

    def since_on(self, step: Step) -> tuple[Vector, Vector]:
        """Seconds since volts on and force, until volts off.

        :param step: one of ``steps``.
        :return: times (n,), s, and forces (n,), N, less the zero.
        """
        seconds, force_n = self.raw(step.on_ns, step.off_ns)
        return seconds, force_n - self.zero_n(step)

    def since_off(self, step: Step) -> tuple[Vector, Vector]:
        """Seconds since volts off and force, for as long as the stage surely pulls.

        :param step: one of ``steps``.
        :return: times (n,), s, and forces (n,), N, less the zero.
        """
        seconds, force_n = self.raw(step.off_ns, min(step.end_ns, step.off_ns + round(_AFTER_S * 1e9)))
        return seconds, force_n - self.zero_n(step)

    def held(self) -> tuple[Vector, Vector]:
        """Way slid since volts on, and force, of all steps while they hold.

        :return: travel (n,), m, ascending, and forces (n,), N.
        """
        parts = [self.since_on(one) for one in self.steps]
        seconds, force_n = (np.concatenate(column) for column in zip(*parts, strict=True))
        held = (seconds > _HELD_S[0]) & (seconds < _HELD_S[1])
        order = np.argsort(seconds[held])
        return self.pull_m_s * seconds[held][order], force_n[held][order]

    def drag_n(self, noise_n: float) -> tuple[float, float]:
        """Mean force of the free strips just before volts come, and its standard deviation.

        :param noise_n: standard deviation of one sample, N.
        :return: mean and standard deviation, N.
        """
        parts = [self.raw(one.on_ns - round(_DRAG_S * 1e9), one.on_ns)[1] - self.zero_n(one) for one in self.steps]
        force_n = np.concatenate(parts)
        return float(force_n.mean()), noise_n / len(force_n) ** 0.5

    def loaded_n(self) -> float:
        """Maximum force of the slow pull.

        :return: N, less the zero.
        """
        return float(self.raw(*self.loading_ns)[1].max() - self.raw(*self.rest_ns)[1].mean())

    def loading_n_s(self, faster: float) -> float:
        """Rate at which held strips are loaded at ``faster`` times the speed of the slow pull; 0 if that shows no rise.

        :param faster: speed over that of the slow pull.
        :return: N/s.
        """
        seconds, force_n = self.raw(*self.loading_ns)
        force_n = force_n - self.raw(*self.rest_ns)[1].mean()
        max_n = float(force_n.max())
        first = int(np.argmax(force_n > 0.2 * max_n))
        last = int(np.argmax(force_n > 0.8 * max_n))
        if last - first < 2 or max_n < _MIN_N:
            return 0.0
        return faster * float(np.polyfit(seconds[first:last], force_n[first:last], 1)[0])


@dataclass(frozen=True)
class Crossing:
    """When all steps together pass a level.

    :param at_s: time since volts on or off, s.
    :param sd_s: its standard deviation, s.
    :param scatter_s: of single samples about the edge, s.
    """

    at_s: float
    sd_s: float
    scatter_s: float


@dataclass(frozen=True)
class ResponseFit:
    """Edges of all steps, as shares of each step's force, and where they pass 10 and 90 %.

    :param rise: times since volts on (n,), s, and shares (n,).
    :param fall: times since volts off (n,), s, and shares (n,).
    :param force_n: mean over the steps of the maximum force, N.
    :param begun: 10 % of the rise.
    :param response: 90 % of the rise.
    :param release: 10 % of the fall.
    """

    rise: tuple[Vector, Vector]
    fall: tuple[Vector, Vector]
    force_n: float
    begun: Crossing
    response: Crossing
    release: Crossing

    @property
    def rise_s(self) -> float:
        """From 10 to 90 %."""
        return self.response.at_s - self.begun.at_s

    @property
    def rise_sd_s(self) -> float:
        """Standard deviation of ``rise_s``, s."""
        return quadrature((self.begun.sd_s, self.response.sd_s))

    def quantities(self) -> dict[str, Quantity]:
        """What the rig is for.

        :return: by name, in SI units.
        """
        slew_n_s = (HIGH - LOW) * self.force_n / self.rise_s
        timing_s = (LATENCY_SD_S, CLOCK_SD_S)
        return {
            "response_s": Quantity(self.response.at_s, quadrature((self.response.sd_s, *timing_s)), "s"),
            "release_s": Quantity(self.release.at_s, quadrature((self.release.sd_s, *timing_s)), "s"),
            "rise_s": Quantity(self.rise_s, self.rise_sd_s, "s"),
            "slew_n_s": Quantity(slew_n_s, slew_n_s * quadrature((self.rise_sd_s / self.rise_s, GAIN_SD)), "N/s"),
        }

    def notes(self, volts: float, capacitance_f: float, loading_n_s: float) -> tuple[str, ...]:
        """What limits the times.

        :param volts: of a step, V.
        :param capacitance_f: of the output, F.
        :param loading_n_s: rate at which the frame loads held strips, N/s.
        :return: sentences for the page.
        """
        charging_s = (capacitance_f + DRIVE.stray_f) * volts / DRIVE.supply_current_a
        limit_ua = 1e6 * DRIVE.supply_current_a
        return (
            f"Charging {capacitance_f * 1e9:.2f} nF to {volts:g} V takes {1e3 * charging_s:.1f} ms at {limit_ua:g} uA, contact "
            f"the rest; the frame loads held strips with {loading_n_s:.0f} N/s at most. Released, the bridge empties the brake "
            "in well below a millisecond; what takes its time then is the contact.",
            "Times count from when the board switches, 3 ms after the host's command.",
        )


def fit_response(record: ResponseRecord) -> ResponseFit:
    """Lay all steps over each other.

    :param record: of a whole run.
    :return: both edges and their crossings.
    :raises InputError: too few samples on an edge.
    """
    rises: list[tuple[Vector, Vector]] = []
    falls: list[tuple[Vector, Vector]] = []
    max_n: list[float] = []
    for one in record.steps:
        seconds, force_n = record.since_on(one)
        smooth_n = np.convolve(force_n, np.full(3, 1.0 / 3.0), "valid")
        top = int(np.argmax(smooth_n)) + 1
        max_n.append(float(smooth_n.max()))
        rises.append((seconds[: top + 1], force_n[: top + 1] / max_n[-1]))
        before_n = float(force_n[seconds > seconds[-1] - _LAST_S].mean())
        off_s, falling_n = record.since_off(one)
        falls.append((off_s, falling_n / before_n))
    rise, fall = _together(rises), _together(falls)
    return ResponseFit(rise, fall, float(np.mean(max_n)), crossing(*rise, LOW), crossing(*rise, HIGH), crossing(*fall, LOW))


def crossing(seconds: Vector, share: Vector, level: float) -> Crossing:
    """When ``share`` passes ``level``: time as a parabola of the share through the samples nearest to it.

    :param seconds: of the samples (n,), s.
    :param share: of the force (n,).
    :param level: share to find.
    :return: the moment, with its uncertainty.
    :raises InputError: fewer than 12 samples.
    """
    if len(seconds) < _NEAREST:
        raise InputError(f"{len(seconds)} samples on an edge; at least {_NEAREST} are needed")
    near = np.argsort(np.abs(share - level))[:_NEAREST]
    (*_, at_s), covariance = np.polyfit(share[near] - level, seconds[near], 2, cov=True)
    fitted_s = np.polyval(np.polyfit(share[near] - level, seconds[near], 2), share[near] - level)
    scatter_s = float(np.std(seconds[near] - fitted_s, ddof=3))
    # What an edge does between two samples is not seen.
    unseen_s = float(np.ptp(seconds[near])) / (_NEAREST - 1) / 12.0**0.5
    return Crossing(float(at_s), quadrature((float(np.sqrt(covariance[2, 2])), unseen_s)), scatter_s)


def _together(parts: Sequence[tuple[Vector, Vector]]) -> tuple[Vector, Vector]:
    """All samples of all steps, in time."""
    seconds, share = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(seconds)
    return seconds[order], share[order]
