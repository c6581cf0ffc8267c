"""A board's latched faults in words."""

from __future__ import annotations

from haptics.link.messages import Fault


def fault_names(mask: int) -> str:
    """The faults of a mask such as telemetry's, by name; empty for none."""
    return ", ".join(fault.name.lower() for fault in Fault if mask >> fault & 1)
