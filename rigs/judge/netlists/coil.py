"""Coils of their own resistance and inductance on one supply whose resistance they share, pins held.

::

    V0 --R_shared-- rail --+-- switch up ---+-- terminal k --(Vmeter k)-- R_k -- L_k -- 0
                           |  switch down --+-- 0
                           +-- (each coil alike)

A held pin makes no back-voltage, so each coil obeys ``L i' = v - R i`` with ``v`` at its terminal: the rail while the coil is on,
0 V afterwards, when its bridge shorts it.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.latch.parameters import LatchParameters
from haptics.units import in_range
from rigs.judge.transient import Transient

SWITCH_ON_OHM, SWITCH_OFF_OHM = 1e-6, 1e9
"""A switch that is on is a millionth of a coil's ohm; one that is off takes nanoamperes beside amperes."""


@dataclass(frozen=True)
class CoilRun:
    """All ``coils`` switched on at 0 s, off at ``on_s``, and watched until ``end_s``; only their R and L count.

    :param coils: at least one.
    :param volts: of the supply without load, 1 mV to 1 kV.
    :param shared_ohm: resistance that the coils share, 0 to 1 kohm.
    :param on_s: length of the pulse, 1 us to 10 s.
    :param end_s: end of the run, s, after ``on_s``.
    :raises InputError: no coil, or a number out of range.
    """

    coils: tuple[LatchParameters, ...]
    volts: float
    shared_ohm: float
    on_s: float
    end_s: float

    def __post_init__(self) -> None:
        if not self.coils:
            raise InputError("0 coils given; at least 1 is needed")
        in_range("volts", self.volts, 1e-3, 1e3, "V")
        in_range("shared_ohm", self.shared_ohm, 0.0, 1e3, "ohm")
        in_range("on_s", self.on_s, 1e-6, 10.0, "s")
        in_range("end_s", self.end_s, self.on_s * 1.001, 100.0, "s")

    @property
    def transient(self) -> Transient:
        """How the simulator follows the run through time."""
        return Transient(self.end_s, self.end_s / 200.0)


def coil_netlist(run: CoilRun) -> str:
    """The netlist of ``run``. It saves ``v(rail)`` and, for each coil k, its terminal ``v(tk)`` and current ``i(Vmeterk)``.

    :param run: to simulate.
    :return: text of the netlist.
    """
    coils = range(len(run.coils))
    flux = max(coil.inductance_h * run.volts / coil.resistance_ohm for coil in run.coils)
    lines = [
        "* coils on one supply",
        f"Vsupply v0 0 {run.volts!r}",
        # No shared resistance: a source without voltage, for a resistor of 0 ohm is none.
        f"Rshared v0 rail {run.shared_ohm!r}" if run.shared_ohm else "Vshared v0 rail 0",
        "Vone one 0 1",
        f"Von on 0 {run.transient.source([(0.0, 1.0), (run.on_s, 0.0)])}",
    ]
    for k, coil in enumerate(run.coils):
        lines += [
            f"Sup{k} rail t{k} on 0 switch",
            f"Sdown{k} t{k} 0 one on switch",
            f"Vmeter{k} t{k} c{k} 0",
            f"R{k} c{k} d{k} {coil.resistance_ohm!r}",
            f"L{k} d{k} 0 {coil.inductance_h!r} ic=0",
        ]
    lines += [
        f".model switch sw(ron={SWITCH_ON_OHM} roff={SWITCH_OFF_OHM} vt=0.5 vh=0)",
        f".save v(rail) {' '.join(f'v(t{k}) i(Vmeter{k})' for k in coils)}",
        *run.transient.lines(flux, 1e-9),
    ]
    return "\n".join(lines) + "\n"
