"""Drivers: an open link in, results out."""

from haptics.devices.brake import BrakeDriver, Refusal
from haptics.devices.result import Reason, Result, ResultKind
from haptics.devices.sharing import BrakeShare, SharedBrakes, SharedTactiles, TactilesShare
from haptics.devices.tactiles import TactilesDriver

__all__ = [
    "BrakeDriver",
    "BrakeShare",
    "Reason",
    "Refusal",
    "Result",
    "ResultKind",
    "SharedBrakes",
    "SharedTactiles",
    "TactilesDriver",
    "TactilesShare",
]
