"""The independent judge: the electrical and thermal models against ngspice, a circuit simulator that others wrote."""

from rigs.judge.compare import Judgement, judge
from rigs.judge.ngspice import ngspice_version

__all__ = ["Judgement", "judge", "ngspice_version"]
