"""A load cell behind a converter that prints raw counts: such as the pull tester's 50 N cell, or a DYLY-108 with an HX711."""

from __future__ import annotations

from rigs.instruments.stream import SampleStream

GAIN_SD = 0.0025
"""Standard deviation of reading over truth, as a share: a cell of class 0.5 whose calibration is not checked here (assumed)."""
LATENCY_S, LATENCY_SD_S = 0.5e-3, 0.5e-3
"""From a sample's moment until its line is there to be read: converter, wire and driver (assumed)."""


class LoadCell(SampleStream):
    """Force, newton, zero included: a rig takes the tare from a rest. Counts are divided by the header's ``counts_per_n``."""

    kind = "loadcell"
    columns = (("force_n", "N"),)
    example = "21550"

    _counts_per_n: float | None = None

    def convert(self, words: list[str]) -> tuple[float, ...]:
        if len(words) != 1:
            raise ValueError(f"{len(words)} values")
        if not self.header:
            raise ValueError("counts before it is known what they mean")
        if self._counts_per_n is None:
            self._counts_per_n = self.number("counts_per_n", 1e-3, 1e9, "1/N")
        return (int(words[0]) / self._counts_per_n,)
