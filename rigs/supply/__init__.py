"""The high-voltage side: charge, power, discharge, capacitance (thesis 4.4.3, 4.7.1)."""

from rigs.supply.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
