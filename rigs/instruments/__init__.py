"""What a bench measures with: small drivers over serial ports, the same for a simulated instrument and a real one.

``docs/reference/instruments.md`` has the text they speak, so that anything that prints lines can take their place.
"""

from rigs.instruments.accelerometer import Accelerometer
from rigs.instruments.loadcell import LoadCell
from rigs.instruments.probe import Probe
from rigs.instruments.stage import Stage
from rigs.instruments.stream import InstrumentSilent, Samples, SampleStream
from rigs.instruments.thermocouple import Thermocouple

__all__ = ["Accelerometer", "InstrumentSilent", "LoadCell", "Probe", "SampleStream", "Samples", "Stage", "Thermocouple"]
