"""Pulse trains: delivered against asked (thesis 3.4.5)."""

from rigs.frequency.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
