"""Clutch rules of a scene, carried out by the clutches of a garment."""

from __future__ import annotations

from collections.abc import Callable, Collection

from haptics.devices import BrakeShare
from haptics.rendering.events import LoopEvent
from haptics.scene.clutch_rules import BodyState
from haptics.scene.scene import Scene
from haptics.time import NS_PER_MS

RULES_EVERY_NS = 5 * NS_PER_MS
"""Clutch rules and body signals are looked at this often: far below the 100 ms in which a clutch acts (thesis 4.7.3)."""


class Clutching:
    """Keeps clutches as the rules want them.

    :param scene: whose rules, clutches and body signals.
    :param brake: the clutches, or None: rules run all the same.
    :param amplitude_v: cap on a clutch's drive, V.
    :param report: takes each event as it happens.
    """

    def __init__(self, scene: Scene, brake: BrakeShare | None, amplitude_v: float, report: Callable[[LoopEvent], None]):
        self._brake, self._report = brake, report
        self._rules = scene.clutch_rules() if scene.rules else None
        self.signals = scene.body_signals()
        """The body's angles; an engine that measures them supplies them here."""
        self._volts = {clutch.name: min(clutch.amplitude_v, amplitude_v) for clutch in scene.clutches}
        self._engaged: frozenset[str] = frozenset()
        self._start_ns = self._next_ns = 0

    def begin(self, start_ns: int) -> None:
        """Start the clock of rules and signals.

        :param start_ns: when that clock reads zero.
        """
        self._start_ns = self._next_ns = start_ns

    def due(self, now_ns: int) -> bool:
        """Whether it is time to look at the rules.

        :param now_ns: the tick's time.
        :return: False where the scene has no rules.
        """
        return self._rules is not None and now_ns >= self._next_ns

    def update(self, now_ns: int, held: str | None, touched: Collection[str], hand: bool) -> None:
        """Engage and release what the rules want now.

        :param now_ns: the tick's time, when ``due``.
        :param held: name of the object in the hand; None: none.
        :param touched: names of the objects touched.
        :param hand: whether there is a hand; without one no clutch holds.
        """
        assert self._rules is not None
        self._next_ns = now_ns + RULES_EVERY_NS
        state = BodyState(now_ns - self._start_ns, self.signals, held, touched)
        wanted = self._rules.update(state) if hand else frozenset()
        if wanted == self._engaged:
            return
        for name in sorted(wanted ^ self._engaged):
            on = name in wanted
            self._report(LoopEvent(now_ns, "clutch_on" if on else "clutch_off", name))
            if self._brake is not None and on:
                self._report(LoopEvent(now_ns, "wanted", name, "", "brake"))
                self._brake.engage(name, self._volts[name], now_ns)
            elif self._brake is not None:
                self._brake.release(name, now_ns)
        self._engaged = wanted

    def forget(self) -> None:
        """Take every clutch for released: the driver has let go of all."""
        self._engaged = frozenset()
