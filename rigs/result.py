"""What a rig reports: quantities with uncertainties, faults instead of a fit, curves to look at, limits that were kept or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptics.units import engineering

Look = Literal["measured", "fit", "published", "truth"]


@dataclass(frozen=True)
class Quantity:
    """A number with its standard deviation.

    :param value: in ``unit``.
    :param sd: standard deviation, >= 0; 0 for what is counted or not known to be uncertain.
    :param unit: SI; ``1`` for a share.
    """

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Answer:
    """The part of the reference that a quantity answers.

    :param published: id of a number or curve.
    :param contradiction: id of the contradiction in the source that explains a difference; None where there is none.
    :param at: point of the curve, in its ``x_unit``; None for a number.
    """

    published: str
    contradiction: str | None = None
    at: float | None = None


@dataclass(frozen=True)
class Fault:
    """Something wrong at the bench.

    :param what: word from the rig's list, such as ``clamp_slips``.
    :param why: what was seen, and what to do.
    """

    what: str
    why: str


@dataclass(frozen=True)
class Measurement:
    """A measurement that a rig declares, with the limits of a sound set-up. A value out of limits is an outcome, not an
    exception.

    :param name: key in the result.
    :param unit: of value and limits.
    :param low: minimum of a sound set-up.
    :param high: maximum of a sound set-up.
    :param meaning: for people: what it is, and what a value out of limits means.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Measured:
    """The value of a declared measurement.

    :param measurement: what was measured.
    :param value: in the measurement's unit.
    """

    measurement: Measurement
    value: float

    @property
    def within(self) -> bool:
        """The value is within the limits."""
        return self.measurement.low <= self.value <= self.measurement.high


@dataclass(frozen=True)
class Series:
    """One set of points or one line of a plot.

    :param label: for the legend.
    :param look: how it is drawn.
    :param x: abscissas (n,).
    :param y: ordinates (n,).
    :param error: half length of the error bars (n,); None for none.
    """

    label: str
    look: Look
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    error: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Plot:
    """Curves to look at.

    :param name: of the picture's file, without its ending.
    :param title: above the curves.
    :param x_label: quantity of the abscissa, its unit in brackets.
    :param y_label: quantity of the ordinate, its unit in brackets.
    :param series: to draw.
    :param residuals: drawn below, over the same x.
    :param residual_label: of their ordinate, with its unit.
    :param log_y: logarithmic ordinate.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    residuals: tuple[Series, ...] = ()
    residual_label: str = ""
    log_y: bool = False


def series(label: str, look: Look, x: ArrayLike, y: ArrayLike, error: ArrayLike | None = None) -> Series:
    """A ``Series`` from anything that makes arrays.

    :param label: for the legend.
    :param look: how it is drawn.
    :param x: abscissas (n,).
    :param y: ordinates (n,).
    :param error: half length of the error bars (n,); None for none.
    :return: the series, with float arrays.
    """
    return Series(label, look, _array(x), _array(y), None if error is None else _array(error))


@dataclass(frozen=True)
class RigResult:
    """The outcome of a rig on one device.

    :param rig: its name.
    :param quantities: by name; empty where there are faults, for a rig that sees a fault gives no fit.
    :param reduced_chi2: of the fit; None where none was made.
    :param faults: seen at the bench.
    :param measured: declared measurements, as far as the run went.
    :param plots: curves to look at.
    :param notes: what a reader should know.
    :param recordings: files written on the way.
    :param details: further plain data, by name.
    """

    rig: str
    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    reduced_chi2: float | None = None
    faults: tuple[Fault, ...] = ()
    measured: tuple[Measured, ...] = ()
    plots: tuple[Plot, ...] = ()
    notes: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sound(self) -> bool:
        """No fault was seen, and every declared measurement kept its limits."""
        return not self.faults and all(one.within for one in self.measured)


def readable(value: float | None, unit: str, digits: int = 4) -> str:
    """A value for people: with the prefix that leaves one to three digits before the point.

    :param value: in ``unit``; None is a dash.
    :param unit: as in ``Quantity``; ``1`` is left out.
    :param digits: significant digits, at most.
    :return: such as ``2.547 nF``, ``1.0 kV``, ``0.98``.
    """
    return "–" if value is None else engineering(value, {"1": "", "ohm": "Ω", "m2": "m²"}.get(unit, unit), digits)


def _array(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)
