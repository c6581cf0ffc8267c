"""Published numbers that need no bench: arithmetic and closed forms from stated numbers, held against what was printed."""

from __future__ import annotations

from haptics.physics.brake.charging import DRIVE, eq44_power_w, max_frequency_hz
from haptics.physics.brake.force_laws import default_law
from haptics.physics.brake.parameters import BRAKE, MAX_VOLTS, capacitance_f, compression_n
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS
from haptics.physics.latch.pulse import switch
from haptics.physics.thermal.one_node import PULSE_ENERGY_J, THERMAL
from rigs.result import Quantity

_PER_MINUTE = 1.0 / 60.0
EXPLAINED = {"predicted_charge_time": "time_to_charge"}
"""Contradiction in the source, by the reference's number."""


def model_numbers() -> dict[str, tuple[Quantity, str]]:
    """Value and where it comes from, by the id of the reference.

    :return: quantity and its source, by id.
    """
    plate = (BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
    capacity_f = capacitance_f(*plate)
    charge_s = capacity_f * MAX_VOLTS / DRIVE.supply_current_a
    no_stray = DRIVE.with_values(stray_f=0.0)
    squeeze_n = compression_n(MAX_VOLTS, *plate)
    switching = switch(10e-3, direction="on-off")
    return {
        "capacitance": (_of(capacity_f, "F"), "Eq 4.1"),
        "charge_time": (_of(charge_s, "s"), "C V / I"),
        "predicted_charge_time": (_of(charge_s, "s"), ""),
        "predicted_compression": (_of(squeeze_n, "N"), "Eq 4.2"),
        "predicted_friction": (_of(BRAKE.friction * squeeze_n, "N"), "Eq 4.3"),
        "predicted_power": (
            _of(eq44_power_w(MAX_VOLTS, 20.0, capacity_f), "W"),
            "Eq 4.4; see the supply rig",
        ),
        "full_swing_rate": (_of(max_frequency_hz(MAX_VOLTS, capacity_f, no_stray), "Hz"), "I / (2 C V)"),
        "force_density": (_of(default_law("index").force_n(MAX_VOLTS) / BRAKE.overlap_m2, "Pa"), "force law over overlap"),
        "drive_current": (_of(NOMINAL_VOLTS / LATCH.resistance_ohm, "A"), "5 V over 1.38 ohm"),
        "drive_power": (_of(NOMINAL_VOLTS**2 / LATCH.resistance_ohm, "W"), "V^2 / R"),
        "pulse_energy": (_of(switching.energy_j, "J"), "latch model, a 10 ms switch back"),
        "use_power": (_of(44.0 * _PER_MINUTE * PULSE_ENERGY_J, "W"), "44 switches a minute"),
        "study_rise": (_of(THERMAL.c_k_per_w * 49.0 * _PER_MINUTE * PULSE_ENERGY_J, "K"), "49 switches a minute, for ever"),
    }


def _of(value: float, unit: str) -> Quantity:
    return Quantity(value, 0.0, unit)
