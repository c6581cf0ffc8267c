"""Force of a brake on a pull tester (thesis 4.7.2, 4.7.3)."""

from rigs.pull.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
