"""What became of what a scene wanted, told as events: acted, and how late; or denied, and from when on it may be tried again."""

from __future__ import annotations

from collections.abc import Callable

from haptics.devices import Result
from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.rendering.events import LoopEvent
from haptics.rendering.loop import Leads
from haptics.time import NS_PER_S

TOLD_ALWAYS = ("contact", "release", "brake", "piezo")
"""Kinds whose acting is an event each; pulses come by the hundred, and only their denials are told."""
OF_NO_INTEREST = ("superseded", "ended", "stopped")
"""Reasons that say only that something newer was wanted, or nothing any more."""


class Outcomes:
    """Matches the results of one owner with what it had wanted.

    :param leads: of the devices: when a thing that was commanded has moved.
    :param report: takes each event.
    """

    def __init__(self, leads: Leads, report: Callable[[LoopEvent], None]):
        self._report = report
        self._wanted: dict[tuple[str, str], LoopEvent] = {}
        self._denied: dict[tuple[str, str], str] = {}  # the last reason told, by output and kind
        moves_s = {"contact": leads.pin_s, "release": leads.pin_back_s, "brake": leads.brake_s}
        self._moves_ns = {kind: round(seconds * NS_PER_S) - COMMAND_LEAD_NS for kind, seconds in moves_s.items()}

    def want(self, event: LoopEvent) -> None:
        """Something was asked for.

        :param event: of kind ``wanted``: output, object, and in ``detail`` the kind of result to come.
        """
        self._wanted[event.subject, event.detail] = event

    def tell(self, now_ns: int, result: Result) -> None:
        """Something came of it.

        :param now_ns: when that was known.
        :param result: of this owner.
        """
        key = (result.site, result.kind)
        wanted = self._wanted.get(key)
        name = "" if wanted is None else wanted.object
        if result.played and result.start_ns is not None:
            self._denied.pop(key, None)
            self._wanted.pop(key, None)
            if result.kind in TOLD_ALWAYS and wanted is not None:
                moved_ns = result.start_ns + self._moves_ns.get(result.kind, 0)
                aimed_ns = wanted.aimed_ns
                late_ns = result.start_ns - wanted.time_ns if aimed_ns is None else moved_ns - aimed_ns
                self._report(LoopEvent(result.start_ns, "acted", result.site, name, result.kind, aimed_ns, late_ns))
        elif result.reason is not None and result.reason not in OF_NO_INTEREST and self._denied.get(key) != result.reason:
            self._denied[key] = result.reason
            self._report(
                LoopEvent(now_ns, "denied", result.site, name, result.kind, reason=result.reason, retry_ns=result.retry_ns)
            )

    def forget(self) -> None:
        """The devices were armed anew: what is denied is news again."""
        self._wanted.clear()
        self._denied.clear()
