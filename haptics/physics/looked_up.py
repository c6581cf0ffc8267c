"""scipy's Runge-Kutta method of order 8, whose steps are made continuous only where somebody looks.

A leg of a reference model is solved to its end and looked up at a few times, while every step that can be looked up costs a
quarter more evaluations of the motion. Here they are made at the first look, to the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

from scipy.integrate import DOP853  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]


class _LookedUp(DOP853):
    def _dense_output_impl(self) -> Any:
        step: Any = copy(self)
        step.K_extended = self.K_extended.copy()  # the next step writes over it
        made: list[Callable[[float], Any]] = []

        def at(time: float) -> Any:
            if not made:
                made.append(DOP853._dense_output_impl(step))
            return made[0](time)

        return at


LOOKED_UP: Any = _LookedUp
"""``method`` of ``solve_ivp`` with ``dense_output``; the motion must be the same at the look as at the step."""
