"""What a rig says: quantities with uncertainties, faults instead of a fit, curves to look at, limits that were kept or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Look = Literal["measured", "fit", "published", "truth"]


@dataclass(frozen=True)
class Quantity:
    """A number with its standard deviation (0: counted, or not known to be uncertain) and unit."""

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Answer:
    """What of the reference a quantity answers: the id of a number, or of a curve and the point ``at``; and the id of the
    contradiction in the source that explains a difference, if one is due.
    """

    published: str
    contradiction: str | None = None
    at: float | None = None


@dataclass(frozen=True)
class Fault:
    """Something wrong at the bench. ``what``: a word from the rig's list; ``why``: what was seen, and what to do."""

    what: str
    why: str


@dataclass(frozen=True)
class Measurement:
    """A measurement that a rig declares, with the limits that a sound set-up keeps. Out of limits is an outcome, no exception."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Measured:
    """A declared measurement's value. ``within``: it kept its limits."""

    measurement: Measurement
    value: float

    @property
    def within(self) -> bool:
        return self.measurement.low <= self.value <= self.measurement.high


@dataclass(frozen=True)
class Series:
    """One set of points or one line of a plot. ``error``: half length of error bars, one for each point."""

    label: str
    look: Look
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    error: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Plot:
    """A curve to look at. ``residuals`` are drawn below on the same x. ``log_y``: logarithmic ordinate."""

    name: str
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    residuals: tuple[Series, ...] = ()
    residual_label: str = ""
    log_y: bool = False


def series(label: str, look: Look, x: ArrayLike, y: ArrayLike, error: ArrayLike | None = None) -> Series:
    """A ``Series`` from anything that makes arrays."""
    return Series(label, look, _array(x), _array(y), None if error is None else _array(error))


@dataclass(frozen=True)
class RigResult:
    """The outcome of a rig on one device.

    ``quantities`` are empty where ``faults`` are not: a rig that sees a fault gives no fit. ``reduced_chi2`` None: no fit was
    made. ``notes``: what a reader should know. ``recordings``: files written on the way.
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


def _array(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=float)
