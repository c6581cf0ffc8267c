"""What the supply rig reports: quantities, with the gains of probe and stage in their uncertainties."""

from __future__ import annotations

import math

from haptics.physics.brake.charging import eq44_power_w
from rigs.fitting import quadrature
from rigs.instruments.probe import CLOCK_SD, DIVIDER_SD, LOAD_SD, SHUNT_SD
from rigs.instruments.stage import POSITION_GAIN_SD
from rigs.result import Quantity
from rigs.supply.fit import DISCHARGED_V, SupplyFit


def supply_quantities(fit: SupplyFit) -> dict[str, Quantity]:
    """All of them, with gains of the probe in their uncertainties.

    :param fit: of the run.
    :return: by name, in SI units; what could not be resolved is left out.
    """
    settled_v, settled_sd = fit.settled_v
    limit_a, limit_sd = fit.limit_a
    c_f, c_sd, _ = fit.capacitance_f
    held_a, held_sd = fit.held_a
    probe_a = settled_v * fit.load_s
    losses, times = fit.losses, fit.times_s()
    t90_s, t90_sd = times["t90"]
    ramp_s, ramp_sd = times["ramp"]
    supply_v = settled_v + losses.output_ohm * probe_a
    gains = quadrature((DIVIDER_SD, SHUNT_SD, CLOCK_SD))
    limit_share = quadrature((limit_sd / limit_a, SHUNT_SD))
    cvi_s = c_f * settled_v / limit_a  # both gains cancel: coulombs over amperes of one shunt
    found = {
        "capacitance_f": Quantity(c_f, quadrature((c_sd, c_f * gains)), "F"),
        "supply_current_a": Quantity(limit_a, limit_a * limit_share, "A"),
        "slope_v_s": Quantity(
            0.7 * settled_v / ramp_s, 0.7 * settled_v / ramp_s * quadrature((DIVIDER_SD, ramp_sd / ramp_s)), "V/s"
        ),
        "t90_s": Quantity(t90_s, t90_sd, "s"),
        "charge_s": Quantity(cvi_s, cvi_s * quadrature((c_sd / c_f, limit_sd / limit_a, CLOCK_SD)), "s"),
        "volts_gain": Quantity(supply_v / fit.asked_v, quadrature((settled_sd, supply_v * DIVIDER_SD)) / fit.asked_v, "1"),
        "held_current_a": Quantity(
            held_a - probe_a, quadrature((held_sd, held_a * SHUNT_SD, probe_a * LOAD_SD, probe_a * DIVIDER_SD)), "A"
        ),
    }
    if fit.supply_decay.resolved:
        r_sd = quadrature((fit.output_ohm_sd, losses.output_ohm * gains))
        found["output_resistance_ohm"] = Quantity(losses.output_ohm, r_sd, "ohm")
    if fit.discharge.resolved:
        ratio = math.log(settled_v / DISCHARGED_V)
        found["discharge_s"] = Quantity(
            fit.discharge.tau_s * ratio, quadrature((fit.discharge.sd_s * ratio, fit.discharge.tau_s * DIVIDER_SD)), "s"
        )
    return found | _power_quantities(fit, c_f, c_sd) | _overlap_quantities(fit)


def _power_quantities(fit: SupplyFit, c_f: float, c_sd: float) -> dict[str, Quantity]:
    at = [one for one in fit.powers if one.phase.frequency_hz == 20.0 and one.phase.volts == fit.asked_v]
    if not at:
        return {}
    point = at[0]
    gains = quadrature((DIVIDER_SD, SHUNT_SD))
    eq44_w = eq44_power_w(fit.settled_v[0], 20.0, c_f)
    of_both = quadrature((c_sd / c_f, CLOCK_SD, gains))
    ratio = point.power_w / eq44_w
    apart = math.sqrt(max((point.sd_w / point.power_w) ** 2 - gains**2, 0.0))
    return {
        "power_20hz_w": Quantity(point.power_w, point.sd_w, "W"),
        "steady_power_20hz_w": Quantity(point.steady_w, point.steady_w * gains, "W"),
        "eq44_20hz_w": Quantity(eq44_w, eq44_w * of_both, "W"),
        "power_over_eq44": Quantity(ratio, ratio * quadrature((apart, c_sd / c_f, CLOCK_SD)), "1"),
    }


def _overlap_quantities(fit: SupplyFit) -> dict[str, Quantity]:
    overlap = fit.overlap
    if overlap is None:
        return {}
    gains = quadrature((DIVIDER_SD, SHUNT_SD, CLOCK_SD, POSITION_GAIN_SD))
    sd = quadrature((overlap.sensitivity_sd, overlap.sensitivity_f_m * gains))
    return {"sensitivity_f_m": Quantity(overlap.sensitivity_f_m, sd, "F/m")}
