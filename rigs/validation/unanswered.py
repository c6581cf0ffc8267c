"""Published numbers about the devices that nothing here can measure or compute, and why."""

from __future__ import annotations

_NO_GAUGE = "no rig pushes on a pin; the number is a parameter of the latch (holding force), and with it the model switches"
_PEOPLE = "a number about people: the studies' procedures and simulated observers answer it"

UNANSWERED: dict[str, str] = {
    "latch_holding_force": _NO_GAUGE,
    "latch_stroke": "no rig measures a pin's travel; the number is a parameter of the latch",
    "actuator_mass": "a mass is weighed, not simulated; no model uses it",
    "actuator_footprint": "8 x 9.5 mm is 76 mm2, not 71.5; no model uses it",
    "power_factor_envelope": "140 W / 18 W is 7.8; a comparison with a device that is not modelled here",
    "friction": "only friction times compression is measured: an effective 0.07 to 0.09; 0.2 is an upper bound",
    "breakdown_field": "above it there is a fault, not a number: a controller refuses half of it",
    "brake_mass": "a mass is weighed, not simulated; no model uses it",
    "mass_force_density": "needs the device's mass",
    "piezo_acceleration": "no rig carries a piezo; the number is a parameter of its model",
    "piezo_power": "no rig carries a piezo; the number is a parameter of its model",
    "clutch_power": "neither permittivity nor frequency is stated; under Eq 4.4 their product would be 395 Hz",
    "localisation": _PEOPLE,
    "mode_discrimination": _PEOPLE,
    "jnd_rate_mean": _PEOPLE,
    "jnd_force_middle": _PEOPLE,
}
