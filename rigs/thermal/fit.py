"""The heating curve fitted: first-order heat behind a first-order thermocouple, warmed by the energy that was measured.

::

    x' = (c P - x) / tau        rise of the actuator; P in every 20 ms by the pulses' measured energy, of a cold coil
    y' = (x - y) / lag          rise of the junction
    T  = T0 + d t + y           what is read; d is the room's drift

``c`` is kelvin for each watt that a cold coil takes, as in the source, whose 0.36 W are 18 W a pulse all along: a warm coil takes
less from 5 V, and what that does to the curve is in ``c``. ``c_taken`` counts the watts really taken at the end of heating, and
``c_nominal`` divides the rise by the nominal 0.36 W whatever this coil's resistance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.physics.thermal.one_node import PULSE_ENERGY_J
from rigs.coil_current import POWER_SD, PulseRecord
from rigs.fitting import Fit, Vector, least_squares_fit, quadrature
from rigs.instruments.thermocouple import DRIFT_SD_K_S, GAIN_SD, LAG_S, LAG_SD_S
from rigs.result import Quantity

NOMINAL_W = 0.36
"""Mean power of the published curve (thesis 3.5.2)."""
CELL_S = 20e-3
_SMOOTH_S = 2.0


@dataclass(frozen=True)
class HeatFit:
    """The fit, and what it was made from.

    :param fit: of ``tau_s, c_k_per_w, lag_s, room_c, drift_k_s``.
    :param pulses: as they were played.
    """

    fit: Fit
    pulses: PulseRecord
    cold_w: float
    """Power of a cold pulse."""
    warm_w: float
    """Power of a pulse at the end of heating."""
    model: Vector
    """Temperature at each sample (m,), the room's drift left out."""

    @property
    def power_w(self) -> float:
        """Mean power of heating, counted as a cold coil takes it."""
        return self.cold_w * self.pulses.length_s * self.rate_hz

    @property
    def rate_hz(self) -> float:
        """Commanded switches a second, Hz."""
        start_s = self.pulses.start_s
        return (len(start_s) - 1) / float(start_s[-1] - start_s[0])

    @property
    def lag_s(self) -> float:
        """Lag of the thermocouple's junction, s."""
        return self.fit.value("lag_s")

    @property
    def reduced_chi2(self) -> float:
        """Of the whole curve."""
        return self.fit.reduced_chi2

    @property
    def c_sd(self) -> float:
        """Of the fit, the thermocouple's gain, and the power, together."""
        c = self.fit.value("c_k_per_w")
        return quadrature((self.fit.sd("c_k_per_w"), c * GAIN_SD, c * POWER_SD))

    @property
    def rise_reached_k(self) -> float:
        """Maximum rise of the fitted curve above its beginning."""
        return float(self.model.max() - self.model[0])

    def worst_at_s(self, seconds: Vector) -> float:
        """When the misfit, averaged over 5 s, has its maximum.

        :param seconds: of the samples (m,), s.
        :return: time of the maximum misfit, s.
        """
        smooth = np.convolve(self.fit.residuals, np.full(50, 0.02), "same")
        return float(seconds[int(np.argmax(np.abs(smooth)))])

    def quantities(self) -> dict[str, Quantity]:
        """What the rig is for.

        :return: by name; s, K, W and K/W.
        """
        fit, power_w = self.fit, self.power_w
        c, taken = fit.value("c_k_per_w"), self.cold_w / self.warm_w
        rise_sd = quadrature((fit.sd("c_k_per_w") * power_w, c * power_w * GAIN_SD))
        return {
            "tau_s": Quantity(fit.value("tau_s"), fit.sd("tau_s"), "s"),
            "c_k_per_w": Quantity(c, self.c_sd, "K/W"),
            "rise_max_k": Quantity(c * power_w, rise_sd, "K"),
            "c_nominal_k_per_w": Quantity(c * power_w / NOMINAL_W, rise_sd / NOMINAL_W, "K/W"),
            "c_taken_k_per_w": Quantity(c * taken, self.c_sd * taken, "K/W"),
            "nominal_power_w": Quantity(self.rate_hz * PULSE_ENERGY_J, 0.0, "W"),
            "power_w": Quantity(power_w, power_w * POWER_SD, "W"),
            "pulse_power_w": Quantity(self.cold_w, self.cold_w * POWER_SD, "W"),
            "lag_s": Quantity(fit.value("lag_s"), fit.sd("lag_s"), "s"),
        }

    def notes(self) -> tuple[str, ...]:
        """What a reader should know.

        :return: sentences for the page.
        """
        return (
            f"A pulse takes {self.cold_w:.2f} W when cold and {self.warm_w:.2f} W at the end of heating. c counts cold watts, as "
            f"the source does, c_taken those really taken; c_nominal divides by {NOMINAL_W:g} W whatever this coil's resistance.",
        )


def fit_heat(seconds: Vector, celsius: Vector, pulses: PulseRecord, noise_k: float) -> HeatFit:
    """Fit ``tau``, ``c``, the junction's lag, the room and its drift.

    :param seconds: of the samples (n,).
    :param celsius: what was read (n,).
    :param pulses: on the same clock.
    :param noise_k: standard deviation of one sample.
    :return: the fit, with standard deviations.
    :raises InputError: too little was recorded to fit.
    """
    from scipy.signal import lfilter

    room_c = float(celsius[: max(10, len(celsius) // 50)].mean())
    rise_k = _smooth_rise_k(seconds, celsius, pulses.start_s) - room_c
    cold_w, per_k = pulses.power(rise_k)
    cells = int(np.ceil((seconds[-1] - seconds[0]) / CELL_S)) + 1
    edges = seconds[0] + CELL_S * np.arange(cells + 1)
    power_w = np.histogram(pulses.start_s + 0.5 * pulses.length_s, bins=edges)[0] * cold_w * pulses.length_s / CELL_S

    def model(values: Vector) -> Vector:
        tau_s, c, lag_s, room_c, drift = values
        kept, kept_lag = np.exp(-CELL_S / tau_s), np.exp(-CELL_S / lag_s)
        rise = np.asarray(lfilter([1.0 - kept], [1.0, -kept], c * power_w))  # at the end of each cell
        seen = np.asarray(lfilter([1.0 - kept_lag], [1.0, -kept_lag], rise))
        return room_c + drift * seconds + np.interp(seconds, edges[1:], seen, left=0.0)

    fit = least_squares_fit(
        model,
        celsius,
        noise_k,
        {"tau_s": 100.0, "c_k_per_w": 60.0, "lag_s": LAG_S, "room_c": room_c, "drift_k_s": 0.0},
        priors={"lag_s": (LAG_S, LAG_SD_S * 3.0), "drift_k_s": (0.0, DRIFT_SD_K_S)},
        bounds={"tau_s": (1.0, 5000.0), "c_k_per_w": (0.0, 5000.0), "lag_s": (1e-3, 60.0)},
    )
    drift = fit.value("drift_k_s") * seconds
    return HeatFit(fit, pulses, cold_w, cold_w / (1.0 + per_k * float(rise_k[-1])), model(fit.values) - drift)


def _smooth_rise_k(seconds: Vector, celsius: Vector, at_s: Vector) -> Vector:
    """The reading at some times, averaged over ``_SMOOTH_S``."""
    width = max(1, round(_SMOOTH_S * len(seconds) / (seconds[-1] - seconds[0])))
    padded = np.pad(celsius, (width // 2, width - 1 - width // 2), mode="edge")
    return np.interp(at_s, seconds, np.convolve(padded, np.full(width, 1.0 / width), "valid"))
