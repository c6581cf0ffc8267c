"""One bench: a board, the instruments on it, time, and a record of everything; off on every exit."""

from rigs.bench.bench import Bench
from rigs.bench.options import BenchOptions

__all__ = ["Bench", "BenchOptions"]
