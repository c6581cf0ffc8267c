"""The board on a bench: time that passes for it, pulses and volts by hand, and what it refused."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any

from haptics.devices import BrakeDriver
from haptics.devices.brake import COMMAND_LEAD_NS
from haptics.errors import HapticsError, InputError
from haptics.link.commands import NEVER_NS, Pending
from haptics.link.connection import Link
from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US, Status
from haptics.link.port_url import is_simulated
from haptics.session.devices import Devices
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns
from haptics.units import in_range
from rigs.bench.options import BenchOptions
from rigs.result import Fault

STEP_NS = 10 * NS_PER_MS
"""How often a bench in virtual time looks at its instruments; in real time it is a millisecond."""
PULSE_LEAD_NS = 20 * NS_PER_MS
WITHDRAW_S = 10e-3


class BoardOnBench:
    """One board, driven by hand; base of ``Bench``, which opens it and looks at what is around it.

    :param board: ``tactiles`` or ``brake``.
    :param options: where it runs.
    """

    glove: Devices
    link: Link

    def __init__(self, board: str, options: BenchOptions):
        self.board, self.options = board, options
        self.simulated = is_simulated(options.board_url(board))
        self.telemetry: list[tuple[int, Any]] = []
        self.watch: Callable[[], None] | None = None
        """Called at each look at the instruments; may raise to end the run."""
        self.pulsed_ns: list[int] = []
        """Commanded start of each pulse so far, ns."""
        self._pending: list[tuple[str, Pending]] = []
        self._brake_refusals: list[str] = []
        self._back_ns: dict[int, int] = {}
        """Channels whose pin was sent out, and when it will be back, as far as that was commanded."""

    # What the whole bench provides.

    def _look(self) -> None:
        """Take in what came while time passed."""
        raise NotImplementedError

    def _note(self, kind: str, subject: str = "", detail: str = "") -> None:
        """Record something that was done."""
        raise NotImplementedError

    def _stop_stage(self) -> None:
        """Nothing pulls any more; before volts drop, for strips that let go under a moving hand fly."""
        raise NotImplementedError

    # Time.

    @property
    def now_ns(self) -> int:
        """The bench's clock."""
        return self.glove.now_ns()

    def wait(self, seconds: float) -> None:
        """Let time pass, with links served and instruments read.

        :param seconds: how long, s; 0 or less returns at once.
        :raises LinkError: a port went away.
        :raises HapticsError: what the rig's ``watch`` raises.
        """
        self.wait_until(self.now_ns + seconds_to_ns(seconds))

    def wait_until(self, to_ns: int) -> None:
        """As ``wait``, until a time of the bench's clock; at once if it has passed.

        :param to_ns: time on the bench's clock, ns.
        :raises LinkError: a port went away.
        :raises HapticsError: what the rig's ``watch`` raises.
        """
        step_ns = STEP_NS if self.simulated else NS_PER_MS
        while (now_ns := self.now_ns) < to_ns:
            until_ns = min(now_ns + step_ns, to_ns)
            if not self.simulated:
                time.sleep((until_ns - now_ns) / NS_PER_S)
            self.glove.follow(until_ns if self.simulated else self.now_ns)
            self.glove.tick(self.now_ns)
            self._look()

    # The board.

    def arm(self) -> None:
        """Arm the board.

        :raises HapticsError: it would not.
        """
        self.glove.arm()
        self._note("armed")

    def disarm(self) -> None:
        """What pulls stopped, outputs off, board disarmed; it may be armed again."""
        self._rest()
        self.glove.off()
        self._note("disarmed")

    def pulse(self, channels: Sequence[int], at_ns: int, duration_s: float, toward_skin: bool) -> None:
        """One coil pulse on each of ``channels`` at a time of the bench's clock, which has to lie 20 ms ahead at least.

        :param channels: coil channels, each 0 to 14.
        :param at_ns: start on the bench's clock, ns, at least 20 ms ahead.
        :param duration_s: length of the pulse, 50 us to 10 ms, in steps of 50 us.
        :param toward_skin: polarity: True drives the pin toward the skin, False back.
        :raises InputError: a channel or duration out of range, or too little time ahead.
        """
        if at_ns < self.now_ns + PULSE_LEAD_NS:
            raise InputError(f"at_ns = {at_ns} is {(at_ns - self.now_ns) / 1e6:g} ms ahead; pulses need at least 20 ms")
        mask, durations = 0, [0] * COIL_CHANNELS
        for channel in channels:
            at = int(in_range("channel", channel, 0, COIL_CHANNELS - 1))
            mask |= 1 << at
            durations[at] = round(in_range("duration_s", duration_s, 50e-6, 10e-3, "s") * 1e6 / DURATION_UNIT_US)
        toward = mask if toward_skin else 0
        pending = self.link.send("pulse", self.link.exact_ticks(at_ns), mask, toward, durations, now_ns=self.now_ns)
        self._pending.append(("pulse", pending))
        self.pulsed_ns.append(at_ns)
        back_ns = NEVER_NS if toward_skin else at_ns + seconds_to_ns(duration_s)
        self._back_ns.update(dict.fromkeys(channels, back_ns))

    def engage(self, channel: int, volts: float, frequency_hz: float) -> int:
        """Volts on one output until ``release``, kept up while ``wait`` lets time pass; returns when they begin.

        One supply: outputs that are on together have the highest volts and frequency asked for. Volts fall by themselves when
        nobody waits.

        :param channel: output, from 0.
        :param volts: amplitude, V, 0 to the brake's limit.
        :param frequency_hz: of the square wave, Hz.
        :return: when the volts begin, ns on the bench's clock.
        :raises InputError: no brake board, an output without a name in the configuration, volts or frequency out of range.
        """
        brakes, name = self._brake(channel)
        now_ns = self.now_ns
        brakes.engage(name, volts, now_ns, frequency_hz=frequency_hz)
        self.glove.tick(now_ns)
        self._note("engaged", name, detail=f"{volts:g} V {frequency_hz:g} Hz")
        return now_ns + COMMAND_LEAD_NS

    def release(self, channel: int) -> int:
        """No volts on one output any more; returns when it is shorted.

        :param channel: output, from 0.
        :return: when the output is shorted, ns on the bench's clock.
        :raises InputError: no brake board, or an output without a name in the configuration.
        """
        brakes, name = self._brake(channel)
        now_ns = self.now_ns
        brakes.release(name, now_ns)
        self.glove.tick(now_ns)
        self._note("released", name)
        return now_ns + COMMAND_LEAD_NS

    def refusals(self) -> list[str]:
        """Commands that the board refused or did not answer, so far, in words.

        :return: one line for each command, the command's name first.
        """
        said = [(name, one) for name, one in self._pending if one.done]
        lost = [f"{name}: {one.error}" for name, one in said if one.error is not None]
        refused = [f"{name}: {Status(one.status).name.lower()}" for name, one in said if one.error is None and one.status]
        return lost + refused + self._brake_refusals

    def faults(self) -> tuple[Fault, ...]:
        """What went wrong at the board or on the way to it.

        :return: board faults, and one for all refused commands together; empty if nothing went wrong.
        """
        board = tuple(Fault("board", text) for text in self.glove.faults)
        refused = self.refusals()
        if refused:
            kinds = ", ".join(sorted(set(refused)))
            board += (
                Fault("board", f"{len(refused)} commands were not carried out ({kinds}); is the board free, and the line good?"),
            )
        return board

    # On the way off.

    def _rest(self) -> None:
        """Nothing pulls, then nothing is held, then pins are back: what a board can only do while it takes commands."""
        self._stop_stage()
        self._let_go()
        self._withdraw()

    def _let_go(self) -> None:
        """Brakes released, as long as the board takes commands; the driver would drive again once it is armed anew."""
        brakes, watch = self.glove.brakes, self.watch
        if brakes is None or not brakes.engaged():
            return
        brakes.release_all(self.now_ns)
        if not self.link.armed or self.link.error is not None:
            return
        self.watch = None
        with contextlib.suppress(HapticsError):
            self.glove.tick(self.now_ns)
            self.wait(2 * COMMAND_LEAD_NS / NS_PER_S)
        self.watch = watch

    def _withdraw(self) -> None:
        """Pins that this bench sent out go back, three at a time, as long as the board takes commands."""
        now_ns = self.now_ns
        out = sorted(channel for channel, back_ns in self._back_ns.items() if back_ns > now_ns)
        self._back_ns.clear()
        if not out or not self.link.armed or self.link.error is not None:
            return
        try:
            for first in range(0, len(out), 3):
                at_ns = self.now_ns + 2 * PULSE_LEAD_NS
                self.pulse(out[first : first + 3], at_ns, WITHDRAW_S, toward_skin=False)
                self.watch = None
                self.wait_until(at_ns + seconds_to_ns(2 * WITHDRAW_S))
        except HapticsError:
            pass  # what ends the run is already on its way to the caller, and the pins stay latched without power

    def _brake(self, channel: int) -> tuple[BrakeDriver, str]:
        brakes = self.glove.brakes
        if brakes is None:
            raise InputError(f"board = {self.board!r} has no brakes; this needs a rig on a brake board")
        return brakes, brakes.channels[int(in_range("channel", channel, 0, len(brakes.channels) - 1))]
