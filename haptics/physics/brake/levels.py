"""Brakes from setpoint to fingertip, at four levels of fidelity with one interface (``BrakePlant``) and one parameter set.

=========  ==========================================  ===========================  ==========================================
level      force                                       finger                       for
=========  ==========================================  ===========================  ==========================================
static     the law's, a fixed delay later              slow, no mass                long sweeps, scheduling
lagged     closed-form volts, exact lag on a grid      slow, elasto-plastic play    boards, loops at 1 kHz (default)
dynamic    as lagged                                   mass, implicit friction      stick and slip, pull tests, transients
reference  lag, volts and finger by an adaptive        mass, events for stick,      judging the others
           Runge-Kutta method of order 8               slip and slack
=========  ==========================================  ===========================  ==========================================

All have volts, charge and energy from the same closed form (``OutputStage``).
"""

from __future__ import annotations

from haptics.errors import InputError
from haptics.physics.brake.lagged import LaggedBrakes
from haptics.physics.brake.plant import BrakePlant
from haptics.physics.brake.static import StaticBrakes
from haptics.physics.brake.system import BrakeSystem
from haptics.units import one_of

LEVELS: tuple[str, ...] = ("static", "lagged", "dynamic", "reference")


def brake_plant(
    level: str = "lagged",
    system: BrakeSystem | None = None,
    *,
    start_s: float = 0.0,
    step_s: float | None = None,
    friction: str = "coulomb",
    compiled: bool = True,
) -> BrakePlant:
    """Brakes at rest and shorted, hands at 0 m, to be driven and pulled through time.

    :param level: one of ``LEVELS``.
    :param system: everything there is to know about the brakes; one published brake if left out.
    :param start_s: time at the start (s), in any one clock, within 1e9.
    :param step_s: of the stepped levels (s), 1 us to 100 ms; their own default if left out (1 ms, 0.5 ms, 50 us).
    :param friction: of ``dynamic``: coulomb or lugre.
    :param compiled: of ``dynamic``: False runs the loops as plain Python.
    :return: a plant of that level.
    :raises InputError: an unknown level or friction, a step outside its range, or one for ``reference``, which has none.
    """
    one_of("level", level, LEVELS)
    one_of("friction", friction, ("coulomb", "lugre"))
    system = BrakeSystem() if system is None else system
    stepped = {} if step_s is None else {"step_s": step_s}
    if level == "static":
        return StaticBrakes(system, start_s, **stepped)
    if level == "lagged":
        return LaggedBrakes(system, start_s, **stepped)
    if level == "dynamic":
        from haptics.physics.brake.dynamic import DynamicBrakes

        return DynamicBrakes(system, start_s, friction=friction, compiled=compiled, **stepped)
    if step_s is not None:
        raise InputError(f"step_s = {step_s!r} s; level reference chooses its own steps: leave step_s out")
    from haptics.physics.brake.reference import ReferenceBrakes

    return ReferenceBrakes(system, start_s)
