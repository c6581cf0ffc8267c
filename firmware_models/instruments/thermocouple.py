"""A thermocouple on one actuator, read by a converter with cold junction: ``sim://thermocouple?world=NAME``.

The junction follows the actuator with a lag of its own; the converter has a gain a little off, an offset, noise and steps. The
room drifts. It reads degrees Celsius. Faults to play: ``loose_at_s``, from when on the junction touches the actuator no more
than ``loose_share`` of before and jitters; ``open_at_s``, from when on the wire is broken, which the converter notices.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from firmware_models.instruments.instrument import Instrument
from firmware_models.line.uart import Line
from firmware_models.options import Option
from firmware_models.world import World

GAIN_SD = 0.004  # assumed: a K-type junction of class 1 (IEC 60584-1 allows 0.4 %)
OFFSET_SD_K = 0.7  # assumed
LAG_SD_SHARE = 0.15  # assumed: how well it is glued
DRIFT_SD_K_H = 0.2  # assumed: a room with doors kept shut
_LOOSE_JITTER_K = 0.6
_LOOSE_LAG_SHARE = 8.0


class Thermocouple(Instrument):
    """Temperature of one actuator, degrees Celsius.

    :param options: values of ``options()`` and ``INSTRUMENT_OPTIONS``.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the coil board is.
    """

    kind = "thermocouple"
    board = "tactiles"

    @classmethod
    def options(cls) -> dict[str, Option]:
        return {
            "rate_hz": Option(10.0, "samples a second", "Hz", 0.1, 100.0),
            "room_c": Option(25.0, "room at power-on", "degC", -20.0, 50.0),
            "drift_k_h": Option(None, f"drift of the room; default drawn, sd {DRIFT_SD_K_H:g}", "K/h", -100.0, 100.0),
            "lag_s": Option(None, f"of the junction; default drawn about 1 s, sd {LAG_SD_SHARE:g} of it", "s", 0.0, 100.0),
            "noise_k": Option(0.06, "standard deviation of one sample", "K", 0.0, 10.0),
            "resolution_k": Option(0.0625, "step of the converter", "K", 1e-4, 5.0),
            "gain": Option(None, f"reading over truth; default drawn, sd {GAIN_SD:g}", "", 0.5, 2.0),
            "loose_at_s": Option(None, "the junction comes loose so long after power-on", "s", 0.0, 1e6),
            "loose_share": Option(0.5, "what a loose junction still sees of the rise", "", 0.0, 1.0),
            "open_at_s": Option(None, "the wire breaks so long after power-on", "s", 0.0, 1e6),
        }

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        super().__init__(options, transmitter, start_ns, world)
        gain, offset, lag, drift = (float(one) for one in self.rng.standard_normal(4))
        self.gain = 1.0 + GAIN_SD * gain if options["gain"] is None else options["gain"]
        self.offset_k = OFFSET_SD_K * offset
        self.lag_s = max(0.1, 1.0 + LAG_SD_SHARE * lag) if options["lag_s"] is None else options["lag_s"]
        self.drift_k_s = (DRIFT_SD_K_H * drift if options["drift_k_h"] is None else options["drift_k_h"]) / 3600.0
        self._junction_k = self._seen_k = 0.0
        self._sampled_ns = start_ns

    def header(self) -> dict[str, float | str]:
        return {"rate_hz": self.settings["rate_hz"], "resolution_k": self.settings["resolution_k"], "unit": "degC"}

    def sample(self) -> str:
        since_s = (self.now_ns - self.start_ns) / 1e9
        if self._passed("open_at_s", since_s):
            return "open"
        plant = self.plant()
        body_k = 0.0 if plant is None else plant.rise(self.channel, self.now_ns)
        loose = self._passed("loose_at_s", since_s)
        self._follow(body_k * self.settings["loose_share"] if loose else body_k, _LOOSE_LAG_SHARE if loose else 1.0)
        noise_k = math.hypot(self.settings["noise_k"], _LOOSE_JITTER_K if loose else 0.0) * float(self.rng.standard_normal())
        true_c = self.settings["room_c"] + self.drift_k_s * since_s + self.gain * self._junction_k
        step_k = self.settings["resolution_k"]
        return f"{round((true_c + self.offset_k + noise_k) / step_k) * step_k:.4f}"

    def truth(self) -> dict[str, Any]:
        return {**super().truth(), "gain": self.gain, "lag_s": self.lag_s, "drift_k_s": self.drift_k_s}

    def _follow(self, body_k: float, slower: float) -> None:
        """Exact for a body that went straight from the last sample to this one."""
        dt_s, self._sampled_ns = (self.now_ns - self._sampled_ns) / 1e9, self.now_ns
        lag_s, was_k, self._seen_k = self.lag_s * slower, self._seen_k, body_k
        if lag_s == 0.0 or dt_s == 0.0:
            self._junction_k = body_k
            return
        slope_k_s = (body_k - was_k) / dt_s
        behind_k = self._junction_k - (was_k - slope_k_s * lag_s)
        self._junction_k = body_k - slope_k_s * lag_s + behind_k * math.exp(-dt_s / lag_s)

    def _passed(self, key: str, since_s: float) -> bool:
        at_s = self.settings[key]
        return at_s is not None and since_s >= at_s
