"""What a program asks of a glove: pins, pulses, brakes, piezos. Its wishes are its own, beside those of a scene."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager

from haptics.devices import BrakeShare, TactilesShare
from haptics.devices.brake import LONGEST_PIEZO_S
from haptics.devices.sharing import LONGEST_HOLD_S, PROGRAM
from haptics.devices.tactiles import MAX_CYCLES
from haptics.errors import InputError, nearest
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.time import seconds_to_ns
from haptics.units import brief, known_arguments, number, one_of, whole_number


class GloveCalls:
    """The part of a glove that asks its boards for something. See ``Glove``."""

    devices: Devices
    configuration: Configuration

    def turn(self, missed_allowed: bool = False, ended_allowed: bool = False) -> AbstractContextManager[Devices]:
        """The glove's devices, for one call alone.

        :param missed_allowed: also while the boards have made themselves safe for want of their host.
        :param ended_allowed: also after the thread that served the glove has ended.
        :return: a context that gives the devices.
        """
        raise NotImplementedError

    @known_arguments
    def contact(self, site: str, ttl_s: float = LONGEST_HOLD_S) -> None:
        """Bring a pin out to the skin, where it stays, without power, until :meth:`release` or for its time.

        :param site: of the array, such as ``index_tip``.
        :param ttl_s: how long, 1 ms to 60 s; call again before it ends to go on.
        :raises InputError: no such site, out of range, or this glove has no array.
        """
        with self.turn() as devices:
            array = self._array()
            ttl_s = number("ttl_s", ttl_s, 0.001, LONGEST_HOLD_S, "s")
            array.contact(one_of("site", site, array.sites), devices.now_ns(), ttl_s=ttl_s)

    @known_arguments
    def release(self, site: str) -> None:
        """Take a pin back in, unless a session on the glove wants it out, too.

        :param site: of the array.
        :raises InputError: no such site, or this glove has no array.
        """
        with self.turn() as devices:
            array = self._array()
            array.release(one_of("site", site, array.sites), devices.now_ns())

    @known_arguments
    def pulse(self, site: str, count: int = 1, rate_hz: float = 50.0) -> None:
        """Taps: the pin toward the skin and back at once. Each may be denied by heat or current, which :meth:`results` reports.

        :param site: of the array.
        :param count: how many, 1 to 1000.
        :param rate_hz: 1 to 100 Hz.
        :raises InputError: no such site, no whole number, or out of range.
        """
        with self.turn() as devices:
            array = self._array()
            one_of("site", site, array.sites)
            count = whole_number("count", count, 1, 1000)
            period_ns = seconds_to_ns(1.0 / number("rate_hz", rate_hz, 1.0, 100.0, "Hz"))
            array.train(site, count, period_ns, devices.now_ns())

    @known_arguments
    def burst(self, site: str, cycles: int = MAX_CYCLES) -> None:
        """A short buzz at 200 Hz (thesis 3.4.5), which something more urgent may cut at the end of a cycle.

        :param site: of the array.
        :param cycles: of 5 ms, 1 to 10: a burst lasts at most 50 ms (thesis 3.5.2).
        :raises InputError: no such site, no whole number, or out of range.
        """
        with self.turn() as devices:
            array = self._array()
            one_of("site", site, array.sites)
            array.burst(site, whole_number("cycles", cycles, 1, MAX_CYCLES), devices.now_ns())

    @known_arguments
    def brake(
        self,
        name: str,
        force_n: float | None = None,
        volts: float | None = None,
        ttl_s: float = 0.2,
        frequency_hz: float | None = None,
    ) -> float:
        """Hold a brake for a while, by force or by volts. Brakes that are on together share the highest volts and frequency.

        :param name: of the brake, such as ``index``.
        :param force_n: what it has to hold, N; volts follow from its fitted law (thesis 4.7.1).
        :param volts: amplitude, V, 0 to the limit of configuration and board.
        :param ttl_s: how long, 1 ms to 60 s; call again before it ends to go on.
        :param frequency_hz: of the square wave, 0.1 Hz to the limit; the configuration's if None.
        :return: the volts asked for, V.
        :raises InputError: neither or both of force and volts, out of range, no such brake, or this glove has no brakes.
        """
        with self.turn() as devices:
            brakes = self._brakes()
            self._brake_named(name, brakes)
            ttl_s = number("ttl_s", ttl_s, 0.001, LONGEST_HOLD_S, "s")
            if frequency_hz is not None:
                frequency_hz = number("frequency_hz", frequency_hz, 0.1, brakes.max_frequency_hz, "Hz")
            volts = self._volts(name, force_n, volts, brakes.max_amplitude_v)
            brakes.engage(name, volts, devices.now_ns(), ttl_s, frequency_hz)
            return volts

    @known_arguments
    def release_brake(self, name: str | None = None) -> None:
        """Let go of a brake before its time; what a session on the glove holds goes on.

        :param name: of the brake; all of them if None.
        :raises InputError: no such brake, or this glove has no brakes.
        """
        with self.turn() as devices:
            brakes = self._brakes()
            if name is None:
                brakes.release_all(devices.now_ns())
            else:
                brakes.release(self._brake_named(name, brakes), devices.now_ns())

    @known_arguments
    def piezo(self, name: str, duration_s: float = 0.3) -> None:
        """Vibrate the fingertip piezo beside a brake, as at the begin of a grasp (thesis 4.6.1).

        :param name: of the brake.
        :param duration_s: 1 ms to 1 s.
        :raises InputError: no such brake, out of range, or this glove has no brakes.
        """
        with self.turn() as devices:
            brakes = self._brakes()
            self._brake_named(name, brakes)
            brakes.piezo([name], number("duration_s", duration_s, 0.001, LONGEST_PIEZO_S, "s"), devices.now_ns())

    def _volts(self, name: str, force_n: object, volts: object, max_v: float) -> float:
        """Volts for a brake, given by exactly one of its force and its volts."""
        if (force_n is None) == (volts is None):
            raise InputError(f"force_n = {force_n}, volts = {volts}; expected exactly one of them")
        if force_n is None:
            return number("volts", volts, 0.0, max_v, "V")
        law, overlap_m2 = self.configuration.brake.law(name)
        # The thumb's law is fitted to 800 V; a brake may be driven to the configured maximum all the same.
        held_n = law.force_n(max_v, overlap_m2, extrapolate=True)
        asked_n = number("force_n", force_n, 0.0, math.inf, "N")
        needed_v = law.volts_for(asked_n, overlap_m2, extrapolate=True)
        if asked_n > held_n:
            raise InputError(
                f"force_n = {asked_n:g} N needs {needed_v:.0f} V; the {name} brake holds at most {held_n:.3g} N at {max_v:g} V"
            )
        return min(needed_v, max_v)

    def _brake_named(self, name: object, brakes: BrakeShare) -> str:
        if not isinstance(name, str) or name not in brakes.channels:
            known = f"{' or '.join(brakes.channels)}{nearest(name, brakes.channels)}"
            raise InputError(f"name = {brief(name)} is not a brake of this glove; expected {known}")
        return name

    def _array(self) -> TactilesShare:
        share = self.devices.share_tactiles(PROGRAM)
        if share is None:
            raise InputError("this glove was opened without a tactor array; open it with tactiles=…")
        return share

    def _brakes(self) -> BrakeShare:
        share = self.devices.share_brakes(PROGRAM)
        if share is None:
            raise InputError("this glove was opened without a brake controller; open it with brake=…")
        return share
