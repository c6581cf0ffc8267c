"""A high-voltage probe on an output and a shunt in the supply's return, on a microcontroller that prints counts.

The current has to be the mean since the sample before (a converter that integrates), so that its sum is charge.
"""

from __future__ import annotations

from rigs.instruments.stream import SampleStream

BAUD = 2_000_000
DIVIDER_SD = 0.005
"""Standard deviation of volts read over true volts (assumed: calibrated resistors)."""
SHUNT_SD = 0.005
"""Of current read over true current (assumed: a 0.5 % shunt with its amplifier)."""
CLOCK_SD = 1e-4
"""Of its seconds over true ones, once the host has seen it print for a few (assumed)."""
LOAD_SD = 0.01
"""Of the divider's resistance over what the header states (assumed)."""


class Probe(SampleStream):
    """Volts of one output, signed, and current of the supply.

    ``volts_per_count``, ``amps_per_count`` and ``full_scale`` (counts) come from the header; lines before it are not read.

    :param url: a serial port or ``sim://probe``.
    :param baud: of the line.
    """

    kind = "probe"
    columns = (("volts_v", "V"), ("supply_a", "A"))
    example = "512"

    def __init__(self, url: str, baud: int = BAUD):
        super().__init__(url, baud)
        self.saturated = {name: 0 for name, _ in self.columns}
        """Samples at either end of a converter, by column."""
        self._scale: tuple[float, float, int] | None = None

    def convert(self, words: list[str]) -> tuple[float, ...]:
        if self._scale is None:
            if "full_scale" not in self.header:
                raise ValueError("counts before the header that states what a count is worth")
            self._scale = (
                self.number("volts_per_count", 1e-6, 1e4, "V"),
                self.number("amps_per_count", 1e-12, 1.0, "A"),
                round(self.number("full_scale", 1, 1 << 31)),
            )
        volts, amps = (int(word) for word in words)
        per_volt, per_amp, full = self._scale
        if abs(volts) >= full:
            self.saturated["volts_v"] += 1
        if abs(amps) >= full:
            self.saturated["supply_a"] += 1
        return volts * per_volt, amps * per_amp

    @property
    def load_ohm(self) -> float:
        """What the divider puts across the output."""
        return self.number("load_ohm", 1e3, 1e18, "ohm")
