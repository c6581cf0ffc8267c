"""The bistable tactor of a TacTiles glove: does a pulse switch it, when does the pin arrive, what does it cost.

Levels, one interface (``LatchPlant``) and one parameter set, from cheap to exact: ``event`` (state table with travel times),
``table`` (flight looked up, contact stepped), ``dynamic`` (equation of motion in 50 us steps), ``reference`` (order 8, located
events). Directions: ``off-on`` carries the pin toward the skin, ``on-off`` back. The stated drive is a square pulse
of at most 5 V and 10 ms (thesis 3.4.3); what lies beyond is computed, and answered as not valid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from haptics.errors import InputError
from haptics.physics.fitted import ROUNDING, refuse_outside
from haptics.physics.latch.dynamic import DynamicLatch
from haptics.physics.latch.event import EventLatch, effective_volts, travel_table
from haptics.physics.latch.parameters import LATCH, LONGEST_PULSE_S, NOMINAL_VOLTS, LatchParameters
from haptics.physics.latch.plant import BeyondStop, Latched, LatchPlant, checked_resistance
from haptics.units import in_range, one_of

LEVELS: tuple[str, ...] = ("event", "table", "dynamic", "reference")
DIRECTIONS: tuple[str, ...] = ("off-on", "on-off")

PULSE_TOWARD_S = 3e-3
"""Pulse mode, toward the skin (thesis 3.4.5). Alone it would latch the pin on."""
PULSE_BACK_S = 3e-3
"""Pulse mode, back. Assumed equal to the train's. After 3 ms toward the skin, 0.96 ms brings the pin back at 5 V, cold, and
1.46 ms in the worst case of 4.5 to 5.25 V, a coil 0 to 50 K warm, 1.28 to 1.48 ohm, bare or against a skin of 300 N/m: the
margin is a factor of two."""
TRAIN_TOWARD_S = 2e-3
"""Pulse train, toward the skin (thesis 3.4.5): too short to latch by itself."""
TRAIN_BACK_S = 3e-3
"""Pulse train, back (thesis 3.4.5)."""
UNCERTAIN_WITHIN = 0.02
"""A pulse this close to the shortest that switches is uncertain: it may switch or not."""
LONGEST_TRIED_S = 10.0
"""Longest pulse that is answered at all."""
_SEARCH_S = 50e-3


@dataclass(frozen=True)
class LatchOutcome:
    """What one pulse does to a tactor at rest.

    :param switched: the pin ended at the far stop.
    :param arrival_s: from the pulse's beginning to the far stop (s), None if it is not reached.
    :param impact_m_s: speed there (m/s), unsigned, None if it is not reached.
    :param energy_j: electrical (J).
    :param final_state: where the pin ended.
    :param min_pulse_s: the shortest pulse (s) that switches under the same voltage and heat; infinite if none up to 50 ms does.
    :param margin: ``pulse_s / min_pulse_s - 1``; -1 if no pulse switches.
    :param uncertain: the margin is within 2 % of zero.
    :param valid: False outside the stated drive, or what the level answers for, with ``reasons``.
    :param reasons: one sentence each.
    :param level: of the model.
    """

    switched: bool
    arrival_s: float | None
    impact_m_s: float | None
    energy_j: float
    final_state: Latched
    min_pulse_s: float
    margin: float
    uncertain: bool
    valid: bool
    reasons: tuple[str, ...]
    level: str


def latch_plant(
    level: str = "dynamic",
    parameters: LatchParameters = LATCH,
    *,
    latched: Latched = "off",
    start_s: float = 0.0,
) -> LatchPlant:
    """A tactor at rest, to be driven through time.

    :param level: one of ``LEVELS``.
    :param parameters: of the tactor.
    :param latched: where it rests at first: on or off.
    :param start_s: time at the start (s), in any one clock.
    :return: a plant of that level.
    :raises InputError: an unknown level, or a state it cannot rest in.
    """
    if one_of("level", level, LEVELS) == "event":
        return EventLatch(parameters, latched, start_s)
    if level == "dynamic":
        return DynamicLatch(parameters, latched, start_s)
    # The others take numpy, and the reference scipy, which a command that does not use them should not wait for.
    if level == "table":
        from haptics.physics.latch.table import TableLatch

        return TableLatch(parameters, latched, start_s)
    from haptics.physics.latch.reference import ReferenceLatch

    return ReferenceLatch(parameters, latched, start_s)


def switch(
    pulse_s: float,
    volts: float = NOMINAL_VOLTS,
    direction: str = "off-on",
    rise_k: float = 0.0,
    level: str = "dynamic",
    parameters: LatchParameters = LATCH,
) -> LatchOutcome:
    """What one square pulse does to a tactor that rests at the near stop.

    :param pulse_s: length (s), 0 to 10.
    :param volts: magnitude at the terminals (V), 0 to 50; the direction gives the sign.
    :param direction: off-on (toward the skin) or on-off.
    :param rise_k: the coil's rise above the room (K), -50 to 200.
    :param level: one of ``LEVELS``.
    :param parameters: of the tactor.
    :return: the outcome; its ``valid`` is False beyond 10 ms, 5 V and what the level answers for.
    :raises InputError: anything outside these ranges; or, at any level but ``event``, a pulse that presses the pin deeper into a
        stop than the forces are known for (a long one of some 35 V or more, cold, into the foam under the off plate).
    """
    in_range("pulse_s", pulse_s, 0.0, LONGEST_TRIED_S, "s")
    min_s = min_pulse_s(volts, direction, rise_k, level, parameters, extrapolate=True)
    plant = _pulsed(pulse_s, volts, direction, rise_k, level, parameters)
    target: Latched = "on" if direction == "off-on" else "off"
    switched = plant.latched == target
    kind = "reached_skin" if target == "on" else "reached_off"
    arrivals = [event for event in plant.take_events() if event.kind == kind] if switched else []
    margin = pulse_s / min_s - 1.0 if math.isfinite(min_s) else -1.0
    reasons: list[str] = []
    if pulse_s > LONGEST_PULSE_S * (1 + 1e-9):
        reasons.append(f"pulse of {pulse_s * 1e3:g} ms is longer than the stated {LONGEST_PULSE_S * 1e3:g} ms")
    reasons += _outside_drive(volts)
    reasons += plant.outside
    return LatchOutcome(
        switched=switched,
        arrival_s=arrivals[0].time_s if arrivals else None,
        impact_m_s=abs(arrivals[0].speed_m_s) if arrivals else None,
        energy_j=plant.energy_j,
        final_state=plant.latched,
        min_pulse_s=min_s,
        margin=margin,
        uncertain=abs(margin) < UNCERTAIN_WITHIN,
        valid=not reasons,
        reasons=tuple(reasons),
        level=level,
    )


@lru_cache(maxsize=256)
def min_pulse_s(
    volts: float = NOMINAL_VOLTS,
    direction: str = "off-on",
    rise_k: float = 0.0,
    level: str = "dynamic",
    parameters: LatchParameters = LATCH,
    *,
    extrapolate: bool = False,
) -> float:
    """The shortest pulse that switches.

    :param volts: magnitude at the terminals (V), 0 to 5; at level ``event`` 3.75 to 5.5 at nominal resistance.
    :param direction: off-on (toward the skin) or on-off.
    :param rise_k: the coil's rise above the room (K), -50 to 200.
    :param level: one of ``LEVELS``.
    :param parameters: of the tactor.
    :param extrapolate: True: answer up to 50 V, beyond the stated drive and what level ``event`` is fitted over.
    :return: length (s), to 0.1 us; infinite if no pulse up to 50 ms switches.
    :raises InputError: an argument outside its range, or volts beyond the drive or the fit without ``extrapolate``.
    """
    _check(volts, direction, rise_k, level)
    refuse_outside(f"volts = {volts:g} V", _outside_drive(volts), extrapolate)
    if level == "event":
        effective_v = effective_volts(volts, checked_resistance(parameters, rise_k))
        min_s = travel_table(parameters).min_s(direction == "off-on", effective_v, extrapolate=extrapolate)
        return min_s if min_s <= _SEARCH_S else math.inf
    if level == "reference":
        # The two agree to a few nanoseconds, and the search asks twenty times.
        return min_pulse_s(volts, direction, rise_k, "dynamic", parameters, extrapolate=extrapolate)
    target = "on" if direction == "off-on" else "off"

    def switches(pulse_s: float) -> bool:
        try:
            return _pulsed(pulse_s, volts, direction, rise_k, level, parameters).latched == target
        except BeyondStop:
            return True  # it came to the far stop, and further than the model goes

    low, high = 0.0, _SEARCH_S
    if not switches(high):
        return math.inf
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if switches(middle) else (middle, high)
    return high


@lru_cache(maxsize=256)
def travel_s(
    direction: str = "off-on",
    volts: float = NOMINAL_VOLTS,
    rise_k: float = 0.0,
    level: str = "event",
    parameters: LatchParameters = LATCH,
    *,
    extrapolate: bool = False,
) -> float:
    """Time from a pulse's beginning to the pin's arrival, the pulse lasting that long: the lead that a renderer needs.

    :param direction: as ``min_pulse_s``.
    :param volts: as ``min_pulse_s``.
    :param rise_k: as ``min_pulse_s``.
    :param level: one of ``LEVELS``; ``event``, the default, answers at once.
    :param parameters: as ``min_pulse_s``.
    :param extrapolate: as ``min_pulse_s``.
    :return: time (s); infinite if the pin does not arrive within 50 ms.
    :raises InputError: as ``min_pulse_s``.
    """
    _check(volts, direction, rise_k, level)
    refuse_outside(f"volts = {volts:g} V", _outside_drive(volts), extrapolate)
    if level == "event":
        effective_v = effective_volts(volts, checked_resistance(parameters, rise_k))
        return travel_table(parameters).travel_s(direction == "off-on", effective_v, extrapolate=extrapolate)
    arrival_s = switch(_SEARCH_S, volts, direction, rise_k, level, parameters).arrival_s
    return math.inf if arrival_s is None else arrival_s


def _outside_drive(volts: float) -> tuple[str, ...]:
    """What about volts lies outside the stated drive."""
    return (f"{volts:g} V is above the stated {NOMINAL_VOLTS:g} V",) if volts > NOMINAL_VOLTS * (1.0 + ROUNDING) else ()


def _check(volts: float, direction: str, rise_k: float, level: str) -> None:
    in_range("volts", volts, 0.0, 50.0, "V")
    in_range("rise_k", rise_k, -50.0, 200.0, "K")
    one_of("direction", direction, DIRECTIONS)
    one_of("level", level, LEVELS)


def _pulsed(pulse_s: float, volts: float, direction: str, rise_k: float, level: str, parameters: LatchParameters) -> LatchPlant:
    """A tactor that has had one pulse and come to rest since."""
    toward_on = direction == "off-on"
    plant = latch_plant(level, parameters, latched="off" if toward_on else "on")
    plant.rise_k = rise_k
    plant.drive(0.0, volts if toward_on else -volts)
    plant.drive(pulse_s, 0.0)
    for tenths in range(1, 11):
        plant.advance(pulse_s + 0.1 * tenths)
        if plant.at_rest:
            return plant
    raise InputError(f"a tactor with {parameters} has not come to rest a second after its pulse; its drag is too low")
