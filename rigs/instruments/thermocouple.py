"""A thermocouple behind a converter that prints degrees Celsius: such as K-type and MAX31856 on any microcontroller."""

from __future__ import annotations

from rigs.instruments.stream import SampleStream

GAIN_SD = 0.004
"""Standard deviation of reading over truth for a difference of temperatures (IEC 60584-1: 0.4 % for class 1, taken as one sd)."""
LAG_S, LAG_SD_S = 1.0, 0.3
"""Lag of a junction glued to an actuator, before it is measured (assumed)."""
DRIFT_SD_K_S = 0.3 / 3600
"""Drift of a room with its doors shut (assumed)."""


class Thermocouple(SampleStream):
    """Temperature, degrees Celsius. The word ``open`` in place of a value: the wire is broken."""

    kind = "thermocouple"
    columns = (("temperature_c", "degC"),)
