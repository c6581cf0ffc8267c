"""What one actuator's pin does under the standard contact pulse, level ``dynamic``: 10 ms each way, cold, from rest."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from haptics.physics.latch.parameters import LatchParameters
from haptics.physics.latch.pulse import DIRECTIONS, latch_plant
from haptics.physics.thermal.one_node import PULSE_S

_REST_S = 0.3
"""As long as the fidelity cases are followed after their last stroke."""


@dataclass(frozen=True)
class Stroke:
    """One pulse.

    :param switched: the pin stays at the far stop.
    :param arrival_s: at the far stop, from the pulse's start, s; nan if it does not stay there.
    :param impact_m_s: speed there, unsigned, m/s; nan likewise.
    :param energy_j: taken by the coil, J.
    """

    switched: bool
    arrival_s: float
    impact_m_s: float
    energy_j: float


def stroke(direction: str, parameters: LatchParameters, volts: float) -> Stroke:
    """The pin's answer to a contact pulse (``off-on``) or a release (``on-off``).

    :param direction: ``off-on`` or ``on-off``.
    :param parameters: of the actuator.
    :param volts: at the coil, V, > 0.
    :return: what the pin did.
    """
    toward_skin = direction == "off-on"
    plant = latch_plant("dynamic", parameters, latched="off" if toward_skin else "on")
    plant.drive(0.0, volts if toward_skin else -volts)
    plant.drive(PULSE_S, 0.0)
    plant.advance(PULSE_S + _REST_S)
    kind = "reached_skin" if toward_skin else "reached_off"
    reached = next((event for event in plant.take_events() if event.kind == kind), None)
    if reached is None or plant.latched != ("on" if toward_skin else "off"):
        return Stroke(False, math.nan, math.nan, plant.energy_j)
    return Stroke(True, reached.time_s, abs(reached.speed_m_s), plant.energy_j)


@dataclass(frozen=True)
class Pin:
    """Both strokes of one actuator.

    :param out: toward the skin.
    :param back: from the skin.
    """

    out: Stroke
    back: Stroke

    @property
    def power_w(self) -> float:
        """Mean over both pulses of what the coil takes while it is on."""
        return (self.out.energy_j + self.back.energy_j) / (2.0 * PULSE_S)


def pin(parameters: LatchParameters, volts: float) -> Pin:
    """Both strokes of an actuator; from a stop that a pin cannot hold it does not come back either.

    :param parameters: of the actuator.
    :param volts: at the coil, V, > 0.
    :return: both strokes.
    """
    out, back = (stroke(direction, parameters, volts) for direction in DIRECTIONS)
    return Pin(out, back if out.switched else replace(back, switched=False, arrival_s=math.nan, impact_m_s=math.nan))


def bare(parameters: LatchParameters) -> LatchParameters:
    """The same actuator on a bench: no skin under its pin.

    :param parameters: of an actuator with skin.
    :return: the same without.
    """
    return parameters.with_values(skin_stiffness_n_m=0.0)
