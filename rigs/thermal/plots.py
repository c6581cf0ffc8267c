"""The thermal rig's curves: temperature over time with the fit, and beside it what the thesis' numbers would give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from haptics.physics.thermal.one_node import THERMAL
from rigs.fitting import Vector
from rigs.result import Plot, series
from rigs.thermal.fit import NOMINAL_W, HeatFit

if TYPE_CHECKING:
    from rigs.thermal.record import ThermalRun

_DRAWN = 400


def heat_plots(seconds: Vector, celsius: Vector, fit: HeatFit, record: ThermalRun, name: str) -> tuple[Plot, ...]:
    """Heating and cooling (Fig 3.4), and the power that made it.

    :param seconds: of the samples (m,), s.
    :param celsius: what was read (m,), degrees Celsius.
    :param fit: of the run.
    :param record: of the run.
    :param name: of the rig, the first word of each plot's name.
    :return: temperature over time, and power of the pulses.
    """
    some = np.linspace(0, len(seconds) - 1, _DRAWN).astype(int)
    drift = fit.fit.value("drift_k_s") * seconds
    heat_s = tuple((at_ns - record.start_ns) / 1e9 for at_ns in record.heat_ns)
    room_c = fit.fit.value("room_c")
    published_k = _published_rise_k(seconds[some], heat_s)
    band_k = 2.0 * published_k * THERMAL.c_sd_k_per_w / THERMAL.c_k_per_w
    curve = Plot(
        name=f"{name}-curve",
        title="Heating at 2 Hz for 6 min, then cooling",
        x_label="time (s)",
        y_label="temperature (°C)",
        series=(
            series("measured", "measured", seconds[some], celsius[some]),
            series("fit", "fit", seconds[some], fit.model[some] + drift[some]),
            series(
                "published: tau 102 s, c 69 ± 10 K/W at 0.36 W (3.5.2), 2 sd",
                "published",
                seconds[some][::20],
                (room_c + published_k)[::20],
                band_k[::20],
            ),
        ),
        residuals=(series("measured less fit", "measured", seconds[some], fit.fit.residuals[some]),),
        residual_label="residual (K)",
    )
    pulses = fit.pulses
    inner = pulses.inner
    power = Plot(
        name=f"{name}-power",
        title="Power of a pulse, as telemetry met it",
        x_label="time (s)",
        y_label="power (W)",
        series=(
            series("measured", "measured", pulses.start_s[pulses.pulse[inner]], (pulses.current_a * pulses.volts)[inner]),
            series("of a cold coil", "fit", pulses.start_s[[0, -1]], np.array([fit.cold_w, fit.cold_w])),
            series("published: 18 W (3.4.3)", "published", pulses.start_s[[0, -1]], np.array([18.0, 18.0])),
        ),
    )
    return curve, power


def _published_rise_k(seconds: Vector, heat_s: tuple[float, ...]) -> Vector:
    """The published law at its own numbers, from the beginning of heating."""
    tau_s, top_k = THERMAL.tau_s, THERMAL.c_k_per_w * NOMINAL_W
    since, after = np.maximum(seconds - heat_s[0], 0.0), np.maximum(seconds - heat_s[1], 0.0)
    rise = top_k * -np.expm1(-np.minimum(since, heat_s[1] - heat_s[0]) / tau_s)
    return rise * np.exp(-after / tau_s)
