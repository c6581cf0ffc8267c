"""What the thermal rig records."""

from __future__ import annotations

from dataclasses import dataclass

from rigs.coil_current import PulseRecord
from rigs.instruments import Samples


@dataclass(frozen=True)
class ThermalRun:
    """What was recorded: ``start_ns`` of the rest, pulses as they were played, and temperatures."""

    start_ns: int
    heat_ns: tuple[int, int]
    pulses: PulseRecord
    temperatures: Samples
    thermocouple_faults: tuple[str, ...]
