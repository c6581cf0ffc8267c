"""What the host knows of a glove, and how old that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from haptics.link.events import Telemetry
from haptics.session.glove import Glove
from haptics.time import NS_PER_S

STALE_S = 0.1
"""Telemetry comes each 20 ms; what is older than five of them, as long as a dead-man, says nothing of now."""


@dataclass(frozen=True, slots=True)
class GloveState:
    """What the host knows of the glove now.

    ``rise_k`` is an upper bound of each actuator's rise, and ``headroom_k`` a lower bound of the room under its limit: an
    actuator without calibration is booked as the warmest within tolerance (``docs/explanation/heat.md``). ``pins_out``: by what
    boards acknowledged. ``volts``, ``capacitance_pf``: what the brake controller measured; None where that is older than
    ``STALE_S``, or nothing came yet.
    ``telemetry_age_s``: age of each board's last telemetry, None if none came; ``stale`` names the boards whose is too old.
    ``armed``: boards that said they armed, and said nothing else since. ``notes``: limits that a board holds tighter than
    configured, coils that started warm.
    """

    time_ns: int
    rise_k: dict[str, float]
    headroom_k: dict[str, float]
    pins_out: tuple[str, ...]
    volts: dict[str, float | None]
    capacitance_pf: dict[str, int | None]
    armed: tuple[str, ...]
    faults: tuple[str, ...]
    telemetry_age_s: dict[str, float | None]
    stale: tuple[str, ...]
    notes: tuple[str, ...] = ()


def glove_state(glove: Glove, last: Mapping[str, Telemetry], more_faults: Sequence[str] = ()) -> GloveState:
    """A snapshot. ``last``: the last telemetry of each board. ``more_faults``: what others than the boards report."""
    now_ns = glove.now_ns()
    age_s = {name: (now_ns - last[name].time_ns) / NS_PER_S if name in last else None for name in glove.links}
    stale = tuple(name for name, age in age_s.items() if age is None or age > STALE_S)
    array, brake = glove.tactiles, glove.brakes
    names: Sequence[str] = () if brake is None else brake.channels
    measured = None if "brake" in stale or "brake" not in last else last["brake"].message
    return GloveState(
        time_ns=now_ns,
        rise_k={} if array is None else dict(zip(array.sites, array.rises_k(now_ns), strict=True)),
        headroom_k={} if array is None else dict(zip(array.sites, array.headrooms_k(now_ns), strict=True)),
        pins_out=() if array is None else tuple(s for s, out in zip(array.sites, array.pins_out(), strict=True) if out),
        volts={name: None if measured is None else measured.output[i] for i, name in enumerate(names)},
        capacitance_pf={name: None if measured is None else measured.capacitance[i] for i, name in enumerate(names)},
        armed=tuple(name for name, link in glove.links.items() if link.armed),
        faults=(*glove.faults, *more_faults),
        telemetry_age_s=age_s,
        stale=stale,
        notes=tuple(glove.notes),
    )
