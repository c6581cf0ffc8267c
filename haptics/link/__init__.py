"""Bytes between a host and a board: frames, messages, a session with its clock, ports, and what drives them.

The protocol is written down in ``docs/reference/protocol.md``.
"""

from haptics.link.clock import ClockFit
from haptics.link.commands import Pending
from haptics.link.connection import Link
from haptics.link.events import Disarmed, Event, Failed, FaultReported, Identified, Lost, Ready, Rebooted, Telemetry
from haptics.link.messages import Board, Fault, State, Status
from haptics.link.ports import PortInfo, list_ports, open_port
from haptics.link.runner import RealtimeRunner, VirtualRunner, connect
from haptics.link.session import LinkSession
from haptics.link.settings import LinkCounters, LinkSettings
from haptics.link.simulated import SimulatedPort, simulated
from haptics.link.state import Phase

__all__ = [
    "Board",
    "ClockFit",
    "Disarmed",
    "Event",
    "Failed",
    "Fault",
    "FaultReported",
    "Identified",
    "Link",
    "LinkCounters",
    "LinkSession",
    "LinkSettings",
    "Lost",
    "Pending",
    "Phase",
    "PortInfo",
    "Ready",
    "RealtimeRunner",
    "Rebooted",
    "SimulatedPort",
    "State",
    "Status",
    "Telemetry",
    "VirtualRunner",
    "connect",
    "list_ports",
    "open_port",
    "simulated",
]
