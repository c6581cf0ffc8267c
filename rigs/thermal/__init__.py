"""How warm an actuator gets, and how fast (thesis 3.5.2)."""

from rigs.thermal.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
