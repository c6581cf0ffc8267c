"""How fast a brake grips and lets go (thesis 4.7.3)."""

from rigs.response.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
