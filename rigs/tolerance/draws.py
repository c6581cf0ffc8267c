"""What varies from device to device, by how much, and the source.

Every ``+-`` is read as the half width of a uniform distribution, as the simulated boards read it; they draw the same coil
resistance, tau, c, brake force, overlap and volts. If a stated ``+-`` was a standard deviation, the spread of what it causes is
sqrt(3) times what is found here: ``spread=3**0.5`` shows that. The brake's +- 10 % was measured over several devices, so it holds
some of the overlap and thickness that are drawn besides: the sum is on the wide side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.contact import CONTACT
from haptics.physics.brake.finger import FINGER
from haptics.physics.brake.force_laws import INDEX_THRESHOLD, ThresholdLaw
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.latch.parameters import LATCH, NOMINAL_VOLTS, LatchParameters
from haptics.physics.parameters import Provenance
from haptics.physics.thermal.one_node import THERMAL, ThermalParameters
from haptics.units import one_of

MAX_SPREAD = 2.0
"""Of the half widths; every parameter keeps within what its model allows up to here."""
SKIN_N_M = 300.0
"""A fingertip under a pin (assumed, as in ``LatchParameters.skin_stiffness_n_m``)."""


@dataclass(frozen=True, slots=True)
class Varied:
    """One parameter that varies from device to device, uniformly by ``nominal +- half_width``.

    :param name: of the parameter.
    :param unit: of nominal and half width.
    :param nominal: mean.
    :param half_width: at a spread of 1.
    :param distribution: ``uniform``.
    :param provenance: of the half width.
    :param section: of the thesis; None for what is assumed.
    :param source: what it is and where it comes from.
    """

    name: str
    unit: str
    nominal: float
    half_width: float
    distribution: str
    provenance: Provenance
    section: str | None
    source: str


def _stated(name: str, unit: str, nominal: float, half_width: float, section: str, source: str) -> Varied:
    return Varied(name, unit, nominal, half_width, "uniform", "stated", section, source)


def _assumed(name: str, unit: str, nominal: float, half_width: float, source: str) -> Varied:
    return Varied(name, unit, nominal, half_width, "uniform", "assumed", None, source)


VARIED = (
    _stated("resistance_ohm", "ohm", LATCH.resistance_ohm, 0.1, "3.4.3", "coil, 1.38 +- 0.1 ohm"),
    _assumed("mass_kg", "kg", LATCH.mass_kg, 0.05 * LATCH.mass_kg, "5 %: magnet and glued pin"),
    _assumed("hold_on_n", "N", LATCH.hold_on_n, 0.05 * LATCH.hold_on_n, "5 %: plate at the skin side, magnet's grade"),
    _assumed("hold_off_n", "N", LATCH.hold_off_n, 0.05 * LATCH.hold_off_n, "5 %: off plate, foam's thickness"),
    _assumed("thrust_n_a", "N/A", LATCH.thrust_n_a, 0.05 * LATCH.thrust_n_a, "5 %: winding by hand, magnet's grade"),
    _assumed("drag_n_s_m", "N s/m", LATCH.drag_n_s_m, 0.1 * LATCH.drag_n_s_m, "10 %: fit of the pin in its guide"),
    _assumed("skin_stiffness_n_m", "N/m", SKIN_N_M, 0.25 * SKIN_N_M, "a quarter: the wearer's fingertip, not the device's"),
    _assumed("skin_at_m", "m", LATCH.skin_at_m, 0.1e-3, "0.1 mm: how the glove sits"),
    _assumed("coil_supply_v", "V", NOMINAL_VOLTS, 0.02 * NOMINAL_VOLTS, "2 %: regulator and leads"),
    _stated("tau_s", "s", THERMAL.tau_s, THERMAL.tau_sd_s, "3.5.2", "heat, 102 +- 5 s"),
    _stated("c_k_per_w", "K/W", THERMAL.c_k_per_w, THERMAL.c_sd_k_per_w, "3.5.2", "heat, 69 +- 10 K/W"),
    _stated("force_gain", "1", 1.0, 0.10, "4.7.3", "brake force, 20 N +- 10 % over several devices"),
    _assumed("threshold_v", "V", INDEX_THRESHOLD.threshold_v, 10.0, "10 V: as well as the law's fit knows it (Table 4.2)"),
    _assumed("overlap_m2", "m2", BRAKE.overlap_m2, 0.05 * BRAKE.overlap_m2, "5 %: how strips are cut and aligned"),
    _assumed("thickness_m", "m", BRAKE.thickness_m, 0.03 * BRAKE.thickness_m, "3 %: gauge of the film"),
    _assumed("volts_gain", "1", 1.0, 0.01, "1 %: volts made over volts asked for"),
    _assumed("supply_current_a", "A", DRIVE.supply_current_a, 0.05 * DRIVE.supply_current_a, "5 %: converter's limit"),
    _assumed("tau_on_s", "s", CONTACT.tau_on_s, 0.8e-3, "0.8 ms: contact's lag, closing"),
    _assumed("tau_off_s", "s", CONTACT.tau_off_s, 13e-3, "13 ms: from the 15 to 43 ms that the release leaves open (4.7.3)"),
    _assumed("slack_m", "m", FINGER.slack_m, 0.5e-3, "0.5 mm: how the strips are put on"),
)
"""Everything that varies, in the order in which it is drawn."""
NAMES = tuple(row.name for row in VARIED)
_LATCH = NAMES[: NAMES.index("coil_supply_v")]


@dataclass(frozen=True)
class Device:
    """One actuator and one brake as they really are.

    :param coil_supply_v: at the coil.
    :param volts_gain: of the high-voltage supply, made over asked for.
    :param latch: of the actuator.
    :param thermal: of the actuator.
    :param brake: with its law.
    """

    latch: LatchParameters
    coil_supply_v: float
    thermal: ThermalParameters
    brake: BrakeSystem
    volts_gain: float


def device(shifts: Sequence[float], spread: float = 1.0) -> Device:
    """The device whose parameters are ``nominal + spread * half_width * shift``, shifts in the order of ``VARIED``.

    Force gain is that of ``k`` in the threshold law; the few millinewton of a brake that is off stay as they are.

    :param shifts: -1 to 1 for each of ``VARIED``.
    :param spread: factor on the half widths, 0 to 2.
    :return: actuator and brake.
    """
    value = {row.name: row.nominal + spread * row.half_width * shift for row, shift in zip(VARIED, shifts, strict=True)}
    law = ThresholdLaw(INDEX_THRESHOLD.k_n_v2 * value["force_gain"], value["threshold_v"])
    brake = BrakeSystem(
        brake=BRAKE.with_values(overlap_m2=value["overlap_m2"], thickness_m=value["thickness_m"]),
        drive=DRIVE.with_values(supply_current_a=value["supply_current_a"]),
        contact=CONTACT.with_values(tau_on_s=value["tau_on_s"], tau_off_s=value["tau_off_s"]),
        finger=FINGER.with_values(slack_m=value["slack_m"]),
        laws=(law,),
    )
    return Device(
        latch=LATCH.with_values(**{name: value[name] for name in _LATCH}),
        coil_supply_v=value["coil_supply_v"],
        thermal=THERMAL.with_values(tau_s=value["tau_s"], c_k_per_w=value["c_k_per_w"]),
        brake=brake,
        volts_gain=value["volts_gain"],
    )


NOMINAL_DEVICE = device([0.0] * len(VARIED))


def checked_names(only: Sequence[str] | None) -> tuple[str, ...]:
    """``only`` if all of it varies, or everything that does.

    :param only: names to check; None is all.
    :return: the names, in the order given.
    :raises InputError: a name that does not vary.
    """
    return NAMES if only is None else tuple(one_of("only", name, NAMES) for name in only)
