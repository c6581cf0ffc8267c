"""What the thermal rig records."""

from __future__ import annotations

from dataclasses import dataclass

from rigs.coil_current import PulseRecord
from rigs.instruments import Samples


@dataclass(frozen=True)
class ThermalRun:
    """What was recorded. Times are on the bench's clock.

    :param start_ns: start of the rest, ns.
    :param heat_ns: start and end of the heating, ns.
    :param pulses: as they were played.
    :param temperatures: as read, degrees Celsius.
    :param thermocouple_faults: words that the thermocouple printed instead of values.
    """

    start_ns: int
    heat_ns: tuple[int, int]
    pulses: PulseRecord
    temperatures: Samples
    thermocouple_faults: tuple[str, ...]
