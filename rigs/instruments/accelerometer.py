"""An accelerometer that prints counts, such as an ADXL345 on any microcontroller, one axis along the pin."""

from __future__ import annotations

import math

import numpy as np

from haptics.time import seconds_to_ns
from rigs.instruments.stream import Samples, SampleStream

GAIN_SD = 0.01
"""Standard deviation of reading over truth (ADXL345 data sheet: typical deviation from ideal sensitivity)."""
BANDWIDTH_SD = 0.05
"""Standard deviation of the low-pass about what the header states, as a share (assumed)."""
DELAY_S, DELAY_SD_S = 0.3e-3, 0.05e-3
"""From a sample's moment to the first bit of its line (assumed: the sensor's own delay, and a microcontroller that waits)."""
_LINE_BYTES = 9.5


class Accelerometer(SampleStream):
    """Acceleration in standard gravity. Its header has ``rate_hz, range_g, g_per_count, bandwidth_hz``.

    :param url: a serial port or ``sim://accelerometer``.
    :param baud: of the line.
    """

    kind = "accelerometer"
    columns = (("acceleration_g", "g"),)
    example = "512"

    def __init__(self, url: str, baud: int = 500_000):
        super().__init__(url, baud)
        self._late_s = DELAY_S + 10.0 * _LINE_BYTES / baud
        self._scaled_by: dict[str, str] | None = None
        self._g_per_count = math.nan

    def convert(self, words: list[str]) -> tuple[float, ...]:
        if self._scaled_by is not self.header:
            if "g_per_count" not in self.header:
                raise ValueError("a sample ahead of the header")
            self._scaled_by, self._g_per_count = self.header, float(self.header["g_per_count"])
        (count,) = super().convert(words)
        return (count * self._g_per_count,)

    def samples(self) -> Samples:
        """All samples so far, each at the moment that it was taken: the line's own time and ``DELAY_S`` are allowed for.

        :return: acceleration in g, times corrected by delay and line.
        """
        as_arrived = super().samples()
        return Samples(as_arrived.start_ns - seconds_to_ns(self._late_s), as_arrived.time_s, as_arrived.values)

    def _measured_period_s(self) -> float | None:
        """Slope of the straight line that lies below all arrivals and closest to them.

        Polling and sampling go in and out of step for seconds, and a least-squares line follows that by 1e-5: 0.2 ms in the 20 s
        of a run, where a landing must be known better. The earliest arrivals do not.
        """
        if super()._measured_period_s() is None:
            return None
        hull: list[tuple[int, int]] = []
        for number, arrived_ns in self._batches:
            while len(hull) > 1 and _turns_down(hull[-2], hull[-1], (number, arrived_ns)):
                hull.pop()
            hull.append((number, arrived_ns))
        middle = sum(number for number, _ in self._batches) / len(self._batches)
        after = next(k for k in range(1, len(hull)) if hull[k][0] >= middle)  # the edge over the middle is closest to all
        (first, from_ns), (last, to_ns) = hull[after - 1], hull[after]
        return (to_ns - from_ns) / 1e9 / (last - first)

    @property
    def bandwidth_hz(self) -> float:
        """Of its low-pass, taken as one of first order."""
        return self.number("bandwidth_hz", 1.0, 1e5, "Hz")

    @property
    def range_g(self) -> float:
        """End of its range."""
        return self.number("range_g", 0.1, 1e3, "g")

    def clipped(self) -> int:
        """Samples at the end of the range.

        :return: count of samples.
        """
        step_g = self.number("g_per_count", 1e-9, 1.0, "g")
        return int(np.count_nonzero(np.abs(super().samples().column()) >= self.range_g - 1.5 * step_g))


def _turns_down(first: tuple[int, int], second: tuple[int, int], third: tuple[int, int]) -> bool:
    """The second lies above the line from the first to the third, or on it."""
    return (second[1] - first[1]) * (third[0] - first[0]) >= (third[1] - first[1]) * (second[0] - first[0])
