"""The supply rig's curves: a charge with its closed form, power against frequency, capacitance against travel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from haptics.physics.brake.charging import DRIVE, Charging, DriveParameters, eq44_power_w, rise_time_s
from haptics.physics.brake.parameters import BRAKE, capacitance_f, overlap_sensitivity_f_per_m
from rigs.fitting import Vector
from rigs.result import Plot, Series, series
from rigs.supply.curves import crossing_s

if TYPE_CHECKING:
    from rigs.supply.faults import SupplyRun
    from rigs.supply.fit import SupplyFit

_PUBLISHED_CHARGE_S, _PUBLISHED_V = 50e-3, 1500.0
_PUBLISHED_POWER_W, _PUBLISHED_SD_W, _PUBLISHED_HZ = 0.057, 0.5e-3, 20.0  # half of the last digit printed


def supply_plots(fit: SupplyFit, record: SupplyRun, name: str) -> tuple[Plot, ...]:
    """All of them; travel only where a stage made some.

    :param fit: of the run.
    :param record: of the run.
    :param name: of the rig, the first word of each plot's name.
    :return: charge, power, and overlap where there was a stage.
    """
    plots = [charge_plot(fit, name), power_plot(fit, name)]
    if fit.overlap is not None:
        plots.append(overlap_plot(fit, record, name))
    return tuple(plots)


def charge_plot(fit: SupplyFit, name: str) -> Plot:
    """The first charge, with the current-limited ramp that the fitted values make, and what the thesis prints.

    :param fit: of the run.
    :param name: of the rig.
    :return: volts over time.
    """
    trace = fit.charges[0]
    last = fit.held(trace).stop
    top_v = fit.settled_v[0]
    # Begun so long before half of the volts as the fit takes to there: no place on the ramp is known better.
    half_s = crossing_s(trace, fit.held(trace).start, 0.5 * top_v, (0.3 * top_v, 0.7 * top_v))
    since_s = trace.time_s[:last] - half_s + rise_time_s(top_v, fit.capacitance_f[0], fitted_drive(fit), 0.5, fit.losses.probe_s)
    shown = (since_s > -1e-3) & (since_s < _PUBLISHED_CHARGE_S)
    seconds, volts = since_s[shown], trace.height[:last][shown]
    model_v = charging_volts(fit, seconds)
    ideal_s = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity) * _PUBLISHED_V / DRIVE.supply_current_a
    return Plot(
        name=f"{name}-charge",
        title=f"From 0 to {fit.asked_v:.0f} V",
        x_label="time (ms)",
        y_label="volts on the output (V)",
        series=(
            series("measured", "measured", 1e3 * seconds, volts),
            series("fit: ramp of the limiting current", "fit", 1e3 * seconds, model_v),
            series("computed: C V / I of 4.7.1", "published", [0.0, 1e3 * ideal_s], [0.0, _PUBLISHED_V]),
            series("printed: charged in 50 ms (4.7.1)", "published", [1e3 * _PUBLISHED_CHARGE_S], [_PUBLISHED_V], [0.0]),
        ),
        residuals=(series("measured less fit", "measured", 1e3 * seconds, volts - model_v),),
        residual_label="residual (V)",
    )


def charging_volts(fit: SupplyFit, seconds: Vector) -> Vector:
    """Volts (n,) at times after charging began, in closed form with the fitted values; 0 before.

    :param fit: of the run.
    :param seconds: since the charge began (n,), s.
    :return: (n,), V.
    """
    charging = Charging(fit.settled_v[0], fit.capacitance_f[0], fit.losses.probe_s, fitted_drive(fit))
    return np.array([charging.charge(0.0, max(0.0, float(one))).u_v for one in seconds])


def fitted_drive(fit: SupplyFit) -> DriveParameters:
    """Supply and bridge as measured; the stray capacitance is in the output's.

    :param fit: of the run.
    :return: parameters for the models of charging.
    """
    losses = fit.losses
    return DRIVE.with_values(
        supply_current_a=fit.limit_a[0],
        output_resistance_ohm=max(losses.output_ohm, 1.0),
        bleeder_ohm=min(1.0 / max(losses.bleeder_s, 1e-15), 1e15),
        stray_f=0.0,
    )


def power_plot(fit: SupplyFit, name: str) -> Plot:
    """Power against frequency at the two highest volts, beside Eq 4.4 and what two charges a period take.

    :param fit: of the run.
    :param name: of the rig.
    :return: power over frequency.
    """
    drawn: list[Series] = []
    tall = sorted({point.phase.volts for point in fit.powers if point.phase.volts >= 0.6 * fit.asked_v}, reverse=True)
    c_f = fit.capacitance_f[0]
    for volts in tall:
        points = [point for point in fit.powers if point.phase.volts == volts]
        hertz = np.array([point.phase.frequency_hz for point in points])
        at_v = volts * fit.settled_v[0] / fit.asked_v
        eq44_w = np.array([eq44_power_w(at_v, one, c_f) for one in hertz])
        power_mw = np.array([1e3 * point.power_w for point in points])
        sd_mw = np.array([1e3 * point.sd_w for point in points])
        drawn += [
            series(f"{volts:.0f} V: mean of v i", "measured", hertz, power_mw, 2.0 * sd_mw),
            series(f"{volts:.0f} V: C V² f, clamped and sagging", "fit", hertz, 2e3 * eq44_w),
            series(f"{volts:.0f} V: C V² f / 2 (Eq 4.4)", "published", hertz, 1e3 * eq44_w),
        ]
        if volts == fit.asked_v:
            steady_mw = [1e3 * point.steady_w for point in points]
            drawn += [
                series(f"{volts:.0f} V: its charge at the set volts", "measured", hertz, steady_mw),
                series(f"{volts:.0f} V: 2 C V² f, clamped and steady", "fit", hertz, 4e3 * eq44_w),
            ]
    printed = "printed: 57 mW at 1500 V and 20 Hz (4.7.1)"
    drawn.append(series(printed, "published", [_PUBLISHED_HZ], [1e3 * _PUBLISHED_POWER_W], [1e3 * _PUBLISHED_SD_W]))
    return Plot(f"{name}-power", "Power at the supply's output", "frequency (Hz)", "power (mW)", tuple(drawn))


def overlap_plot(fit: SupplyFit, record: SupplyRun, name: str) -> Plot:
    """Capacitance against travel: ramps, the board's own telemetry, and the derived slope.

    :param fit: of the run, with an overlap.
    :param record: of the run.
    :param name: of the rig.
    :return: capacitance over travel.
    """
    assert fit.overlap is not None
    travel_m, c_f, sd_f = (np.array(column) for column in zip(*fit.travelled, strict=True))
    stops = [phase for phase in fit.phases if phase.kind == "travel"]
    board_pf = [float(np.median([message.capacitance[record.channel] for message in record.said(phase)])) for phase in stops]
    line_f = fit.overlap.at(travel_m)
    derived_f = fit.overlap.whole_f - overlap_sensitivity_f_per_m() * np.maximum(0.0, travel_m - fit.overlap.slack_m)
    return Plot(
        name=f"{name}-overlap",
        title="Capacitance while the strips are pulled apart",
        x_label="travel of the stage (mm)",
        y_label="capacitance (pF)",
        series=(
            series("measured by ramps, stray included", "measured", 1e3 * travel_m, 1e12 * c_f, 2e12 * sd_f),
            series("reported by the board, stray taken off", "measured", 1e3 * travel_m, board_pf),
            series("fit", "fit", 1e3 * travel_m, 1e12 * line_f),
            series("derived: 23.2 pF/mm", "published", 1e3 * travel_m, 1e12 * derived_f),
        ),
        residuals=(series("measured less fit", "measured", 1e3 * travel_m, 1e12 * (c_f - line_f)),),
        residual_label="residual (pF)",
    )
