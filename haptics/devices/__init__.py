"""Drivers: an open link in, results out."""

from haptics.devices.brake import BrakeDriver, Refusal
from haptics.devices.result import Reason, Result, ResultKind
from haptics.devices.tactiles import TactilesDriver

__all__ = ["BrakeDriver", "Reason", "Refusal", "Result", "ResultKind", "TactilesDriver"]
