"""A quantity over all devices: where its error lies, how many would notice, what a calibration takes away, what it comes from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigs.tolerance.felt import Quantity

Floats = NDArray[np.float64]
_CAUSES = 3
"""Named of each quantity, at most."""
_BY_CHANCE = 10.83
"""Over n: a squared correlation that one parameter in a thousand without any effect would pass (chi squared, one degree)."""


@dataclass(frozen=True)
class Spread:
    """Errors of one quantity over all devices, in its unit. All are nan if ``n`` is below 2.

    :param n: devices that have the error (a pin that fails does not arrive).
    :param mean: of the errors.
    :param sd: of the sample, n - 1.
    :param p2_5: 2.5th percentile.
    :param p97_5: 97.5th percentile.
    :param worst: the error of maximum magnitude, with its sign.
    :param beyond_jnd: share of the ``n`` whose error exceeds one just noticeable difference.
    """

    n: int
    mean: float
    sd: float
    p2_5: float
    p97_5: float
    worst: float
    beyond_jnd: float


@dataclass(frozen=True)
class Cause:
    """A parameter behind an error.

    :param parameter: its name.
    :param share: of the error's variance before calibration that is linear in it, 0 to 1.
    """

    parameter: str
    share: float


@dataclass(frozen=True)
class FeltRow:
    """One quantity over all devices.

    :param quantity: its name.
    :param unit: of the errors.
    :param nominal: value of the nominal device, in ``nominal_unit``.
    :param nominal_unit: of the value.
    :param jnd: just noticeable error, in ``unit``.
    :param jnd_source: provenance and source of ``jnd``.
    :param before: errors of a host without calibration.
    :param after: errors of a calibrated host.
    :param removed_share: ``1 - sd after / sd before``, negative if a calibration adds; None if there was no spread.
    :param causes: the largest that are not chance, largest first; what they leave is nonlinear, or comes of several parameters
        together.
    :param why: what a calibration can do about it.
    """

    quantity: str
    unit: str
    nominal: float
    nominal_unit: str
    jnd: float
    jnd_source: str
    before: Spread
    after: Spread
    removed_share: float | None
    causes: tuple[Cause, ...]
    why: str


def felt_row(quantity: Quantity, nominal: float, before: Floats, after: Floats, shifts: Mapping[str, Floats]) -> FeltRow:
    """Summary of a quantity's errors (devices,), nan where a device has none.

    :param quantity: that is felt.
    :param nominal: its value of the nominal device.
    :param before: errors without calibration (devices,); nan where a device has none.
    :param after: errors with calibration (devices,); nan likewise.
    :param shifts: of each parameter, (devices,).
    :return: the row.
    """
    was, left = spread_of(before, quantity.jnd), spread_of(after, quantity.jnd)
    return FeltRow(
        quantity=quantity.name,
        unit=quantity.unit,
        nominal=nominal,
        nominal_unit=quantity.value_unit,
        jnd=quantity.jnd,
        jnd_source=quantity.jnd_source,
        before=was,
        after=left,
        removed_share=1.0 - left.sd / was.sd if was.sd > 0.0 else None,
        causes=_causes(before, shifts) if was.sd > 0.0 else (),
        why=quantity.why,
    )


def spread_of(errors: Floats, jnd: float) -> Spread:
    """Statistics of errors (devices,), those that are nan left out.

    :param errors: (devices,); nan where a device has none.
    :param jnd: just noticeable error, in the same unit.
    :return: statistics of the errors that are not nan.
    """
    seen = errors[~np.isnan(errors)]
    if len(seen) < 2:
        return Spread(len(seen), *(math.nan,) * 6)
    low, high = np.percentile(seen, (2.5, 97.5))
    return Spread(
        n=len(seen),
        mean=float(seen.mean()),
        # The mean of equal numbers may be off by a rounding, which would be a spread where there is none.
        sd=float(seen.std(ddof=1)) if np.ptp(seen) > 0.0 else 0.0,
        p2_5=float(low),
        p97_5=float(high),
        worst=float(seen[np.abs(seen).argmax()]),
        beyond_jnd=float((np.abs(seen) > jnd).mean()),
    )


def _causes(errors: Floats, shifts: Mapping[str, Floats]) -> tuple[Cause, ...]:
    """Squared correlation with each parameter; these add up to one if the error is linear, for parameters are independent."""
    seen = ~np.isnan(errors)
    found = [Cause(name, float(np.corrcoef(errors[seen], shift[seen])[0, 1]) ** 2) for name, shift in shifts.items()]
    certain = [cause for cause in found if cause.share * seen.sum() > _BY_CHANCE]
    return tuple(sorted(certain, key=lambda cause: -cause.share)[:_CAUSES])
