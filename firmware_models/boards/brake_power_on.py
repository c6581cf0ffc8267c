"""What the brake controller does between arm and armed: find out which outputs have a sound brake.

One output after the other is ramped by the supply's constant current to a few volts, and ``C = I t / V`` less the stray
capacitance is read as soon as the divider resolves the volts (``READ_V``). That is below what may be touched and below the
threshold of any force on a dielectric of 5 um or more. An output with next to no capacitance has no brake and is not driven;
no brake at all is a fault.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from firmware_models.boards.board import WHOLE_BOARD
from firmware_models.plants.brake_plant import Brakes
from haptics.link.messages import BRAKE_CHANNELS, Fault
from haptics.physics.brake.charging import DRIVE
from haptics.time import NS_PER_S

TEST_V = 40.0
READ_V = 25.0
NOT_FITTED = 0.1  # of nominal: less is no brake at all
SOUND = (0.5, 1.5)  # of nominal
_POLL_NS = 10_000
_NO_RISE_NS = 1_000_000
_REST_NS = 500_000
_READING_SD = 0.01  # assumed: divider and timer of the controller


@dataclass(frozen=True)
class Measured:
    """All outputs are sound or empty.

    :ivar capacitance_f: of each output, F (5,), without the stray capacitance; 0 means no brake.
    """

    capacitance_f: list[float]


@dataclass(frozen=True)
class Failed:
    """An output is not fit to be driven.

    :ivar fault: open, short, or self_test if no output has a brake.
    :ivar channel: the output, from 0, or ``WHOLE_BOARD``.
    :ivar value: its capacitance, pF; 0 if it did not rise.
    """

    fault: Fault
    channel: int
    value: int


class SelfTest:
    """The test under way; call ``step`` at ``next_ns`` until it returns something.

    :param plant: the outputs that are ramped.
    :param nominal_f: capacitance of a sound brake as the controller was configured for, F.
    :param rng: of the reading's error, 1 % (standard deviation).
    :param now_ns: world time of its beginning, ns.
    """

    def __init__(self, plant: Brakes, nominal_f: float, rng: np.random.Generator, now_ns: int):
        self._plant = plant
        self._nominal_f = nominal_f
        self._rng = rng
        self._capacitance_f: list[float] = []
        self._began_ns = now_ns
        self._resting = True
        self.next_ns = now_ns + _REST_NS

    def step(self, now_ns: int) -> Measured | Failed | None:
        """Do what is due; a result ends the test with the output still on, to be shorted by the caller.

        :param now_ns: world time, ns; ``next_ns``.
        :return: what was found; None while the test goes on.
        """
        channel = len(self._capacitance_f)
        if self._resting:
            self._plant.drive(1 << channel, TEST_V, 0.0, now_ns)
            self._began_ns, self._resting = now_ns, False
            self.next_ns = now_ns + _POLL_NS
            return None
        volts = abs(self._plant.volts(now_ns)[channel])  # the bridge starts with the polarity in which it stopped
        if volts < READ_V:
            if now_ns - self._began_ns >= _NO_RISE_NS:
                return Failed(Fault.SHORT, channel, 0)
            self.next_ns = now_ns + _POLL_NS
            return None
        return self._judge(channel, DRIVE.supply_current_a * (now_ns - self._began_ns) / NS_PER_S / volts, now_ns)

    def _judge(self, channel: int, total_f: float, now_ns: int) -> Measured | Failed | None:
        measured_f = total_f * float(self._rng.normal(1.0, _READING_SD)) - DRIVE.stray_f
        if measured_f < NOT_FITTED * self._nominal_f:
            measured_f = 0.0
        elif measured_f < SOUND[0] * self._nominal_f:
            return Failed(Fault.OPEN, channel, round(measured_f * 1e12))
        elif measured_f > SOUND[1] * self._nominal_f:
            return Failed(Fault.SHORT, channel, round(measured_f * 1e12))
        self._capacitance_f.append(measured_f)
        if len(self._capacitance_f) == BRAKE_CHANNELS:
            return Measured(self._capacitance_f) if any(self._capacitance_f) else Failed(Fault.SELF_TEST, WHOLE_BOARD, 0)
        self._plant.drive(0, 0.0, 0.0, now_ns)
        self._resting, self.next_ns = True, now_ns + _REST_NS
        return None
