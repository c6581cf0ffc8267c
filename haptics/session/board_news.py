"""What the boards of a glove tell: telemetry, faults and notes for people, and how each was found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from haptics.link.events import NO_CHANNEL, Disarmed, Event, FaultReported, FoundArmed, Lost, Ready, Rebooted, Telemetry
from haptics.link.messages import State
from haptics.link.readings import fault_name, fault_names

TEXTS_KEPT = 200
"""Faults and notes that are remembered."""
HELD_V = 20
"""Volts that a board measures at an output count as held from here on: below it is its converter's noise."""


class BoardNews:
    """Takes what links report, and remembers it in words.

    :ivar faults: what went wrong since opening, in words, each once; a history, not what holds now.
    :ivar notes: what a person should know besides.
    :ivar latched: by board, the faults that are latched, as it reported last.
    :ivar telemetry: each board's last message since it was armed.
    :ivar wanted_armed: what a board reports is a fault only while it is to be armed.
    :ivar heat_booked: nothing happened since the array was armed that its host did not ask for.
    """

    def __init__(self) -> None:
        self.faults: list[str] = []
        self.notes: list[str] = []
        self.latched: dict[str, tuple[str, ...]] = {}
        self.telemetry: dict[str, Any] = {}
        self.wanted_armed, self.heat_booked = False, True
        self._sinks: list[Callable[[str, Event], None]] = []
        self._lost: set[str] = set()
        self._heard: set[str] = set()  # boards that have told how they were found

    def on_event(self, sink: Callable[[str, Event], None]) -> None:
        """Hand on each event.

        :param sink: called with a board's name and the event.
        """
        self._sinks.append(sink)

    def take(self, name: str, event: Event) -> None:
        """A link reported something.

        :param name: of the board.
        :param event: what.
        """
        if name == "tactiles" and isinstance(event, FaultReported | Rebooted | Disarmed | Lost):
            self.heat_booked = False
        if isinstance(event, Telemetry):
            self._take_telemetry(name, event.message)
        elif isinstance(event, FaultReported):
            where = "" if event.channel == NO_CHANNEL else f"channel {event.channel}, "
            self.fault(f"{name}: {fault_name(event.fault)} ({where}value {event.value})")
        elif isinstance(event, Rebooted):
            self.fault(f"{name}: the board rebooted; it stays disarmed until armed by hand")
        elif isinstance(event, Disarmed):
            if self.wanted_armed:
                self.fault(f"{name}: disarmed by itself ({event.reason})")
        elif isinstance(event, Ready) and name in self._lost:
            self._lost.discard(name)
            self.note(f"{name}: the board is there again; it is disarmed until armed by hand")
        elif isinstance(event, FoundArmed):
            self.note(f"{name}: it was still armed by an earlier host when this one came; it was stopped")
        elif isinstance(event, Lost):
            self._lost.add(name)
            self.fault(f"{name}: {event.error}")
        self.hand_on(name, event)

    def hand_on(self, name: str, event: Event) -> None:
        """Tell whoever asked to be told.

        :param name: of the board.
        :param event: what.
        """
        for sink in self._sinks:
            sink(name, event)

    def note(self, text: str) -> None:
        """Remember what a person should know.

        :param text: in words; each once.
        """
        _remember(self.notes, text)

    def fault(self, text: str) -> None:
        """Remember what went wrong.

        :param text: in words; each once.
        """
        _remember(self.faults, text)

    def _take_telemetry(self, name: str, message: Any) -> None:
        self.telemetry[name] = message
        latched = self.latched[name] = tuple(fault_names(message.faults)) if message.faults else ()
        if latched and self.wanted_armed:
            self.fault(f"{name}: {', '.join(latched)}")
        if name not in self._heard:
            self._heard.add(name)
            self._note_found(name, message, latched)

    def _note_found(self, name: str, message: Any, latched: tuple[str, ...]) -> None:
        """What a board brings from an earlier host, by the first that it tells."""
        if latched:
            self.note(f"{name}: found with a latched fault: {', '.join(latched)}; find out why, then clear it with clear()")
        held = [f"{volts} V at output {i}" for i, volts in enumerate(getattr(message, "output", ())) if volts >= HELD_V]
        if held and message.state == State.DRIVING:
            self.note(f"{name}: found holding {', '.join(held)} for an earlier host")


def _remember(texts: list[str], text: str) -> None:
    if text not in texts:
        texts.append(text)
        del texts[:-TEXTS_KEPT]
