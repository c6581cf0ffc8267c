"""How a circuit is followed through time in ngspice: steps, tolerances, and sources that are staircases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

RELATIVE_TOLERANCE = 1e-7
"""The simulator's. Times the full charge it is also what each step may lose by truncation: a tolerance that went with the present
charge would shrink to nothing where the wave crosses zero, and the step with it."""
EDGE_SHARE = 2e-4
"""Length of an edge over the longest step: four times what the simulator still resolves as two instants."""

Steps = Sequence[tuple[float, float]]
"""A staircase: ``(from when, value)``, the first at 0 s."""


@dataclass(frozen=True)
class Transient:
    """A run of ``end_s`` from given starting values, no step longer than ``longest_s``.

    :param end_s: end of the run, s.
    :param longest_s: maximum step, s.
    """

    end_s: float
    longest_s: float

    @property
    def edge_s(self) -> float:
        """How long a source takes from one stair to the next, centred on the instant it stands for."""
        return EDGE_SHARE * self.longest_s

    def source(self, steps: Steps) -> str:
        """A staircase as a piecewise linear source.

        :param steps: from when (s) and value.
        :return: the source's specification in a netlist.
        """
        points = [f"0 {steps[0][1]!r}"]
        for (_, before), (at_s, after) in pairwise(steps):
            points.append(f"{at_s - 0.5 * self.edge_s!r} {before!r} {at_s + 0.5 * self.edge_s!r} {after!r}")
        return f"PWL({' '.join(points)})"

    def lines(self, full_charge: float, min_current_a: float) -> list[str]:
        """Options and analysis. They end the netlist.

        :param full_charge: maximum charge (C) or flux (V s) stored: the scale of each step's truncation.
        :param min_current_a: absolute tolerance of currents, A.
        :return: the last lines of a netlist.
        """
        return [
            f".options reltol={RELATIVE_TOLERANCE} abstol={min_current_a:.3g} vntol=1e-6 chgtol={full_charge:.6g}",
            ".options gmin=1e-15 trtol=1 method=trap",
            f".tran {self.longest_s!r} {self.end_s!r} 0 {self.longest_s!r} uic",
            ".end",
        ]
