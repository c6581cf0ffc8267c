"""All that a session told, collected by whoever needs the whole of it afterwards."""

from __future__ import annotations

from haptics.devices import Result
from haptics.rendering.events import LoopEvent
from haptics.session.session import Session


class Heard:
    """Subscribes to a session.

    :param session: not begun yet.

    :ivar results: what became of touches and pulses, in order.
    :ivar brake_results: what became of brakes and piezos.
    :ivar events: all else.
    """

    def __init__(self, session: Session):
        self.results: list[Result] = []
        self.brake_results: list[Result] = []
        self.events: list[LoopEvent] = []
        session.subscribe(self._hear)

    def _hear(self, one: Result | LoopEvent) -> None:
        if isinstance(one, LoopEvent):
            self.events.append(one)
        elif one.kind in ("brake", "piezo"):
            self.brake_results.append(one)
        else:
            self.results.append(one)
