"""What the host knows of a glove, and how old that is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from haptics.link.events import Telemetry
from haptics.link.messages import State
from haptics.link.readings import (
    BrakeLimits,
    BrakeTelemetry,
    Identity,
    TactilesLimits,
    TactilesTelemetry,
    identity_of,
    telemetry_of,
)
from haptics.session.configuration import BrakeConfiguration
from haptics.session.devices import Devices
from haptics.session.switching import Kind
from haptics.time import NS_PER_S

STALE_S = 0.1
"""Telemetry comes each 20 ms; what is older than five of them, as long as a dead-man, is no news of now."""


@dataclass(frozen=True, slots=True)
class GloveState:
    """What the host knows of the glove now. Mappings are by site or by name of a brake, and empty for a board that is not there.

    :param time_ns: on the glove's clock, ns.
    :param rise_k: upper bound of each coil's temperature rise, K: a tactor without calibration is booked as the warmest within
        tolerance (``docs/explanation/heat.md``).
    :param headroom_k: lower bound of the room under its limit, K.
    :param pulses_left: pulses that each coil still takes at the present rate, that of its last two, or at once where it has none;
        None where it can go on for ever.
    :param pins_out: sites whose pin is out, or may be, by what the board acknowledged.
    :param volts: at each output as the brake controller measured it, V: the amplitude, or less for the moment in which the square
        wave turns over. None where that is older than ``STALE_S``, or never came.
    :param force_n: what each brake holds by its force law, N: at the amplitude that the controller drives, else at ``volts``. It
        comes within some 50 ms of the drive (contact and charging). None likewise.
    :param force_sd_n: standard deviation of that by the fit of the law, N; 0 for a calibrated brake.
    :param capacitance_pf: as the brake controller measured it, pF; None likewise.
    :param armed: boards that reported to be armed, and nothing else since.
    :param doing: what is under way: ``arm``, ``off``, ``clear`` or ``retire``; None: nothing.
    :param latched: by board, faults that are latched, as it reported last; arming is refused while there are any.
    :param faults: what went wrong since the glove was opened, in words; a history.
    :param telemetry_age_s: age of each board's last telemetry, s; None if none came.
    :param stale: boards whose telemetry is too old.
    :param notes: what a person should know besides: limits that a board holds tighter than configured, coils that started warm,
        what was found of an earlier host, a board that is there again.
    """

    time_ns: int
    rise_k: Mapping[str, float]
    headroom_k: Mapping[str, float]
    pulses_left: Mapping[str, int | None]
    pins_out: tuple[str, ...]
    volts: Mapping[str, float | None]
    force_n: Mapping[str, float | None]
    force_sd_n: Mapping[str, float | None]
    capacitance_pf: Mapping[str, int | None]
    armed: tuple[str, ...]
    doing: Kind | None
    latched: Mapping[str, tuple[str, ...]]
    faults: tuple[str, ...]
    telemetry_age_s: Mapping[str, float | None]
    stale: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GloveTelemetry:
    """The last telemetry of each board.

    :param tactiles: of the tactor array; None if none came, or the glove has none.
    :param brake: of the brake controller, likewise.
    """

    tactiles: TactilesTelemetry | None
    brake: BrakeTelemetry | None


@dataclass(frozen=True, slots=True)
class GloveIdentity:
    """Who the boards are, and the limits that they enforce.

    :param tactiles: the board of the tactor array; None if the glove has none.
    :param brake: the brake controller, likewise.
    """

    tactiles: Identity[TactilesLimits] | None
    brake: Identity[BrakeLimits] | None


def glove_state(
    devices: Devices, brake: BrakeConfiguration, last: Mapping[str, Telemetry], more_faults: Sequence[str] = ()
) -> GloveState:
    """A snapshot.

    :param devices: of the glove.
    :param brake: force laws.
    :param last: the last telemetry of each board.
    :param more_faults: what others than the boards report.
    :return: what is known now.
    """
    now_ns = devices.now_ns()
    age_s = {name: (now_ns - last[name].time_ns) / NS_PER_S if name in last else None for name in devices.links}
    stale = tuple(name for name, age in age_s.items() if age is None or age > STALE_S)
    array, brakes = devices.tactiles, devices.brakes
    names: Sequence[str] = () if brakes is None else brakes.channels
    measured = None if "brake" in stale or "brake" not in last else last["brake"].message
    volts = {name: None if measured is None else measured.output[i] for i, name in enumerate(names)}
    driven = {} if brakes is None or measured is None or measured.state != State.DRIVING else brakes.engaged()
    shared_v = max(driven.values(), default=0.0)  # outputs that are on have the bus, whatever each asked for
    held_v = {name: shared_v if driven.get(name) else v for name, v in volts.items()}
    laws = {name: brake.law(name) for name in names}

    def by_law(name: str, figure: Callable[..., float]) -> float | None:
        """A figure of the force law at the volts that hold; None where nobody knows them."""
        v = held_v[name]
        return None if v is None else figure(v, laws[name][1], extrapolate=True)

    return GloveState(
        time_ns=now_ns,
        rise_k={} if array is None else dict(zip(array.sites, array.rises_k(now_ns), strict=True)),
        headroom_k={} if array is None else dict(zip(array.sites, array.headrooms_k(now_ns), strict=True)),
        pulses_left={} if array is None else dict(zip(array.sites, array.pulses_left(now_ns), strict=True)),
        pins_out=() if array is None else tuple(s for s, out in zip(array.sites, array.pins_out(), strict=True) if out),
        volts=volts,
        force_n={name: by_law(name, law.force_n) for name, (law, _) in laws.items()},
        force_sd_n={name: by_law(name, law.force_sd_n) for name, (law, _) in laws.items()},
        capacitance_pf={name: None if measured is None else measured.capacitance[i] for i, name in enumerate(names)},
        armed=tuple(name for name, link in devices.links.items() if link.armed),
        doing=devices.doing,
        latched={name: faults for name, faults in devices.latched.items() if faults},
        faults=(*devices.faults, *more_faults),
        telemetry_age_s=age_s,
        stale=stale,
        notes=tuple(devices.notes),
    )


def glove_telemetry(last: Mapping[str, Telemetry]) -> GloveTelemetry:
    """Telemetry in SI units.

    :param last: the last telemetry of each board.
    :return: the same by board.
    """
    found = {name: telemetry_of(one.message, one.time_ns) for name, one in last.items()}
    return GloveTelemetry(
        tactiles=cast(TactilesTelemetry | None, found.get("tactiles")), brake=cast(BrakeTelemetry | None, found.get("brake"))
    )


def glove_identity(devices: Devices) -> GloveIdentity:
    """Who the boards are.

    :param devices: of the glove.
    :return: the boards that it has.
    """
    found = {name: identity_of(link.identity) for name, link in devices.links.items()}
    return GloveIdentity(tactiles=found.get("tactiles"), brake=found.get("brake"))
