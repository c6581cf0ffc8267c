"""Going on after the watchdog had let go: when it may, and how gently."""

from __future__ import annotations

from typing import Literal

from haptics.time import NS_PER_MS

Resume = Literal["apart", "gentle"]
RESUMES: tuple[Resume, ...] = ("apart", "gentle")
"""When a loop whose poses had stopped goes on: once the hand touches nothing, or gently, even inside an object."""
STEADY_NS = 250 * NS_PER_MS
"""Poses have to come for so long before it goes on gently."""
RAMP_NS = 1000 * NS_PER_MS
"""A brake rises to what it held with over this time."""
STEP_NS = 50 * NS_PER_MS
"""In steps so far apart."""


class Ramp:
    """A slow rise of the brakes of one grasp.

    :param name: of the object that is held.
    :param now_ns: when it begins.
    """

    def __init__(self, name: str, now_ns: int):
        self.object = name
        self._begun_ns = self._due_ns = now_ns

    def step(self, now_ns: int) -> float | None:
        """The share of the volts from now on.

        :param now_ns: the tick's time.
        :return: above 0 to 1; None while it is not time for another step.
        """
        if now_ns < self._due_ns:
            return None
        self._due_ns = now_ns + STEP_NS
        return min(1.0, (now_ns - self._begun_ns + STEP_NS) / RAMP_NS)
