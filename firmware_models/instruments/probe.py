"""A high-voltage probe on one output, and a shunt in the supply's return: ``sim://probe?world=NAME``.

A divider of 1000:1 brings the output's volts, of either sign, down to a converter that takes them at each sample. The shunt
sits behind a converter that integrates (delta-sigma): it gives the mean current since the sample before, so that the sum over
samples is charge, however short a peak was. Both print counts; the header states what a count is worth, nominally. The divider
loads the output (``load_ohm``) from when the probe meets a board on. Gains are off by what parts are off, and both
channels have an offset and noise.

Faults to play: ``loose_at_s``, from when on the probe's tip has no contact and picks up next to nothing; ``shunt_open_at_s``,
from when on the shunt's lead is off; ``shunt_reversed``, its two leads swapped; ``silent_at_s``, from when on nothing is printed.
Another range than the volts need, by ``range_v``, saturates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmware_models.instruments.instrument import Instrument
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from firmware_models.world import World
from haptics.link.messages import BRAKE_CHANNELS
from haptics.time import seconds_to_ns
from haptics.units import in_range

DIVIDER_SD = 0.005  # assumed: calibrated resistors of a divider for 2 kV
SHUNT_SD = 0.005  # assumed: a 0.5 % shunt and its amplifier
LOAD_SD = 0.01  # assumed: the divider's resistance
OFFSET_SD_V, OFFSET_SD_A = 1.5, 1e-6  # assumed: amplifiers at room temperature
_BLOCK = 1024


class Probe(Instrument):
    """Volts of one output, and the current that the supply gives, in counts.

    :param options: values of ``options()`` and ``INSTRUMENT_OPTIONS``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the brake board is.
    :raises InputError: ``channel`` is no output of a brake board.
    """

    kind = "probe"
    board = "brake"

    @classmethod
    def options(cls) -> dict[str, Option]:
        return {
            "baud": Option(2_000_000, "what the instrument's UART is set to", "baud", 300, 4_000_000, whole=True),
            "rate_hz": Option(10_000.0, "samples a second", "Hz", 1.0, 10_000.0),
            "range_v": Option(2000.0, "maximum volts of either sign", "V", 1.0, 1e5),
            "range_a": Option(1e-3, "maximum current of either sign", "A", 1e-6, 1.0),
            "bits": Option(12, "of both converters", "", 8, 16, whole=True),
            "noise_v": Option(1.0, "standard deviation of one sample", "V", 0.0, 100.0),
            "noise_a": Option(0.5e-6, "standard deviation of one sample", "A", 0.0, 1e-3),
            "divider_gain": Option(None, f"reading over truth; default drawn, sd {DIVIDER_SD:g}", "", 0.5, 2.0),
            "shunt_gain": Option(None, f"reading over truth; default drawn, sd {SHUNT_SD:g}", "", 0.5, 2.0),
            "load_ohm": Option(1e9, f"the divider's nominal resistance; the true one is drawn, sd {LOAD_SD:g}", "ohm", 1e6, 1e15),
            "shunt_reversed": Option(0, "1: its leads are swapped", "", 0, 1, whole=True),
            "loose_at_s": Option(None, "the tip loses contact so long after power-on", "s", 0.0, 1e6),
            "shunt_open_at_s": Option(None, "the shunt's lead comes off so long after power-on", "s", 0.0, 1e6),
            "silent_at_s": Option(None, "nothing is printed from so long after power-on", "s", 0.0, 1e6),
        }

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        in_range("channel", options["channel"], 0, BRAKE_CHANNELS - 1)
        super().__init__(options, transmitter, start_ns, world)
        divider, shunt, load, volts, amps = (float(one) for one in self.rng.standard_normal(5))
        self.divider_gain = 1.0 + DIVIDER_SD * divider if options["divider_gain"] is None else options["divider_gain"]
        self.shunt_gain = 1.0 + SHUNT_SD * shunt if options["shunt_gain"] is None else options["shunt_gain"]
        self.load_ohm = options["load_ohm"] * (1.0 + LOAD_SD * load)
        self.offset_v, self.offset_a = OFFSET_SD_V * volts, OFFSET_SD_A * amps
        self._full = _full_scale(options)
        self._volts_per_count, self._amps_per_count = options["range_v"] / self._full, options["range_a"] / self._full
        self._sign = -1.0 if options["shunt_reversed"] else 1.0
        self._noise: list[float] = []
        self._on: Any = None
        self._given_c, self._sampled_ns = 0.0, start_ns

    def header(self) -> dict[str, float | str]:
        settings, full = self.settings, _full_scale(self.settings)
        return {
            "rate_hz": settings["rate_hz"],
            "volts_per_count": settings["range_v"] / full,
            "amps_per_count": settings["range_a"] / full,
            "full_scale": full,
            "load_ohm": settings["load_ohm"],
        }

    def _when(self) -> int:
        at_ns = super()._when()
        return NEVER_NS if self._passed("silent_at_s", at_ns) else at_ns

    def sample(self) -> str:
        volts = amps = 0.0
        plant = self.plant()
        if plant is not None:
            if plant is not self._on:
                self._meet(plant)
            if not self._passed("loose_at_s", self.now_ns):
                volts = plant.volts(self.now_ns)[self.channel]
            given_c = plant.supply_charge_c(self.now_ns)
            if not self._passed("shunt_open_at_s", self.now_ns) and self.now_ns > self._sampled_ns:
                amps = self._sign * (given_c - self._given_c) * 1e9 / (self.now_ns - self._sampled_ns)
            self._given_c, self._sampled_ns = given_c, self.now_ns
        if not self._noise:
            self._noise = self.rng.standard_normal(2 * _BLOCK).tolist()
        volts = self.divider_gain * volts + self.offset_v + self.settings["noise_v"] * self._noise.pop()
        amps = self.shunt_gain * amps + self.offset_a + self.settings["noise_a"] * self._noise.pop()
        return f"{self._counts(volts / self._volts_per_count)} {self._counts(amps / self._amps_per_count)}"

    def truth(self) -> dict[str, Any]:
        drawn = {"divider_gain": self.divider_gain, "shunt_gain": self.shunt_gain, "load_ohm": self.load_ohm}
        return {**super().truth(), **drawn, "offset_v": self.offset_v, "offset_a": self.offset_a}

    def _meet(self, plant: Any) -> None:
        """Load the output, and count charge from here on."""
        self._on = plant
        plant.load(self.channel, self.now_ns, leak_ohm=self.load_ohm)
        self._given_c, self._sampled_ns = plant.supply_charge_c(self.now_ns), self.now_ns

    def _counts(self, exact: float) -> int:
        return max(-self._full, min(self._full, round(exact)))

    def _passed(self, key: str, now_ns: int) -> bool:
        at_s = self.settings[key]
        return at_s is not None and now_ns - self.start_ns >= seconds_to_ns(at_s)


def _full_scale(options: Mapping[str, Any]) -> int:
    """Counts of either sign at full scale."""
    return (1 << options["bits"] - 1) - 1
