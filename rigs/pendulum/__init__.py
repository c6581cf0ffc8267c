"""Recoil of a landing pin, on a pendulum (thesis 3.5.1)."""

from rigs.pendulum.rig import BOARD, INSTRUMENTS, MEASUREMENTS, NAME, PUBLISHED, evaluate, run

__all__ = ["BOARD", "INSTRUMENTS", "MEASUREMENTS", "NAME", "PUBLISHED", "evaluate", "run"]
