"""The rigs there are, by name; each is imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Protocol, cast

from haptics.units import one_of
from rigs.bench import BenchOptions
from rigs.instruments import SampleStream, Stage
from rigs.result import Answer, Measurement, RigResult

RIGS = {
    "thermal": "how warm an actuator gets and how fast: tau, c (thesis 3.5.2)",
    "pendulum": "recoil of the pin on bare plate, silicone and foam (3.5.1)",
    "frequency": "pulse trains from 1 to 200 Hz: delivered against asked (3.4.5)",
    "pull": "force of a brake against volts, on a pull tester (4.7.2, 4.7.3)",
    "response": "how fast a brake grips and lets go (4.7.3)",
    "supply": "charge, power, discharge and capacitance of the high-voltage side (4.4.3, 4.7.1)",
}
INSTRUMENT_KINDS = ("thermocouple", "accelerometer", "loadcell", "stage", "probe")


class Rig(Protocol):
    """What every rig's folder shows."""

    NAME: str
    BOARD: str
    INSTRUMENTS: tuple[type[SampleStream] | type[Stage], ...]
    MEASUREMENTS: Mapping[str, Measurement]
    PUBLISHED: Mapping[str, Answer]

    @staticmethod
    def run(options: BenchOptions) -> RigResult: ...


def rig(name: str) -> Rig:
    """The rig of that name.

    :param name: a key of ``RIGS``.
    :return: the rig's package, imported on the first call.
    :raises InputError: there is none; the message lists what there is.
    """
    return cast(Rig, importlib.import_module(f"rigs.{one_of('rig', name, tuple(RIGS))}"))
