"""Breaks of the drivers: what they ask boards for, what they believe of them, and what they forget."""

from __future__ import annotations

from mutant import in_file

_BRAKE = "tests/devices/test_brake_driver.py"
_SHARING = "tests/devices/test_sharing.py"
_ARRAY = "tests/devices/test_tactiles_driver.py"
_PINS = "tests/devices/test_pins.py -k 'not whatever_was_asked'"
_UNARMED = "tests/session/test_permission.py -k 'asked_for_unarmed and py]'"
_PERMISSION = "tests/session/test_permission.py -k 'armed_again and py]'"

DEVICES = [
    *in_file(
        "haptics/devices/brake.py",
        _BRAKE,
        (
            "takes volts beyond the glove's limit",
            "a typing mistake becomes 5 kV asked for",
            'amplitude_v = in_range("amplitude_v", amplitude_v, 0.0, self.max_amplitude_v, "V")',
            'amplitude_v = in_range("amplitude_v", amplitude_v, 0.0, 1e9, "V")',
        ),
        (
            "releasing one output leaves it on",
            "a finger is held that was let go",
            "            del self._holds[index]\n",
            "",
        ),
        (
            "takes new wishes while it goes off",
            "volts rise on a glove that is going off",
            "        if self._ended is not None:\n            self.refuse(",
            "        if self._ended == '':\n            self.refuse(",
            _SHARING,
        ),
        (
            "releasing all leaves the volts until they run out",
            "a hand that is gone is held on",
            "            self._holds.clear()\n            self._changed = True",
            "            self._holds.clear()",
        ),
        (
            "asks for two seconds whatever its time to live",
            "volts stay when the program hangs",
            "ttl_ms = self._ttl_ns // NS_PER_MS",
            "ttl_ms = 2000",
        ),
        (
            "renews a drive after it has ended",
            "a held hand is let go five times a second",
            "self._refresh_ns = now_ns + self._ttl_ns // 3",
            "self._refresh_ns = now_ns + 2 * self._ttl_ns",
        ),
        (
            "swallows what the board refused",
            "a brake that does not hold looks like one that does",
            "None if pending.ok else status_name(pending.status)",
            "None",
        ),
        (
            "swallows that the clock is not known",
            "a brake that does not hold looks like one that does",
            '            self._answered(command, "clock")\n            return',
            "            return",
        ),
        (
            "takes wishes while unarmed",
            "volts of before the arming come with it",
            '        if not self._armed:\n            self.refuse(name, "unarmed"',
            '        if self._armed is None:\n            self.refuse(name, "unarmed"',
            _UNARMED,
        ),
        (
            "keeps its wishes when it is disarmed",
            "800 V come back with the next arming, and nobody asked",
            "        self._holds.clear()\n        self._changed = False\n",
            "",
            _PERMISSION,
        ),
    ),
    *in_file(
        "haptics/devices/tactiles.py",
        _ARRAY,
        (
            "pulses at a pin that is out",
            "a touch ends because something ticked",
            "return pin.moving or pin.out is True or (pin.out is None and pin.wanted_out)",
            "return pin.moving",
        ),
        (
            "believes in a pin that never moved",
            "a pin that was denied is never asked for again, and never withdrawn",
            'pin.settle(token, None if reason == "unknown" else reason is None, ends_ns)',
            'pin.settle(token, None if reason == "unknown" else True, ends_ns)',
            f"{_ARRAY} {_PINS}",
        ),
        (
            "takes a stroke that nobody answered for played",
            "a pin may be out, and nobody withdraws it",
            'pin.settle(token, None if reason == "unknown" else reason is None, ends_ns)',
            "pin.settle(token, True if reason == 'unknown' else reason is None, ends_ns)",
            _PINS,
        ),
        (
            "gives no second try to a pin that the board refused as late",
            "a pin stays where it should not for one slow tick",
            "            if reason in WORTH_ANOTHER_TRY:",
            "            if reason is None:",
            "tests/rendering/test_loop.py -k refused_as_late",
        ),
        (
            "a release that the board refused is given up",
            "a pin stays in the skin",
            "            elif reason in RELEASE_AGAIN_NS and not out:",
            "            elif reason in RELEASE_AGAIN_NS and out:",
            _PINS,
        ),
        (
            "withdraws no pin",
            "a glove is off with its pins in the skin",
            "            if pin.heading is not False:\n                self.release(site, now_ns)",
            "            if pin.heading is not False and site == '':\n                self.release(site, now_ns)",
        ),
        (
            "a pin that is wanted out counts as left out",
            "a touch is told as a pin that is stuck",
            "pin.out is not False and not pin.wanted_out)",
            "pin.out is not False)",
            "tests/session/test_switching.py",
        ),
        (
            "an end leaves trains to come",
            "pulses of before the off come after it",
            "        self._deny_later(reason)\n        for outcome in self._scheduler.stop(reason):",
            "        for outcome in self._scheduler.stop(reason):",
            "tests/session/test_glove_safety.py",
        ),
        (
            "being disarmed leaves trains to come",
            "pulses of before a fault come after the next arming",
            '        self._deny_later("unarmed")\n        for pin in self._pins:',
            "        for pin in self._pins:",
            _PERMISSION,
        ),
        (
            "being disarmed leaves tries to come",
            "a pin moves with the next arming, and nobody asked",
            '        self._again.clear()\n        self._deny_later("unarmed")',
            '        self._deny_later("unarmed")',
            _PINS,
        ),
        (
            "being disarmed does not reach the scheduler",
            "the host goes on scheduling for a board that is off",
            "        self._armed, self._ended = armed, None\n        self._scheduler.set_armed(armed)",
            "        self._armed, self._ended = True, None\n        self._scheduler.set_armed(True)",
            f"{_ARRAY} tests/session/test_glove_safety.py",
        ),
        (
            "calls played what the board refused",
            "the report counts touches that nobody felt",
            "reason = outcome.reason if not outcome.played else refused",
            "reason = outcome.reason if not outcome.played else None",
            f"{_PINS} tests/rendering/test_loop.py",
        ),
        (
            "a train needs no arming",
            "pulses of before the arming come with it",
            "        if not self._armed:\n            for _ in range(count):",
            "        if self._armed is None:\n            for _ in range(count):",
        ),
    ),
    *in_file(
        "haptics/devices/coil_commands.py",
        _ARRAY,
        (
            "drives every coil toward the skin",
            "pins never come back",
            "toward |= bit if pulse.toward_skin else 0",
            "toward |= bit",
        ),
        (
            "sends every pulse half as long again",
            "coils burn half as long again as is booked",
            "durations[pulse.channel] = round(pulse.duration_s * 1e6 / DURATION_UNIT_US)",
            "durations[pulse.channel] = round(1.5 * pulse.duration_s * 1e6 / DURATION_UNIT_US)",
        ),
        (
            "takes a command that nobody answered for carried out",
            "a pin may be out, and nobody withdraws it",
            '    if pending.error is not None:\n        return "unknown"',
            "    if pending.error is not None:\n        return None",
            f"{_PINS} tests/session/test_permission.py -k 'doubt or whatever_was_asked or carry_out or pins'",
        ),
        (
            "takes what it waits no longer for for carried out",
            "a stroke that a stop cut is believed in",
            'for token in self._answered(pulse, "unknown")]',
            "for token in self._answered(pulse, None)]",
            _PINS,
        ),
    ),
    *in_file(
        "haptics/devices/sharing.py",
        _SHARING,
        (
            "what was asked for a moment stays for ever",
            "a brake stays on though the script asked for a moment",
            "return now_ns >= (self.lease.until_ns if self.until_ns is None else self.until_ns)",
            "return self.until_ns is None and now_ns >= self.lease.until_ns",
        ),
        (
            "a share that nobody renews keeps what it has",
            "a client hangs, and what it held stays held",
            "return now_ns >= (self.lease.until_ns if self.until_ns is None else self.until_ns)",
            "return self.until_ns is not None and now_ns >= self.until_ns",
        ),
        (
            "one owner's release takes a pin from all",
            "the hand leaves a ball, and what a program shows is gone",
            "        return not wishes\n",
            "        return True\n",
        ),
        (
            "one owner's release takes a brake from all",
            "the hand leaves a ball, and what a program holds lets go",
            "        first = self._first(name)\n        if first is None:",
            "        first = None\n        if first is None:",
        ),
        (
            "the last one to ask has a brake",
            "a scene overrules the person at the keyboard",
            "        if first is wish:",
            "        if first is not None:",
        ),
        (
            "of equals the weaker one has a brake",
            "a hand passes through what it holds",
            "key=lambda wish: (wish.priority, wish.amplitude_v)",
            "key=lambda wish: (wish.priority, -wish.amplitude_v)",
        ),
        (
            "wishes outlive a disarm",
            "a pin stays out after the next arming though its owner let go",
            "        for wishes in self._wishes.values():\n            wishes.clear()\n\n\nclass TactilesShare:",
            "\n\nclass TactilesShare:",
        ),
        (
            "volts outlive a disarm",
            "800 V come back after the next arming as somebody else lets go",
            "        self._given.clear()\n        for wishes in self._wishes.values():\n            wishes.clear()\n",
            "        self._given.clear()\n",
        ),
        (
            "keeps wishes for a board that is off",
            "a pin that nobody brought out is held out after the next arming",
            "        if self.driver.armed:\n            self._wishes[site]",
            "        if True:\n            self._wishes[site]",
        ),
    ),
    *in_file(
        "haptics/devices/pins.py",
        _PINS,
        (
            "a pin is where it was asked to be",
            "a pin that was denied is believed in for ever",
            "        if played is False or ends_ns < self._ended_ns:",
            "        if ends_ns < self._ended_ns:",
        ),
        (
            "answers out of order turn time round",
            "a pin is believed in that was withdrawn since",
            "        if played is False or ends_ns < self._ended_ns:",
            "        if played is False:",
        ),
        (
            "doubts nothing",
            "a stroke that a stop cut is believed in",
            "        if max(self._ended_ns, self._pulsed_ns) > from_ns:\n            self.out = None",
            "        if max(self._ended_ns, self._pulsed_ns) > from_ns:\n            self.out = self.out",
            f"{_PINS} tests/session/test_permission.py -k 'pin or stroke'",
        ),
    ),
]
