"""What the plants behind simulated boards do, in SI units and by name: the truth that no board and no driver sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class PlantTruth:
    """What the simulated glove is now. Mappings are empty for a board that is hardware or is not there.

    :param time_ns: on the glove's clock, ns.
    :param rise_k: temperature rise of each coil above the room, by site, K.
    :param pins_out: sites whose pin rests on the skin.
    :param switches: how often each pin has switched, by site.
    :param coil_energy_j: taken up by each coil since the board's boot, by site, J.
    :param volts: at each output now, signed, by brake, V.
    :param force_n: what each brake holds, by brake, N.
    :param brake_energy_j: taken up by each output, by brake, J.
    :param vibrating: brakes whose fingertip piezo vibrates.
    """

    time_ns: int
    rise_k: Mapping[str, float]
    pins_out: tuple[str, ...]
    switches: Mapping[str, int]
    coil_energy_j: Mapping[str, float]
    volts: Mapping[str, float]
    force_n: Mapping[str, float]
    brake_energy_j: Mapping[str, float]
    vibrating: tuple[str, ...]


def plant_truth(
    time_ns: int,
    sites: Sequence[str],
    brakes: Sequence[str],
    array: Mapping[str, Any] | None,
    brake: Mapping[str, Any] | None,
) -> PlantTruth:
    """The plants' own state, by name.

    :param time_ns: on the glove's clock, ns.
    :param sites: of the array's channels.
    :param brakes: names of the brake controller's outputs.
    :param array: ``SimulatedPort.truth`` of the array's board, or None.
    :param brake: that of the brake controller, or None.
    :return: the same, by site and brake.
    """
    coils: Mapping[str, Any] = {} if array is None else array
    outputs: Mapping[str, Any] = {} if brake is None else brake
    return PlantTruth(
        time_ns=time_ns,
        rise_k=_by_name(sites, coils.get("rise_k", ())),
        pins_out=tuple(site for site, state in _by_name(sites, coils.get("latched", ())).items() if state == "on"),
        switches=_by_name(sites, coils.get("switches", ())),
        coil_energy_j=_by_name(sites, coils.get("energy_j", ())),
        volts=_by_name(brakes, outputs.get("volts", ())),
        force_n=_by_name(brakes, outputs.get("capacity_n", ())),
        brake_energy_j=_by_name(brakes, outputs.get("energy_j", ())),
        vibrating=tuple(name for name, on in _by_name(brakes, outputs.get("piezo", ())).items() if on),
    )


def _by_name(names: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    return dict(zip(names, values, strict=False))
