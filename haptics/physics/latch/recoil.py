"""What the wrist of a TacTiles glove feels when the pin latches off: a decaying envelope of vibration (thesis 3.5.1, Fig 3.3).

Measured on a pendulum of 40 g that carried one tactor, sampled at 3200 Hz, each of 20 switches shifted so that the maximum
acceleration falls on 0: ``a(t) = 10 g exp(-t/tau)``, with ``tau`` set by what lies between the magnet and the off plate.

An output model, apart from the flight in ``latch``, for two reasons. Linear drag that gives the 6 ms flight and still switches
robustly cannot also let the ringing die in 5.9 ms, so one equation of motion would have to give up one of the two. And the
envelope is no net motion: integrated, the bare one would hand the pendulum 0.023 N s, a hundred times what a magnet of 0.35 g
brings along at the 0.66 m/s of ``latch``. So nothing here feeds back to the pin, and no speed is to be got from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptics.physics.fitted import ROUNDING, refuse_outside
from haptics.physics.parameters import Parameters, parameter
from haptics.units import STANDARD_GRAVITY_M_S2, in_range, one_of

SURFACES: tuple[str, ...] = ("bare", "silicone", "foam")
"""What the magnet lands on at the off plate. The glove uses foam."""
SAMPLE_RATE_HZ = 3200.0
"""Rate of the accelerometer in thesis 3.5.1."""
_LONGEST_S = 1.0


@dataclass(frozen=True)
class RecoilParameters(Parameters):
    """Peak and decay of the recoil. The peak is stated for the bare plate and taken for the damped ones too."""

    peak_g: float = parameter(10.0, "g", "stated", "thesis 3.4.4, Fig 3.3; for damped plates assumed", low=0.0, high=1e4)
    tau_bare_s: float = parameter(5.9e-3, "s", "stated", "thesis 3.5.1", low=1e-6, high=10.0)
    tau_silicone_s: float = parameter(4.1e-3, "s", "stated", "thesis 3.5.1, 1 mm PDMS", low=1e-6, high=10.0)
    tau_foam_s: float = parameter(1.8e-3, "s", "stated", "thesis 3.5.1, 1 mm foam", low=1e-6, high=10.0)
    pendulum_kg: float = parameter(40e-3, "kg", "stated", "thesis 3.5.1: the mass the peak holds for", low=1e-6, high=1e3)
    speed_power: float = parameter(1.0, "1", "assumed", "peak goes with impact speed to this power", low=0.0, high=4.0)

    def tau_s(self, surface: str) -> float:
        """Decay time of a surface.

        :param surface: bare, silicone or foam.
        :return: time constant (s).
        :raises InputError: an unknown surface.
        """
        taus = {"bare": self.tau_bare_s, "silicone": self.tau_silicone_s, "foam": self.tau_foam_s}
        return taus[one_of("surface", surface, SURFACES)]


RECOIL = RecoilParameters()


@dataclass(frozen=True)
class RecoilPrediction:
    """The recoil of one switch.

    :param surface: that the magnet lands on.
    :param tau_s: decay time (s).
    :param relative_speed: impact speed over that of a nominal switch.
    :param peak_g: peak of the envelope (g).
    :param peak_m_s2: the same (m/s2).
    :param above_tenth_s: how long it stays above a tenth of its peak (s).
    :param pendulum_kg: mass that the peak holds for (kg).
    :param sample_rate_hz: of the samples (Hz).
    :param times_s: of the samples (s), the first at the impact.
    :param acceleration_m_s2: the envelope there (m/s2).
    :param valid: False with ``reasons`` where the impact is not the one that was measured.
    :param reasons: one sentence each.
    """

    surface: str
    tau_s: float
    relative_speed: float
    peak_g: float
    peak_m_s2: float
    above_tenth_s: float
    pendulum_kg: float
    sample_rate_hz: float
    times_s: tuple[float, ...]
    acceleration_m_s2: tuple[float, ...]
    valid: bool
    reasons: tuple[str, ...]


def recoil_m_s2(
    time_s: float,
    surface: str = "foam",
    relative_speed: float = 1.0,
    parameters: RecoilParameters = RECOIL,
    *,
    extrapolate: bool = False,
) -> float:
    """Envelope of the acceleration after the impact: ``peak v^n exp(-t/tau)``, 0 before it (thesis 3.5.1, Fig 3.3).

    :param time_s: from the impact (s), any finite time.
    :param surface: bare, silicone or foam.
    :param relative_speed: impact speed over that of a nominal switch, ``v``; measured at 1 only.
    :param parameters: peak and decay.
    :param extrapolate: True: scale to other speeds, 0 to 10, by the assumed power.
    :return: acceleration (m/s2) of the 40 g pendulum.
    :raises InputError: an unknown surface, a number outside its range, or another speed than 1 without ``extrapolate``.
    """
    tau_s = parameters.tau_s(surface)
    in_range("relative_speed", relative_speed, 0.0, 10.0)
    if not extrapolate:
        refuse_outside(f"relative_speed = {relative_speed:g}", _outside_measured(relative_speed))
    since_s = in_range("time_s", time_s, -math.inf, math.inf, "s")
    if since_s < 0.0:
        return 0.0
    peak = parameters.peak_g * STANDARD_GRAVITY_M_S2 * relative_speed**parameters.speed_power
    return peak * math.exp(-since_s / tau_s)


def predict_recoil(
    surface: str = "foam",
    relative_speed: float = 1.0,
    length_s: float = 10e-3,
    sample_rate_hz: float = SAMPLE_RATE_HZ,
    parameters: RecoilParameters = RECOIL,
) -> RecoilPrediction:
    """The recoil of one switch, sampled as an accelerometer would from the moment of impact.

    :param surface: bare, silicone or foam.
    :param relative_speed: impact speed over that of a nominal switch, 0 to 10.
    :param length_s: of the samples (s), 0 to 1; both ends are sampled if they fall on a sample.
    :param sample_rate_hz: 1 Hz to 1 MHz.
    :param parameters: peak and decay.
    :return: the prediction; not ``valid`` at another speed than 1.
    :raises InputError: as ``recoil_m_s2``, or a length or rate outside its range.
    """
    in_range("length_s", length_s, 0.0, _LONGEST_S, "s")
    in_range("sample_rate_hz", sample_rate_hz, 1.0, 1e6, "Hz")
    peak = recoil_m_s2(0.0, surface, relative_speed, parameters, extrapolate=True)
    tau_s = parameters.tau_s(surface)
    # A length of whole samples must not lose its last one to rounding.
    times_s = tuple(k / sample_rate_hz for k in range(math.floor(length_s * sample_rate_hz * (1 + 1e-12)) + 1))
    reasons = _outside_measured(relative_speed)
    return RecoilPrediction(
        surface=surface,
        tau_s=tau_s,
        relative_speed=relative_speed,
        peak_g=peak / STANDARD_GRAVITY_M_S2,
        peak_m_s2=peak,
        above_tenth_s=tau_s * math.log(10.0) if peak > 0.0 else 0.0,
        pendulum_kg=parameters.pendulum_kg,
        sample_rate_hz=sample_rate_hz,
        times_s=times_s,
        acceleration_m_s2=tuple(recoil_m_s2(t, surface, relative_speed, parameters, extrapolate=True) for t in times_s),
        valid=not reasons,
        reasons=reasons,
    )


def _outside_measured(relative_speed: float) -> tuple[str, ...]:
    """What about an impact lies outside what was measured."""
    if abs(relative_speed - 1.0) <= ROUNDING:
        return ()
    return (f"recoil was measured at the nominal impact only; at {relative_speed:g} of its speed it is scaled by assumption",)
