"""Drivers: an open link in, results out."""

from haptics.devices.brake import BrakeDriver, Refusal
from haptics.devices.tactiles import Result, TactilesDriver

__all__ = ["BrakeDriver", "Refusal", "Result", "TactilesDriver"]
