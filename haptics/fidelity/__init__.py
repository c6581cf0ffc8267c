"""Which model runs at which level in a scene, and why: errors and costs as measured, what a person notices, and the plan."""

from haptics.fidelity.measured import Measured, MeasuredRow, shipped
from haptics.fidelity.notice import DEFAULT_TOLERANCE_JND
from haptics.fidelity.plan import DEFAULT_BUDGET, Absence, Plan, PlanRow, plan_scene

__all__ = [
    "DEFAULT_BUDGET",
    "DEFAULT_TOLERANCE_JND",
    "Absence",
    "Measured",
    "MeasuredRow",
    "Plan",
    "PlanRow",
    "plan_scene",
    "shipped",
]
