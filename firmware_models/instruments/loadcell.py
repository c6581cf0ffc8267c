"""A load cell between the hand and one brake, read by a 24-bit converter: ``sim://loadcell?world=NAME``.

It prints raw counts, as an HX711 gives them; ``counts_per_n`` is as its maker calibrated it, and its own gain is a little
off that. The zero is anywhere and drifts. Above 120 % of full scale the cell sits on its stop, beyond 24 bits the converter
clips. By default the 50 N cell of the published pull tester (Instron 2519, thesis 4.7.2); ``rate_hz=80&full_scale_n=98.1`` is a
DYLY-108 of 10 kg with an HX711 (6.4.3), which samples at 10 or 80 Hz. Faults to play: ``silent_at_s``, from when on nothing
comes; ``flat_at_s``, from when on the converter repeats itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmware_models.instruments.instrument import Instrument
from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from firmware_models.world import World

GAIN_SD = 0.0025  # assumed: a cell of class 0.5, calibrated
ZERO_SD_SHARE = 0.005  # assumed: of full scale, what hangs on the cell included
DRIFT_SD_N_MIN = 1e-3  # assumed
STOP_SHARE = 1.2
COUNTS_AT_FULL_SCALE = 5e6
_MAX_COUNT = (1 << 23) - 1


class LoadCell(Instrument):
    """Tension of one output's hand, raw counts.

    :param options: values of ``options()`` and ``INSTRUMENT_OPTIONS``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the brake board is.
    """

    kind = "loadcell"
    board = "brake"

    @classmethod
    def options(cls) -> dict[str, Option]:
        return {
            "rate_hz": Option(500.0, "samples a second", "Hz", 1.0, 2000.0),
            "full_scale_n": Option(50.0, "maximum force it is made for", "N", 0.1, 1e5),
            "counts_per_n": Option(None, f"default {COUNTS_AT_FULL_SCALE:g} at full scale", "1/N", 1e-3, 1e9),
            "noise_n": Option(2e-3, "standard deviation of one sample", "N", 0.0, 100.0),
            "gain": Option(None, f"reading over truth; default drawn, sd {GAIN_SD:g}", "", 0.5, 2.0),
            "zero_n": Option(None, f"reading without force; default drawn, sd {ZERO_SD_SHARE:g} of full scale", "N", -1e5, 1e5),
            "drift_n_min": Option(None, f"of the zero; default drawn, sd {DRIFT_SD_N_MIN:g}", "N/min", -100.0, 100.0),
            "silent_at_s": Option(None, "no sample comes any more so long after power-on", "s", 0.0, 1e6),
            "flat_at_s": Option(None, "the last reading is repeated so long after power-on", "s", 0.0, 1e6),
        }

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        full_scale_n, per_n = options["full_scale_n"], options["counts_per_n"]
        self.counts_per_n = COUNTS_AT_FULL_SCALE / full_scale_n if per_n is None else per_n
        super().__init__(options, transmitter, start_ns, world)
        gain, zero, drift = (float(one) for one in self.rng.standard_normal(3))
        self.gain = 1.0 + GAIN_SD * gain if options["gain"] is None else options["gain"]
        self.zero_n = ZERO_SD_SHARE * full_scale_n * zero if options["zero_n"] is None else options["zero_n"]
        self.drift_n_s = (DRIFT_SD_N_MIN * drift if options["drift_n_min"] is None else options["drift_n_min"]) / 60.0
        self._stop_n = STOP_SHARE * full_scale_n
        self._last = 0

    def header(self) -> dict[str, float | str]:
        settings = self.settings
        return {
            "rate_hz": settings["rate_hz"],
            "full_scale_n": settings["full_scale_n"],
            "counts_per_n": self.counts_per_n,
            "unit": "count",
        }

    def _when(self) -> int:
        next_ns, silent_s = super()._when(), self.settings["silent_at_s"]
        return NEVER_NS if silent_s is not None and next_ns - self.start_ns >= silent_s * 1e9 else next_ns

    def sample(self) -> str:
        since_s = (self.now_ns - self.start_ns) / 1e9
        flat_s = self.settings["flat_at_s"]
        if flat_s is None or since_s < flat_s:
            self._last = self._read(since_s)
        return str(self._last)

    def truth(self) -> dict[str, Any]:
        return {**super().truth(), "gain": self.gain, "zero_n": self.zero_n, "drift_n_s": self.drift_n_s}

    def _read(self, since_s: float) -> int:
        plant = self.plant()
        pull_n = 0.0 if plant is None else plant.tension(self.channel, self.now_ns)
        true_n = min(max(pull_n, -self._stop_n), self._stop_n)
        noise_n = self.settings["noise_n"] * float(self.rng.standard_normal())
        counts = round((self.gain * true_n + self.zero_n + self.drift_n_s * since_s + noise_n) * self.counts_per_n)
        return min(max(counts, -_MAX_COUNT - 1), _MAX_COUNT)
