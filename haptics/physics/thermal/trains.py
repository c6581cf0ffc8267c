"""Closed forms for periodic trains of pulses: what rise they lead to, and how many a limit leaves room for.

Every pulse (a switch, or a whole burst) is an instantaneous jump ``J = E c / tau``; between pulses the rise falls by
``q = exp(-spacing/tau)``. Pulse ``k`` (counted from 0, the first at time 0, from rise ``r0``) ends at
``r0 q^k + J (1 - q^(k+1)) / (1 - q)``. A pulse is admitted if the rise right after its jump is within the limit, with a
relative guard of 1e-12 so that a limit met exactly is not lost to rounding; one that is denied is dropped whole, and
nothing is held in reserve (that is the scheduler's business).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.thermal.one_node import (
    MEASURED_RISE_K,
    PULSE_POWER_W,
    PULSE_S,
    THERMAL,
    ThermalParameters,
    burst_energy_j,
    pulse_rise_k,
)
from haptics.units import in_range

MINUTES_MAX = 10_080.0
"""A week: admission is walked run by run, and nothing about a tactor changes after a few time constants."""
GUARD = 1e-12
"""Relative slack on a limit: rounding in the closed forms is below it, any physical meaning far above."""


@dataclass(frozen=True)
class TrainPrediction:
    """What a periodic train does to the rise.

    Mean, peak and trough describe the train as asked, every pulse played: over one period in steady state or, if ``after_s`` was
    given, over the period that is under way then (that of the last pulse at or before ``after_s``). Denied and admitted pulses
    are those of the same train under ``limit_k``.

    :param energy_j: of a pulse (J).
    :param jump_k: rise that a pulse adds (K).
    :param spacing_s: from pulse to pulse (s).
    :param mean_power_w: of the train as asked (W).
    :param mean_rise_k: over the period (K).
    :param peak_rise_k: after a pulse (K).
    :param trough_rise_k: before the next (K).
    :param after_s: time that was asked for (s), None: for ever.
    :param asked: pulses at or before ``after_s``, None without it.
    :param limit_k: limit that was given (K), or None.
    :param first_denied_index: of the first pulse denied, from 0; None without a limit, or where none is denied.
    :param first_denied_s: its time (s).
    :param admitted: pulses admitted at or before ``after_s``, None without it or a limit.
    :param max_rate_per_min: fastest endless train under the limit (1/min): the minimum sustainable spacing, as a rate.
    :param extrapolated: what is hotter than was measured, in a sentence; empty if nothing is.
    """

    energy_j: float
    jump_k: float
    spacing_s: float
    mean_power_w: float
    mean_rise_k: float
    peak_rise_k: float
    trough_rise_k: float
    after_s: float | None
    asked: int | None
    limit_k: float | None
    first_denied_index: int | None
    first_denied_s: float | None
    admitted: int | None
    max_rate_per_min: float | None
    extrapolated: tuple[str, ...]


def predict_thermal(
    rate_per_min: float | None = None,
    pulse_s: float = PULSE_S,
    limit_k: float | None = None,
    minutes: float | None = None,
    *,
    burst_s: float | None = None,
    burst_hz: float = 200.0,
    every_s: float | None = None,
    power_w: float = PULSE_POWER_W,
    start_rise_k: float = 0.0,
    parameters: ThermalParameters = THERMAL,
) -> TrainPrediction:
    """What a train of switches at ``rate_per_min``, or of bursts ``every_s``, does to one tactor (thesis 3.5.2).

    :param rate_per_min: switches a minute, each of ``power_w * pulse_s``; or None, and ``burst_s`` with ``every_s`` given.
    :param pulse_s: coil time of a switch (s), at most the spacing.
    :param limit_k: limit of the rise for admission (K), more than 0.
    :param minutes: rise and counts after this time (min), at most a week; for ever if None.
    :param burst_s: length of each burst (s); its energy is ``burst_energy_j(burst_s, burst_hz)``.
    :param burst_hz: cycles a second within a burst (Hz).
    :param every_s: from burst to burst (s), at least ``burst_s``.
    :param power_w: of a coil that is on (W).
    :param start_rise_k: rise at first (K).
    :param parameters: of the body.
    :return: the prediction.
    :raises InputError: neither or both kinds of train, or a number outside its range.
    """
    bursts = None if burst_s is None or every_s is None else (burst_s, every_s)
    if (rate_per_min is None) == (bursts is None):
        raise InputError("a train is either rate_per_min, or burst_s together with every_s; got neither or both")
    if bursts is None:
        assert rate_per_min is not None
        spacing_s = 60.0 / in_range("rate_per_min", rate_per_min, 1e-9, 1e9, "1/min")
        energy_j = in_range("power_w", power_w, 0.0, math.inf, "W") * in_range("pulse_s", pulse_s, 0.0, spacing_s, "s")
    else:
        spacing_s = in_range("every_s", bursts[1], max(bursts[0], 1e-9), math.inf, "s")
        energy_j = burst_energy_j(bursts[0], burst_hz, power_w=power_w)
    jump_k = pulse_rise_k(energy_j, parameters)
    after_s = None if minutes is None else 60.0 * in_range("minutes", minutes, 0.0, MINUTES_MAX, "min")
    asked = None if after_s is None else math.floor(after_s / spacing_s * (1 + GUARD)) + 1
    peak_k, mean_k, trough_k = train_rise_k(jump_k, spacing_s, None if asked is None else asked - 1, start_rise_k, parameters)
    denied = admitted = fastest = None
    if limit_k is not None:
        in_range("limit_k", limit_k, 1e-12, math.inf, "K")
        denied = first_denied_index(jump_k, spacing_s, limit_k, start_rise_k, parameters)
        if asked is not None:
            denied = None if denied is not None and denied >= asked else denied
            admitted = admitted_of(asked, jump_k, spacing_s, limit_k, start_rise_k, parameters)
        min_s = min_spacing_s(jump_k, limit_k, parameters)
        fastest = 60.0 / min_s if min_s > 0 else math.inf
    return TrainPrediction(
        energy_j=energy_j,
        jump_k=jump_k,
        spacing_s=spacing_s,
        mean_power_w=energy_j / spacing_s,
        mean_rise_k=mean_k,
        peak_rise_k=peak_k,
        trough_rise_k=trough_k,
        after_s=after_s,
        asked=asked,
        limit_k=limit_k,
        first_denied_index=denied,
        first_denied_s=None if denied is None else denied * spacing_s,
        admitted=admitted,
        max_rate_per_min=fastest,
        extrapolated=_outside_measured(peak_k),
    )


def train_rise_k(
    jump_k: float,
    spacing_s: float,
    index: int | None = None,
    start_rise_k: float = 0.0,
    parameters: ThermalParameters = THERMAL,
) -> tuple[float, float, float]:
    """Peak, mean and trough over the period that begins with a pulse, every pulse played.

    Peak is right after the jump, trough right before the next; the mean is exact: ``(peak - trough) tau / spacing``.

    :param jump_k: rise that a pulse adds (K), 0 or more.
    :param spacing_s: from pulse to pulse (s), more than 0.
    :param index: of the pulse, from 0; None: steady state.
    :param start_rise_k: rise at first (K).
    :param parameters: of the body.
    :return: peak, mean and trough (K).
    :raises InputError: a negative jump or index, or a spacing that is not positive.
    """
    q = _decay(jump_k, spacing_s, parameters)
    steady_k = jump_k / -math.expm1(-spacing_s / parameters.tau_s)
    if index is None:
        peak_k = steady_k
    else:
        count = in_range("index", index, 0, math.inf)
        peak_k = start_rise_k * q**count + steady_k * -math.expm1(-(count + 1) * spacing_s / parameters.tau_s)
    return peak_k, peak_k * -math.expm1(-spacing_s / parameters.tau_s) * parameters.tau_s / spacing_s, peak_k * q


def first_denied_index(
    jump_k: float,
    spacing_s: float,
    limit_k: float,
    start_rise_k: float = 0.0,
    parameters: ThermalParameters = THERMAL,
) -> int | None:
    """Index of the first pulse of a periodic train that the limit denies: how many switches are allowed at that spacing.

    Closed form, then settled by one comparison each side.

    :param jump_k: rise that a pulse adds (K), 0 or more.
    :param spacing_s: from pulse to pulse (s), more than 0.
    :param limit_k: limit of the rise right after a pulse (K).
    :param start_rise_k: rise at first (K).
    :param parameters: of the body.
    :return: index from 0, or None if the limit never denies one.
    :raises InputError: a negative jump, or a spacing that is not positive.
    """
    q = _decay(jump_k, spacing_s, parameters)
    within_k = limit_k * (1 + GUARD)
    steady_k = jump_k / -math.expm1(-spacing_s / parameters.tau_s)

    def peak_k(k: int) -> float:
        return train_rise_k(jump_k, spacing_s, k, start_rise_k, parameters)[0]

    if peak_k(0) > within_k:
        return 0
    if steady_k <= within_k or q == 0.0:
        return None
    # The peak r0 q^k + S (1 - q^(k+1)) is monotonic in k; it passes the limit where q^k (S q - r0) = S - limit.
    guess = math.ceil(math.log((steady_k - within_k) / (steady_k * q - start_rise_k)) / math.log(q))
    k = max(1, guess - 2)
    while peak_k(k) <= within_k:
        k += 1
    return k


def admitted_of(
    asked: int,
    jump_k: float,
    spacing_s: float,
    limit_k: float,
    start_rise_k: float = 0.0,
    parameters: ThermalParameters = THERMAL,
) -> int:
    """How many pulses of a periodic train the limit admits, the denied ones dropped.

    After the first denial the pattern is a chain of runs (admitted in a row, then dropped in a row), so the count goes run
    by run in closed form, not pulse by pulse.

    :param asked: pulses of the train, 0 or more.
    :param jump_k: rise that a pulse adds (K), 0 or more.
    :param spacing_s: from pulse to pulse (s), more than 0.
    :param limit_k: limit of the rise right after a pulse (K).
    :param start_rise_k: rise at first (K).
    :param parameters: of the body.
    :return: number of pulses.
    :raises InputError: a negative jump, or a spacing that is not positive.
    """
    q = _decay(jump_k, spacing_s, parameters)
    within_k = limit_k * (1 + GUARD)
    before_k, index, admitted = start_rise_k, 0, 0
    while index < asked:
        if before_k + jump_k > within_k:
            dropped = _spacings_until(before_k, within_k - jump_k, spacing_s, parameters)
            before_k, index = before_k * q**dropped, index + dropped
            continue
        run = first_denied_index(jump_k, spacing_s, limit_k, before_k, parameters)
        run = asked - index if run is None else min(run, asked - index)
        before_k = train_rise_k(jump_k, spacing_s, run - 1, before_k, parameters)[2]
        admitted, index = admitted + run, index + run
    return admitted


def allowed_now(rise_k: float, jump_k: float, limit_k: float) -> int:
    """Pulses allowed at once, back to back: ``floor((limit - rise) / jump)``, never negative.

    :param rise_k: rise now (K).
    :param jump_k: rise that a pulse adds (K), more than 0.
    :param limit_k: limit of the rise (K).
    :return: number of pulses.
    :raises InputError: ``jump_k`` not positive.
    """
    in_range("jump_k", jump_k, 1e-300, math.inf, "K")
    return max(0, math.floor((limit_k * (1 + GUARD) - rise_k) / jump_k))


def min_spacing_s(jump_k: float, limit_k: float, parameters: ThermalParameters = THERMAL) -> float:
    """Minimum spacing of an endless train: ``J / (1 - exp(-s/tau)) = limit``, so ``s = -tau ln(1 - J/limit)``.

    :param jump_k: rise that a pulse adds (K), 0 or more.
    :param limit_k: limit of the rise (K), more than 0.
    :param parameters: of the body.
    :return: spacing (s); infinite if one pulse alone passes the limit.
    :raises InputError: a number outside its range.
    """
    in_range("jump_k", jump_k, 0.0, math.inf, "K")
    in_range("limit_k", limit_k, 1e-12, math.inf, "K")
    if jump_k >= limit_k:
        return math.inf
    return -parameters.tau_s * math.log1p(-jump_k / limit_k)


def wait_s(rise_k: float, count: int, jump_k: float, limit_k: float, parameters: ThermalParameters = THERMAL) -> float:
    """Time to wait until pulses are allowed at once: ``tau ln(rise / (limit - count J))``.

    :param rise_k: rise now (K).
    :param count: pulses, 0 or more.
    :param jump_k: rise that a pulse adds (K).
    :param limit_k: limit of the rise (K).
    :param parameters: of the body.
    :return: time (s); 0 if they are allowed now, infinite if they never are (``count * jump`` above the limit, or equal to it
        with any rise left).
    :raises InputError: a negative count.
    """
    in_range("count", count, 0, math.inf)
    room_k = limit_k * (1 + GUARD) - count * jump_k
    if rise_k <= room_k:
        return 0.0
    if room_k <= limit_k * 2 * GUARD:
        return math.inf
    return parameters.tau_s * math.log(rise_k / room_k)


def _outside_measured(rise_k: float) -> tuple[str, ...]:
    """What about a rise lies outside what was measured."""
    if rise_k <= MEASURED_RISE_K:
        return ()
    return (f"a rise of {rise_k:.4g} K is above the {MEASURED_RISE_K:g} K up to which heating was measured",)


def _decay(jump_k: float, spacing_s: float, parameters: ThermalParameters) -> float:
    in_range("jump_k", jump_k, 0.0, math.inf, "K")
    return math.exp(-in_range("spacing_s", spacing_s, 1e-12, math.inf, "s") / parameters.tau_s)


def _spacings_until(rise_k: float, room_k: float, spacing_s: float, parameters: ThermalParameters) -> int:
    """Whole spacings until ``rise_k`` has fallen to ``room_k``, at least 1."""
    if room_k <= 0:
        # The jump fills the limit or passes it: no sooner than when the rise has died away below the smallest double.
        return max(1, math.ceil(750.0 * parameters.tau_s / spacing_s))
    q = math.exp(-spacing_s / parameters.tau_s)
    k = max(1, math.ceil(parameters.tau_s * math.log(rise_k / room_k) / spacing_s) - 1)
    while rise_k * q**k > room_k:
        k += 1
    return k
