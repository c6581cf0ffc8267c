"""Drivers: an open link in, results out."""

from haptics.devices.brake import BrakeDriver, Refusal
from haptics.devices.result import Result
from haptics.devices.tactiles import TactilesDriver

__all__ = ["BrakeDriver", "Refusal", "Result", "TactilesDriver"]
