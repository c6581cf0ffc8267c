"""The devices looked at as they go: truth gathered from simulated plants, rows of samples for a recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from haptics.judging.truth import Truth
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS
from haptics.session.devices import Devices
from haptics.session.plant_truth import PlantTruth, plant_truth
from haptics.session.recorder import Recorder
from haptics.time import NS_PER_MS

SAMPLE_NS = 10 * NS_PER_MS
"""Simulated plants are sampled this often, and whatever is recorded."""
ACCOUNT_NS = 100 * NS_PER_MS
"""An account of heat that nobody records is looked at this often: it falls by a thousandth meanwhile, so its peak is seen."""
KEPT = 1000
"""How many results, events and samples a session remembers: it may last for days."""


class Sampler:
    """Samples the devices of a glove.

    :param devices: what is looked at.
    :param recorder: takes a row of each sample, or None.
    :param truth: to gather in what simulated plants do; one that holds the last of it if None.

    :ivar truth: what the simulated plants did since this was made; empty on hardware.
    """

    def __init__(self, devices: Devices, recorder: Recorder | None, truth: Truth | None = None):
        self._devices, self._recorder = devices, recorder
        self._array_plant, self._brake_plant = devices.plant("tactiles"), devices.plant("brake")
        self._due_ns = 0
        plants = self._array_plant is not None or self._brake_plant is not None
        self._every_ns = SAMPLE_NS if plants or recorder is not None else ACCOUNT_NS
        self.truth = Truth.keeping(KEPT) if truth is None else truth

    def due(self, now_ns: int) -> None:
        """Sample, if it is time to.

        :param now_ns: ns on the glove's clock.
        """
        if now_ns >= self._due_ns:
            self.sample(now_ns)

    def sample(self, now_ns: int) -> None:
        """Sample now.

        :param now_ns: ns on the glove's clock.
        """
        self._due_ns = now_ns + self._every_ns
        rise_k, pin_out = np.zeros(COIL_CHANNELS), np.zeros(COIL_CHANNELS, dtype=np.uint8)
        volts, force_n, piezo = np.zeros(BRAKE_CHANNELS), np.zeros(BRAKE_CHANNELS), np.zeros(BRAKE_CHANNELS, dtype=np.uint8)
        gathered, array, brakes = self.truth, self._devices.tactiles, self._devices.brakes
        if self._array_plant is not None:
            truth = self._coils()
            rise_k[:] = truth["rise_k"]
            pin_out[:] = [state == "on" for state in truth["latched"]]
            gathered.latched = truth["latched"]
            gathered.switches[:] = truth["switches"]
        elif array is not None:
            rise_k[: len(array.sites)] = array.rises_k(now_ns)
            pin_out[: len(array.sites)] = array.pins_out()
        if self._brake_plant is not None:
            truth = self._outputs()
            volts[:], force_n[:], piezo[:] = truth["volts"], truth["capacity_n"], truth["piezo"]
            gathered.forces_n.append((now_ns, tuple(truth["capacity_n"])))
            gathered.energy_j[:] = truth["energy_j"]
        elif brakes is not None and "brake" in self._devices.telemetry:
            volts[:] = self._devices.telemetry["brake"].output
        np.maximum(gathered.peak_rise_k, rise_k, out=gathered.peak_rise_k)
        np.maximum(gathered.peak_volts, np.abs(volts), out=gathered.peak_volts)
        np.maximum(gathered.peak_force_n, force_n, out=gathered.peak_force_n)
        if self._recorder is not None:
            self._recorder.tick(now_ns, rise_k, pin_out, volts, force_n, piezo)

    def look(self) -> PlantTruth | None:
        """What the simulated plants are now; no sample.

        :return: the truth, or None where both boards are hardware.
        """
        array = None if self._array_plant is None else self._coils()
        brake = None if self._brake_plant is None else self._outputs()
        if array is None and brake is None:
            return None
        devices = self._devices
        sites = () if devices.tactiles is None else devices.tactiles.sites
        brakes = () if devices.brakes is None else devices.brakes.channels
        return plant_truth(devices.now_ns(), sites, brakes, array, brake)

    def _coils(self) -> dict[str, Any]:
        """The array's truth; what happened since the last time is gathered, for it comes only once."""
        assert self._array_plant is not None
        truth = self._array_plant.truth()
        self.truth.pins += [(time_ns, channel, kind) for time_ns, channel, kind, _ in truth["events"]]
        self.truth.pin_speeds_m_s += [speed for *_, speed in truth["events"]]
        return truth

    def _outputs(self) -> dict[str, Any]:
        """The brakes' truth, likewise."""
        assert self._brake_plant is not None
        truth = self._brake_plant.truth()
        self.truth.brakes += [(time_ns, channel, kind) for time_ns, channel, kind, _ in truth["events"]]
        return truth
