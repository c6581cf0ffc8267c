"""The brake's supply, bridge and clutches as a circuit of current source, diodes, switches, resistors and capacitors.

::

    set --+--(Ilimit)-- src --|>|-- busi -(Vmeter)- bus --+--------+------- a switch up ---+-- leg --R_out-- load
          +-----|<|------+                             R_b   C_reservoir  a switch down --+-- 0         (same for leg b)
                                                                          load --+-- C_stray, each C and its leak --+-- leg b

The current source floats on the set voltage: what the bus does not take flows back through the clamp diode, and the series
diode lets nothing back in from the bus. So the bus gets at most the limit, at most the set voltage, and never sinks. Where the
bus may sag (clamped reversal) the supply's power is that of ``bus`` and ``Vmeter``; where the set voltage has to stand while a
regulator behind it limits (direct reversal) it is that of ``Vset``, which gives what the regulator draws.

Each leg of the bridge is either up (on the bus) or down (grounded): plus is up and down, minus down and up, a short down twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.brake.system import BrakeSystem
from haptics.units import VACUUM_PERMITTIVITY_F_PER_M, in_range
from rigs.judge.transient import Transient

SWITCH_ON_OHM, SWITCH_OFF_OHM = 1.0, 1e13
"""Two switches that are on are 1e-4 of the 20 kohm they stand in series with; four that are off take 1e-10 of the current."""
DIODE_EMISSION = 0.05
"""Emission coefficient of the diodes: the two drop 26 mV each at 500 uA, in opposite senses, so that they count as ideal."""
DIODE_SATURATION_A = 1e-12
LONGEST_STEP_S = 50e-6


@dataclass(frozen=True)
class BrakeRun:
    """What is done to a brake from time 0 on, all of it at 0 V then: setpoints ``(time, volts)``, the first at 0 s.

    The wave goes on in phase through all setpoints; 0 Hz is constant voltage. All clutches of ``system`` are driven.

    :param system: brake and drive; all its outputs are driven.
    :param frequency_hz: of the square wave, Hz; 0 is constant voltage.
    :param end_s: end of the run, 1 us to 1 h.
    :param leaks_ohm: leak of each output, ohm; empty for none.
    :param setpoints: from when (s) and volts (V), the first at 0 s.
    :raises InputError: setpoints not in order or not from 0 s on, leaks that do not match the outputs, or a number out of range.
    """

    system: BrakeSystem
    setpoints: tuple[tuple[float, float], ...]
    frequency_hz: float
    end_s: float
    leaks_ohm: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        times = [time for time, _ in self.setpoints]
        if not times or times[0] != 0.0 or times != sorted(set(times)):
            raise InputError(f"setpoints at {times} s; expected the first at 0 s, each later than the one before")
        for _, volts in self.setpoints:
            in_range("volts", volts, 0.0, self.system.drive.supply_volts, "V")
        in_range("frequency_hz", self.frequency_hz, 0.0, self.system.drive.bridge_hz, "Hz")
        in_range("end_s", self.end_s, 1e-6, 3600.0, "s")
        if self.leaks_ohm and len(self.leaks_ohm) != self.system.outputs:
            raise InputError(f"{len(self.leaks_ohm)} leaks given; expected none, or {self.system.outputs}, one for each output")

    @property
    def transient(self) -> Transient:
        """How the simulator follows the run through time."""
        return Transient(self.end_s, min(LONGEST_STEP_S, self.end_s / 50.0))

    @property
    def total_f(self) -> float:
        """All that hangs on the bridge."""
        return self.system.drive.stray_f + sum(self.system.capacitance_f(k) for k in range(self.system.outputs))

    @property
    def max_v(self) -> float:
        """Maximum of the setpoints, V."""
        return max(volts for _, volts in self.setpoints)


def brake_netlist(run: BrakeRun) -> str:
    """The netlist of ``run``, from its ``system``'s parameters. It saves load, leg b, bus, set volts, supply currents.

    :param run: to simulate.
    :return: text of the netlist.
    """
    system, drive = run.system, run.system.drive
    leg_a, leg_b = bridge_legs(run)
    full_c = max(1e-12, run.total_f * run.max_v)
    lines = [
        "* bipolar drive of electrostatic clutches",
        f"Vset set 0 {run.transient.source(run.setpoints)}",
        f"Ilimit set src DC {drive.supply_current_a!r}",
        "Dclamp src set ideal",
        "Dseries src busi ideal",
        "Vmeter busi bus 0",
        f"Rbleeder bus 0 {drive.bleeder_ohm!r}",
        *([f"Creservoir bus 0 {drive.reservoir_f!r} ic=0"] if drive.reservoir_f else []),
        "Vone one 0 1",
        f"Vlega ca 0 {run.transient.source(leg_a)}",
        f"Vlegb cb 0 {run.transient.source(leg_b)}",
        "Sup_a bus a ca 0 switch",
        "Sdown_a a 0 one ca switch",
        "Sup_b bus b cb 0 switch",
        "Sdown_b b 0 one cb switch",
        f"Rout a load {drive.output_resistance_ohm!r}",
        *([f"Cstray load b {drive.stray_f!r} ic=0"] if drive.stray_f else []),
        *[f"C{k} load b {{{_plates(system, k)}}} ic=0" for k in range(system.outputs)],
        *[f"Rleak{k} load b {ohm!r}" for k, ohm in enumerate(run.leaks_ohm)],
        f".model ideal d(is={DIODE_SATURATION_A} n={DIODE_EMISSION})",
        f".model switch sw(ron={SWITCH_ON_OHM} roff={SWITCH_OFF_OHM} vt=0.5 vh=0)",
        ".save v(load) v(b) v(bus) v(set) i(Vmeter) i(Vset)",
        *run.transient.lines(full_c, 2e-8 * drive.supply_current_a),
    ]
    return "\n".join(lines) + "\n"


def bridge_legs(run: BrakeRun) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Controls of legs a and b as steps ``(from when, 1 up or 0 down)``: plus for a quarter period, then minus, plus and so on.

    Before each reversal but with direct reversal both are down, for the clamp time or a tenth of a half period if that is less.

    :param run: its wave and clamp time.
    :return: steps of leg a, and of leg b.
    """
    leg_a, leg_b = [(0.0, 1.0)], [(0.0, 0.0)]
    if run.frequency_hz == 0.0:
        return leg_a, leg_b
    half_s = 0.5 / run.frequency_hz
    clamp_s = min(run.system.drive.clamp_s, 0.1 * half_s) if run.system.reversal == "clamped" else 0.0
    up, down, reversals = leg_a, leg_b, 0
    # Half a half period first; a reversal at the very end is left out.
    while (at_s := (0.5 + reversals) * half_s) < run.end_s * (1.0 - 1e-12):
        up.append((at_s, 0.0))
        down.append((at_s + clamp_s, 1.0))
        up, down, reversals = down, up, reversals + 1
    return leg_a, leg_b


def _plates(system: BrakeSystem, output: int) -> str:
    """Capacitance as an expression for the simulator to work out (Eq 4.1)."""
    brake = system.brake
    area = f"{system.strips}*{system.overlap_m2(output)!r}"
    return f"{VACUUM_PERMITTIVITY_F_PER_M}*{brake.permittivity!r}*{area}/{brake.thickness_m!r}"
