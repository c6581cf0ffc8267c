"""What a host believes of a device: the published figures, or what a bench measured with its own uncertainty.

=====================  ============================================  =====================================================
measured               the host uses it for                          where it goes today
=====================  ============================================  =====================================================
tau, c, power          the heat account of an actuator               ``glove.toml``, ``tactiles.calibration`` of the site
travel out and back    the lead with which a pin is sent             nowhere: ``session`` takes one lead for all actuators
k, threshold           volts for a force                             a brake's own calibration in ``glove.toml``
capacitance            how long a brake takes to close               nowhere yet
=====================  ============================================  =====================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from haptics.physics.brake.force_laws import INDEX_THRESHOLD, ThresholdLaw
from haptics.physics.brake.parameters import BRAKE, capacitance_f
from haptics.physics.brake.system import BrakeSystem
from haptics.physics.latch.pulse import travel_s
from haptics.physics.parameters import Parameters, parameter
from haptics.physics.thermal.one_node import PULSE_POWER_W, THERMAL, ThermalParameters
from rigs.tolerance.draws import Device
from rigs.tolerance.heat import Body
from rigs.tolerance.pin import bare, pin


@dataclass(frozen=True)
class BenchUncertainty(Parameters):
    """Standard deviation of what a bench reports of one device; errors are normal and independent.

    :raises InputError: a negative value, or one so large that the measurement could come out without meaning.
    """

    tau_s: float = parameter(1.0, "s", "assumed", "fit of a heating and cooling curve", low=0.0, high=10.0)
    c_k_per_w: float = parameter(1.5, "K/W", "assumed", "fit of the same curve", low=0.0, high=8.0)
    power_share: float = parameter(0.01, "1", "assumed", "shunt and supply reading", low=0.0, high=0.1)
    force_constant_share: float = parameter(0.03, "1", "assumed", "k of a pull test at several volts", low=0.0, high=0.1)
    threshold_v: float = parameter(5.0, "V", "assumed", "volts below which there is no force", low=0.0, high=20.0)
    capacitance_share: float = parameter(0.02, "1", "assumed", "the board's own self test", low=0.0, high=0.1)
    travel_s: float = parameter(0.1e-3, "s", "assumed", "accelerometer on a pendulum", low=0.0, high=1e-3)


NOISES = 8
"""Numbers drawn for one device's measurements."""


@dataclass(frozen=True)
class Host:
    """What the host assumes of one device.

    :param out_s: travel of the pin toward the skin, s.
    :param back_s: travel back, s.
    :param body: heat of the actuator.
    :param brake: in set volts: the supply's gain is within its constants.
    """

    out_s: float
    back_s: float
    body: Body
    brake: BrakeSystem

    def volts_for(self, force_n: float) -> float:
        """Volts to set for a force, by the law believed. The driver rounds them to whole volts, which is left out.

        :param force_n: N, above the force without volts.
        :return: V, not rounded.
        """
        brake = self.brake
        return brake.laws[0].volts_for(force_n, brake.overlap_m2(0), brake.brake.thickness_m, extrapolate=True)


@cache
def published_host() -> Host:
    """A host without any calibration: one model for every device, a pin without skin.

    :return: the same for every device.
    """
    return Host(travel_s("off-on"), travel_s("on-off"), Body(THERMAL, PULSE_POWER_W), BrakeSystem(laws=(INDEX_THRESHOLD,)))


def calibrated_host(device: Device, bench: BenchUncertainty, noise: Sequence[float]) -> Host:
    """A host with what a bench measured of this device, on the bench: pins without a skin, the brake in set volts.

    :param device: as it really is.
    :param bench: uncertainty of what was measured.
    :param noise: ``NOISES`` standard normal numbers.
    :return: what the host assumes then.
    """
    tau, c, power, k, threshold, capacitance, out, back = noise
    alone = pin(bare(device.latch), device.coil_supply_v)
    thermal = ThermalParameters(
        tau_s=device.thermal.tau_s + bench.tau_s * tau,
        c_k_per_w=device.thermal.c_k_per_w + bench.c_k_per_w * c,
    )
    return Host(
        out_s=alone.out.arrival_s + bench.travel_s * out,
        back_s=alone.back.arrival_s + bench.travel_s * back,
        body=Body(thermal, alone.power_w * (1.0 + bench.power_share * power)),
        brake=_measured_brake(device, bench, k, threshold, capacitance),
    )


def _measured_brake(device: Device, bench: BenchUncertainty, k: float, threshold: float, capacitance: float) -> BrakeSystem:
    """A brake of the published thickness with the force, threshold and capacitance that were found."""
    law, real = device.brake.laws[0], device.brake.brake
    assert isinstance(law, ThresholdLaw)
    thinner = BRAKE.thickness_m / real.thickness_m
    k_n_v2 = law.k_n_v2 * real.overlap_m2 / BRAKE.overlap_m2 * (thinner * device.volts_gain) ** 2
    threshold_v = law.threshold_v / (thinner * device.volts_gain)
    measured_f = device.brake.capacitance_f(0) * (1.0 + bench.capacitance_share * capacitance)
    overlap_m2 = measured_f / capacitance_f(1.0, BRAKE.thickness_m, BRAKE.permittivity)
    measured = ThresholdLaw(
        k_n_v2 * (1.0 + bench.force_constant_share * k) * BRAKE.overlap_m2 / overlap_m2,  # the law is per published overlap
        threshold_v + bench.threshold_v * threshold,
    )
    return BrakeSystem(brake=BRAKE.with_values(overlap_m2=overlap_m2), laws=(measured,))
