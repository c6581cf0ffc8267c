"""Which model runs at which level in a scene, and why."""

from haptics.fidelity.plan import Absence, Plan, PlanRow, plan_scene

__all__ = ["Absence", "Plan", "PlanRow", "plan_scene"]
