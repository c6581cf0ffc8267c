"""What the published forces show of each law of the brake, where each may be used, and which one is the default and why.

The rule: a law that the points reject on any finger (probability of so great a chi squared below 0.05) is out. Of the others,
those within 4 of the best in chi squared summed over the fingers (two standard deviations) cannot be distinguished by these
points; of them the simplest is taken. Simpler is: fewer parameters, then linear in them (one optimum) with a closed inverse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from haptics.physics.brake.fit import FITS, PUBLISHED_POINTS, ForceFit, LeftOut, Points, leave_one_out, point_sd_n
from haptics.physics.brake.fitted_law import ForceLaw
from haptics.physics.brake.force_laws import FINGERS, Covariance, default_law, force_law
from haptics.physics.brake.parameters import BRAKE
from haptics.units import one_of

SIMPLEST_FIRST = ("ideal", "threshold", "closing_gap")
REJECTED_BELOW = 0.05
TIED_WITHIN = 4.0
Span = tuple[float, float]


@dataclass(frozen=True)
class LawValidity:
    """Where a law of the package may be believed: minimum and maximum of each quantity.

    Overlap, thickness, permittivity and strips were measured at one value each; away from it a law scales by its own formula,
    untested.

    :param use: "interpolation" (the points bear it out between them), "upper_bound" (it lies above all of them) or "none".
    :param volts: span of the points (V).
    :param force_n: span of the points (N).
    :param overlap_m2: measured (m2).
    :param thickness_m: measured (m).
    :param permittivity: measured, relative.
    :param strips: measured, stacked pairs.
    :param frequency_hz: of the drive, 10 or 20 Hz (thesis 4.4.3).
    :param max_error: largest departure from a point of the span, as a share of that point.
    """

    use: str
    volts: Span
    force_n: Span
    overlap_m2: Span
    thickness_m: Span
    permittivity: Span
    strips: Span
    frequency_hz: Span
    max_error: float


@dataclass(frozen=True)
class PointResidual:
    """One published point and what the fitted law makes of it.

    :param volts: of the point.
    :param measured_n: force published there (N).
    :param fitted_n: by the law (N).
    :param residual_n: law less point (N).
    :param residual_sigma: the same in standard deviations of the point.
    """

    volts: float
    measured_n: float
    fitted_n: float
    residual_n: float
    residual_sigma: float


@dataclass(frozen=True)
class LawEvidence:
    """One law on one finger: fit, residuals, leave-one-out, validity.

    :param law: its name.
    :param finger: index or thumb.
    :param names: of the fitted parameters.
    :param values: in the order of ``names``, SI.
    :param sds: their standard deviations.
    :param covariance: of the values.
    :param points: the published points, with residuals.
    :param chi2: of the fit.
    :param degrees_of_freedom: points less parameters.
    :param reduced_chi2: chi squared for each degree of freedom, None without one.
    :param p_value: probability of a chi squared this large if the law holds, None without a degree of freedom.
    :param left_out: each point predicted by the others.
    :param left_out_rms_n: root mean square of the errors that could be had (N), None if none could.
    :param left_out_rms_sigma: the same in standard deviations.
    :param shipped_chi2: of the law as ``force_law`` gives it, which for the ideal law is with the stated friction, not the fitted
        one.
    :param validity: where it may be believed.
    :param default: whether it is the finger's default law.
    """

    law: str
    finger: str
    names: tuple[str, ...]
    values: tuple[float, ...]
    sds: tuple[float, ...]
    covariance: Covariance
    points: tuple[PointResidual, ...]
    chi2: float
    degrees_of_freedom: int
    reduced_chi2: float | None
    p_value: float | None
    left_out: tuple[LeftOut, ...]
    left_out_rms_n: float | None
    left_out_rms_sigma: float | None
    shipped_chi2: float
    validity: LawValidity
    default: bool


@dataclass(frozen=True)
class LawStanding:
    """One law over all fingers.

    :param law: its name.
    :param chi2: summed over the fingers.
    :param degrees_of_freedom: summed over the fingers.
    :param behind_chi2: its chi squared less the best law's.
    :param rejected: the points of some finger reject it.
    :param tied_with_best: these points cannot distinguish it from the best law.
    """

    law: str
    chi2: float
    degrees_of_freedom: int
    behind_chi2: float
    rejected: bool
    tied_with_best: bool


@dataclass(frozen=True)
class LawComparison:
    """The standings and the choice.

    :param standings: of every law, simplest first.
    :param chosen: law that the rule takes, None if the points reject all.
    :param why: in one sentence, with the numbers.
    """

    standings: tuple[LawStanding, ...]
    chosen: str | None
    why: str


def law_evidence(law: str, finger: str = "index") -> LawEvidence:
    """What the published points of a finger show of a law.

    :param law: ideal, threshold or closing_gap.
    :param finger: index or thumb.
    :return: the evidence.
    :raises InputError: an unknown law or finger.
    """
    one_of("law", law, SIMPLEST_FIRST)
    points = PUBLISHED_POINTS[one_of("finger", finger, FINGERS)]
    fitted, shipped, left_out = FITS[law](points), force_law(finger, law), leave_one_out(law, points)
    return LawEvidence(
        law=law,
        finger=finger,
        names=fitted.names,
        values=fitted.values,
        sds=fitted.sds,
        covariance=fitted.covariance,
        points=tuple(
            PointResidual(volts, force_n, force_n + residual_n, residual_n, residual_n / point_sd_n(force_n))
            for (volts, force_n), residual_n in zip(points, fitted.residuals_n, strict=True)
        ),
        chi2=fitted.chi2,
        degrees_of_freedom=fitted.degrees_of_freedom,
        reduced_chi2=fitted.reduced_chi2,
        p_value=_p_value(fitted),
        left_out=left_out,
        left_out_rms_n=_rms([one.error_n for one in left_out if one.error_n is not None]),
        left_out_rms_sigma=_rms([one.error_sigma for one in left_out if one.error_sigma is not None]),
        shipped_chi2=_chi2(shipped, points),
        validity=_validity(shipped, points, 0 if law == "ideal" else len(fitted.names)),
        default=default_law(finger).name == law,
    )


def compare_laws(points: Mapping[str, Points] = PUBLISHED_POINTS) -> LawComparison:
    """Which law the rule at the top takes.

    :param points: by finger; every law is fitted to each finger by itself and chi squared is summed.
    :return: the comparison.
    :raises InputError: too few points on a finger, or nonsense in one.
    """
    fits = {law: [FITS[law](of) for of in points.values()] for law in SIMPLEST_FIRST}
    chi2s = {law: sum(fit.chi2 for fit in of) for law, of in fits.items()}
    best = min(chi2s, key=lambda law: chi2s[law])
    standings = tuple(
        LawStanding(
            law=law,
            chi2=chi2s[law],
            degrees_of_freedom=sum(fit.degrees_of_freedom for fit in of),
            behind_chi2=chi2s[law] - chi2s[best],
            rejected=any(p is not None and p < REJECTED_BELOW for p in map(_p_value, of)),
            tied_with_best=chi2s[law] - chi2s[best] < TIED_WITHIN,
        )
        for law, of in fits.items()
    )
    allowed = [one for one in standings if one.tied_with_best and not one.rejected]
    chosen = allowed[0].law if allowed else None
    listed = ", ".join(
        f"{one.law} {one.chi2:.2f}/{one.degrees_of_freedom}{' (rejected)' if one.rejected else ''}" for one in standings
    )
    if chosen is None:
        reason = "the points reject the law that fits best"
    elif len(allowed) > 1:
        apart = max(one.behind_chi2 for one in allowed)
        names = " and ".join(one.law for one in allowed)
        reason = f"{names} differ by {apart:.2f}, less than {TIED_WITHIN:g}, and {chosen} is simpler"
    else:
        reason = f"{chosen} alone is neither rejected nor {TIED_WITHIN:g} or more behind the best"
    return LawComparison(standings, chosen, f"chi squared over degrees of freedom, all fingers: {listed}; {reason}")


def _validity(law: ForceLaw, points: Points, fitted_parameters: int) -> LawValidity:
    volts, forces = [v for v, _ in points], [f for _, f in points]
    if _exceeded(_chi2(law, points), len(points) - fitted_parameters) >= REJECTED_BELOW:
        use = "interpolation"
    else:
        use = "upper_bound" if all(law.force_n(v) >= f for v, f in points) else "none"
    return LawValidity(
        use=use,
        volts=(min(volts), max(volts)),
        force_n=(min(forces), max(forces)),
        overlap_m2=(BRAKE.overlap_m2, BRAKE.overlap_m2),
        thickness_m=(BRAKE.thickness_m, BRAKE.thickness_m),
        permittivity=(BRAKE.permittivity, BRAKE.permittivity),
        strips=(1, 1),
        frequency_hz=(10.0, 20.0),
        max_error=max(abs(law.force_n(v) / f - 1.0) for v, f in points),
    )


def _chi2(law: ForceLaw, points: Points) -> float:
    return sum(((law.force_n(v) - f) / point_sd_n(f)) ** 2 for v, f in points)


def _p_value(fitted: ForceFit) -> float | None:
    return _exceeded(fitted.chi2, fitted.degrees_of_freedom) if fitted.degrees_of_freedom else None


def _exceeded(chi2: float, degrees_of_freedom: int) -> float:
    """Probability of a chi squared larger than this."""
    from scipy import stats  # pyright: ignore[reportMissingTypeStubs]

    distribution: Any = stats.chi2
    return float(distribution.sf(chi2, degrees_of_freedom))


def _rms(values: list[float]) -> float | None:
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else None
