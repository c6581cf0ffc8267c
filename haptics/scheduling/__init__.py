"""Which pulse when: heat accounts, the current limit, priorities, and how long one may have to wait."""

from haptics.scheduling.coil_heat import CoilHeat
from haptics.scheduling.latency import latency_bound_s, sustained_latency_bound_s
from haptics.scheduling.limits import CoilLimits
from haptics.scheduling.requests import CoilPulse, Outcome, Priority, Request, Stroke, burst, contact, pulse, release
from haptics.scheduling.scheduler import Scheduler
from haptics.scheduling.thermal_budget import ThermalBudget

__all__ = [
    "CoilHeat",
    "CoilLimits",
    "CoilPulse",
    "Outcome",
    "Priority",
    "Request",
    "Scheduler",
    "Stroke",
    "ThermalBudget",
    "burst",
    "contact",
    "latency_bound_s",
    "pulse",
    "release",
    "sustained_latency_bound_s",
]
