"""What the motion of one bistable tactor depends on. Only stated numbers are data; the rest is one member of a family.

Position ``x`` runs from 0 (magnet on the off plate) to ``stroke_m`` (on the plate at the skin); voltages and forces are
positive toward the skin.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.physics.parameters import Parameters, parameter
from haptics.units import in_range


@dataclass(frozen=True)
class LatchParameters(Parameters):
    """Magnet, coil, plates, stops and skin of one tactor (thesis 3.3 to 3.5).

    ``drag_n_s_m`` is solved for so that on to off takes the 6.000 ms of Fig 3.3; the shape of the plates' and coil's force
    comes from field computations of a magnet between such plates, scaled to the stated holding force and current.
    """

    stroke_m: float = parameter(2e-3, "m", "stated", "thesis 3.5.1", low=1e-5, high=0.1)
    mass_kg: float = parameter(0.35e-3, "kg", "assumed", "moving magnet and pin out of 1.8 g (thesis 3.1)", low=1e-6, high=1.0)
    hold_on_n: float = parameter(0.200, "N", "stated", "thesis 3.3.1; 400 um plate (3.4.4)", low=0.0, high=100.0)
    hold_off_n: float = parameter(0.140, "N", "assumed", "200 um plate (thesis 3.4.4)", low=0.0, high=100.0)
    plate_length_m: float = parameter(3.687e-3, "m", "identified", "decay of plate force, field computation", low=1e-5, high=1.0)
    plate_power: float = parameter(4.797, "1", "identified", "decay of plate force, field computation", low=0.0, high=20.0)
    thrust_n_a: float = parameter(0.075, "N/A", "assumed", "coil force at either stop", low=0.0, high=100.0)
    thrust_length_m: float = parameter(2.2e-3, "m", "identified", "decay of coil force away from a stop", low=1e-5, high=10.0)
    drag_n_s_m: float = parameter(0.464437, "N s/m", "identified", "on to off in 6.000 ms (thesis Fig 3.3)", low=0.0, high=100.0)
    resistance_ohm: float = parameter(1.38, "ohm", "stated", "thesis 3.4.3, +- 0.1 ohm", low=1e-3, high=1e4)
    resistance_per_k: float = parameter(0.0039, "1/K", "assumed", "copper near room temperature", low=0.0, high=0.1)
    inductance_h: float = parameter(20e-6, "H", "assumed", "40 turns in eight layers", low=1e-9, high=1.0)
    off_stiffness_n_m: float = parameter(3e3, "N/m", "assumed", "foam under the off plate", low=1.0, high=1e9)
    off_loss_s_m: float = parameter(2.0, "s/m", "assumed", "Hunt-Crossley loss of foam", low=0.0, high=1e3)
    on_stiffness_n_m: float = parameter(1e5, "N/m", "assumed", "bare plate at the skin side", low=1.0, high=1e9)
    on_loss_s_m: float = parameter(1.0, "s/m", "assumed", "Hunt-Crossley loss of the bare plate", low=0.0, high=1e3)
    skin_stiffness_n_m: float = parameter(0.0, "N/m", "assumed", "0: free pin; a fingertip is some 300 N/m", low=0.0, high=1e6)
    skin_at_m: float = parameter(1.5e-3, "m", "assumed", "position where the pin meets the skin", low=0.0, high=0.1)
    near_stop_m: float = parameter(1e-4, "m", "assumed", "closer than this counts as latched", low=1e-9, high=0.05)

    def __post_init__(self) -> None:
        """As ``Parameters``; and a pin in the middle must not be near both stops, or any pin would count as latched on."""
        super().__post_init__()
        in_range("near_stop_m", self.near_stop_m, 0.0, 0.5 * self.stroke_m, "m")


LATCH = LatchParameters()
RESISTANCE_TOLERANCE_OHM = 0.1
"""Half-width of the coils' resistance from tactor to tactor (thesis 3.4.3)."""
NOMINAL_VOLTS = 5.0
"""Maximum voltage of the stated drive (thesis 3.4.3)."""
LONGEST_PULSE_S = 10e-3
"""Longest pulse of the stated drive (thesis 3.4.3)."""
