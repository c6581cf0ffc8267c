"""Rigs with fewer steps, for what does not need all of them: every fault shows, and a fit has wider intervals.

Each function takes what sets an attribute until the test ends, ``monkeypatch.setattr``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rigs.frequency import rig as frequency_rig
from rigs.pendulum import rig as pendulum_rig
from rigs.pull import rig as pull_rig
from rigs.response import rig as response_rig
from rigs.supply import rig as supply_rig
from rigs.thermal import rig as thermal_rig

SetAttribute = Callable[[object, str, object], None]


def thermal(set_attribute: SetAttribute, heat_s: float = 60.0, cool_s: float = 60.0) -> None:
    """A minute of heating, a minute of cooling, instead of six of each."""
    set_attribute(thermal_rig, "HEAT_S", heat_s)
    set_attribute(thermal_rig, "COOL_S", cool_s)


def frequency(set_attribute: SetAttribute) -> None:
    """One slow train, which jitter needs, two fast ones, and contacts of 5 Hz, in whole periods of telemetry."""
    set_attribute(frequency_rig, "RATES_HZ", (20.0, 100.0, 200.0))
    set_attribute(frequency_rig, "CONTACT", replace(frequency_rig.CONTACT, rate_hz=5.0, back_at_s=0.1))


def pendulum(set_attribute: SetAttribute) -> None:
    """Half the landings."""
    set_attribute(pendulum_rig, "CYCLES", 10)


def pull(set_attribute: SetAttribute, volts: tuple[float, ...] = (0.0, 500.0, 1000.0, 1500.0)) -> None:
    """Few amplitudes; the law needs three."""
    set_attribute(pull_rig, "VOLTS", volts)


def response(set_attribute: SetAttribute) -> None:
    """Half the steps."""
    set_attribute(response_rig, "STEPS", 5)


def supply(set_attribute: SetAttribute) -> None:
    """Few charges, waves and stops."""
    set_attribute(supply_rig, "CHARGES", 4)
    set_attribute(supply_rig, "WAVES", ((1.0, 20.0), (2.0 / 3.0, 20.0)))
    set_attribute(supply_rig, "STOPS_M", (0.0, 3e-3, 6e-3, 10e-3))
