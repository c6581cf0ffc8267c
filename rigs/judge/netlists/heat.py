"""Heat as a network of resistors and capacitors: a volt is a kelvin of rise, an ampere a watt, the room is ground.

::

    one node:   P --> rise --+-- c --- 0        two nodes:  P --> coil --+-- 1/G --+-- body --+-- c --- 0
                             +-- tau/c - 0                               +-- C_c - 0          +-- C_b - 0
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.errors import InputError
from haptics.physics.thermal.one_node import ThermalParameters
from haptics.physics.thermal.two_node import TwoNodeParameters
from haptics.units import in_range
from rigs.judge.transient import Steps, Transient


@dataclass(frozen=True)
class HeatRun:
    """An actuator at the room's temperature, then power as a staircase ``(from when, W)``, the first at 0 s.

    :param parameters: of one or two nodes.
    :param powers: from when (s) and power (W), the first at 0 s.
    :param end_s: end of the run, 1 us to 1e6 s.
    :param longest_s: maximum step of the simulator, s, at most ``end_s``.
    :raises InputError: power that does not begin at 0 s, or a number out of range.
    """

    parameters: ThermalParameters | TwoNodeParameters
    powers: Steps
    end_s: float
    longest_s: float

    def __post_init__(self) -> None:
        if not self.powers or self.powers[0][0] != 0.0:
            raise InputError("power does not begin at 0 s; expected the first stair at 0 s")
        in_range("end_s", self.end_s, 1e-6, 1e6, "s")
        in_range("longest_s", self.longest_s, 1e-9, self.end_s, "s")

    @property
    def transient(self) -> Transient:
        """How the simulator follows the run through time."""
        return Transient(self.end_s, self.longest_s)


def heat_netlist(run: HeatRun) -> str:
    """The netlist of ``run``. It saves ``v(body)`` and, of two nodes, ``v(coil)``.

    :param run: to simulate.
    :return: text of the netlist.
    """
    p = run.parameters
    if isinstance(p, TwoNodeParameters):
        # The body's capacity is what is left of tau: the sum of the network's two time constants.
        body = f"({p.tau_s!r}-{p.coil_j_per_k!r}*(1/{p.coupling_w_per_k!r}+{p.c_k_per_w!r}))/{p.c_k_per_w!r}"
        nodes = [
            f"Ccoil coil 0 {p.coil_j_per_k!r} ic=0",
            f"Rcoupling coil body {{1/{p.coupling_w_per_k!r}}}",
            f"Cbody body 0 {{{body}}} ic=0",
        ]
        heated = "coil"
    else:
        nodes = [f"Cbody body 0 {{{p.tau_s!r}/{p.c_k_per_w!r}}} ic=0"]
        heated = "body"
    lines = [
        "* heat of one actuator",
        f"Ipower 0 {heated} {run.transient.source(run.powers)}",
        *nodes,
        f"Rroom body 0 {p.c_k_per_w!r}",
        f".save v(body){' v(coil)' if heated == 'coil' else ''}",
        *run.transient.lines(full_heat_j(run), 1e-9),
    ]
    return "\n".join(lines) + "\n"


def full_heat_j(run: HeatRun) -> float:
    """An upper bound of the heat that is stored at any time: what came in, or what the maximum power would hold in steady state.

    :param run: parameters and powers.
    :return: J.
    """
    spans = zip(run.powers, [*[at for at, _ in run.powers[1:]], run.end_s], strict=True)
    came_in_j = sum(watts * (until - at) for (at, watts), until in spans)
    return min(came_in_j, max(watts for _, watts in run.powers) * run.parameters.tau_s)
