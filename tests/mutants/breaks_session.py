"""Breaks of the glove: arming, going off, what a board's news forbids, heat that outlives hosts, and limits that a file sets."""

from __future__ import annotations

from mutant import in_file

_GLOVE = "tests/session/test_glove_safety.py"
_SWITCHING = "tests/session/test_switching.py"
_PERMISSION = "tests/session/test_permission.py -k 'py]'"
_CONFIGURATION = "tests/session/test_configuration.py"
_HEAT = "tests/session/test_heat.py -k 'not -c] and not -avr] and not c- and not avr-'"
_OPEN = "tests/session/test_open_glove.py"

SESSION = [
    *in_file(
        "haptics/session/devices.py",
        _GLOVE,
        (
            "an arming that is interrupted leaves boards armed",
            "a Ctrl-C leaves half a glove armed",
            "        except BaseException:\n            self.off()\n            raise",
            "        except BaseException:\n            raise",
            _SWITCHING,
        ),
        (
            "off does not stop the boards",
            "the script ends, the volts stay until the dead-man fires",
            "pendings = [link.stop(self.now_ns()) for link in self.links.values() if link.error is None]",
            "pendings = []",
        ),
        (
            "an off leaves wishes to the next arming",
            "800 V come back with the next arming, and nobody asked",
            "        self._permitted.clear()\n        if self.tactiles is not None:",
            "        self._permitted.clear()\n        if self.tactiles is not None and self._opened is None:",
        ),
        (
            "the host goes on scheduling after the board disarmed",
            "what is asked of a board that is off waits for the next arming",
            "            if name in self._permitted and not self.obeys(name):\n                self._forbid(name)",
            "            if name in self._permitted and not self.obeys(name):\n                pass",
            f"{_GLOVE} {_PERMISSION}",
        ),
        (
            "a fault of the brake leaves its wishes",
            "volts come back with the next arming, and nobody asked",
            '        elif name == "brake":\n            self._set_brakes(False)',
            '        elif name == "":\n            self._set_brakes(False)',
            _PERMISSION,
        ),
        (
            "a missed dead-man is passed over",
            "a host that hung believes in volts that are gone",
            "if silent_ns <= link.identity.dead_man * NS_PER_MS:",
            "if silent_ns <= 100 * link.identity.dead_man * NS_PER_MS:",
            "tests/session/test_permission.py -k 'missed and py]'",
        ),
        (
            "who goes off a second time ends the first",
            "two threads go off, and one is told that it failed",
            "            if off is not None:\n                return off\n",
            "",
            _SWITCHING,
        ),
        (
            "heat of before is not taken over",
            "five hosts one after the other: 65 K in one run",
            "            self._take_over_heat(self.tactiles)\n",
            "            pass\n",
            _HEAT,
        ),
    ),
    *in_file(
        "haptics/session/board_news.py",
        _GLOVE,
        (
            "a board that disarmed by itself is no fault",
            "nobody is told that the glove is dead",
            '            if self.wanted_armed:\n                self.fault(f"{name}: disarmed',
            '            if False:\n                self.fault(f"{name}: disarmed',
        ),
    ),
    *in_file(
        "haptics/session/opening.py",
        _GLOVE,
        (
            "the rise limit of the file does not reach the accounts",
            "a person who asked for 10 K gets 25",
            "limits_k = [min(part.rise_limit_k, coil.limit_k(on_time_ms / 1000)) for coil in coils]",
            "limits_k = [min(25.0, coil.limit_k(2.5)) for coil in coils]",
            _CONFIGURATION,
        ),
        (
            "the current limit of the file does not reach the scheduler",
            "a small supply is asked for 12 A",
            "            current_ma / 1000,\n",
            "            12.0,\n",
            _CONFIGURATION,
        ),
        (
            "the scheduler goes beyond the account of a stricter board",
            "a lab's own limit is met by refusals, and pins stay out",
            "limits_k = [min(part.rise_limit_k, coil.limit_k(on_time_ms / 1000)) for coil in coils]",
            "limits_k = [part.rise_limit_k for coil in coils]",
            _HEAT,
        ),
        (
            "the file's time to live does not reach the brakes",
            "volts outlive a hung program by more than was asked for",
            "ttl_s = min(part.ttl_s, ttl_ms / 1000)",
            "ttl_s = 1.0",
            _CONFIGURATION,
        ),
        (
            "the file's limits do not reach the boards",
            "a raw frame does what the file forbids",
            "            return stricter(board, wanted, identity.limits)",
            "            return tuple(identity.limits)",
            _HEAT,
        ),
    ),
    *in_file(
        "haptics/session/switching.py",
        _GLOVE,
        (
            "arms what is left when one board would not",
            "half a glove is armed, and the script has ended",
            "        yield from going_off(devices)\n        raise",
            "        raise",
            _SWITCHING,
        ),
        (
            "an arming leaves armed boards as they are",
            "volts of before go on under the new arming",
            "        yield from _stop_what_is_armed(devices)\n",
            "",
            _PERMISSION,
        ),
        (
            "pins stay out where arming again fails for the other board",
            "a pin rests on a skin that touches nothing, and no board is armed that could withdraw it",
            "    yield from _withdraw_pins(devices)\n    devices.drop_wishes()\n",
            "    devices.drop_wishes()\n",
        ),
        (
            "takes a board that tests itself for armed",
            "the first drives are refused, and nobody knows why",
            "(yield Until(lambda name=name: devices.state_of(name) in ARMED_STATES, ARM_TIMEOUT_S))",
            "(yield Until(lambda name=name: devices.state_of(name) is not None, ARM_TIMEOUT_S))",
        ),
        (
            "a board that disarms while another arms goes unnoticed",
            "half a glove is armed, and the script goes on",
            "        if not devices.obeys(name):\n            raise LimitError",
            "        if name == '':\n            raise LimitError",
        ),
        (
            "a board that disarms while pins are withdrawn goes unnoticed",
            "half a glove is armed, and the script goes on",
            '            _check_obey(devices, needed, "while pins were withdrawn")\n',
            "",
            f"{_GLOVE} {_SWITCHING}",
        ),
        (
            "arming leaves pins out",
            "a pin that an earlier host left out rests on a skin that touches nothing",
            "            array.withdraw_all(devices.now_ns())\n            yield",
            "            yield",
            _SWITCHING,
        ),
        (
            "off leaves the pins out",
            "a glove is off with its pins in the skin",
            "        array.withdraw_all(devices.now_ns())\n        yield",
            "        yield",
            "tests/devices/test_tactiles_driver.py",
        ),
        (
            "off does not wait for the pins",
            "a stop cuts the strokes that withdraw them",
            "        array.withdraw_all(devices.now_ns())\n        yield Until(devices.pins_settled, OFF_TIMEOUT_S)",
            "        array.withdraw_all(devices.now_ns())\n        yield Until(devices.pins_settled, 0.0)",
            "tests/devices/test_tactiles_driver.py",
        ),
        (
            "off drops volts before pins are in",
            "a finger moves away from a pin that is still out",
            "        yield from _withdraw_pins(devices)\n        yield from _drop_volts(devices)",
            "        yield from _drop_volts(devices)\n        yield from _withdraw_pins(devices)",
            _PERMISSION,
        ),
        (
            "an old fault keeps off from withdrawing pins",
            "after one fault no off ever withdraws pins again",
            'devices.permits("tactiles") and devices.obeys("tactiles"):',
            'devices.permits("tactiles") and devices.obeys("tactiles") and not devices.faults:',
            _PERMISSION,
        ),
        (
            "off is broken off with whoever waits for it",
            "a second Ctrl-C leaves volts on",
            "    finally:  # also when it is cut short\n        pendings = devices.stop_all()",
            "    except ValueError:\n        raise\n    pendings = devices.stop_all()",
        ),
        (
            "clearing disarms what is armed",
            "an arming succeeds, and the glove is off",
            "if link.ready and not link.armed}",
            "if link.ready}",
            _SWITCHING,
        ),
        (
            "an off that is asked for does not end an arming",
            "who wants the glove off waits until it is armed",
            "            self.done, self.error = True, HapticsError(why)\n            self._steps.close()",
            "            pass",
            _SWITCHING,
        ),
    ),
    *in_file(
        "haptics/session/heat.py",
        _HEAT,
        (
            "believes the board's account to be half",
            "a second host warms a coil that is warm already",
            "budget.raise_to(coil.rise_k(count * unit_s), budget.latest_ns)",
            "budget.raise_to(coil.rise_k(count * unit_s) / 2, budget.latest_ns)",
        ),
    ),
    *in_file(
        "haptics/scheduling/coil_heat.py",
        "tests/scheduling/test_coil_heat.py",
        (
            "a host's limit lies beyond its board's",
            "legal strokes are refused, and pins stay out",
            "return (1.0 - MARGIN) * on_time_s * self.jump_k_per_s * min(1.0, self.parameters.tau_s / BOARD_TAU_S)",
            "return 1.2 * on_time_s * self.jump_k_per_s * min(1.0, self.parameters.tau_s / BOARD_TAU_S)",
        ),
        (
            "a slow body is taken for a quick one",
            "a coil that cools slowly is believed to be cool",
            "slowness = max(1.0, self.parameters.tau_s / BOARD_TAU_S)",
            "slowness = 1.0",
        ),
    ),
    *in_file(
        "haptics/session/configuration.py",
        _CONFIGURATION,
        (
            "counts an unmeasured coil as the published one",
            "eight of eight arrays pass their limit by up to 5 K",
            "c_k_per_w = THERMAL.c_k_per_w + THERMAL.c_sd_k_per_w if",
            "c_k_per_w = THERMAL.c_k_per_w if",
            "tests/session/test_heat.py -k 'within_tolerance'",
        ),
        (
            "believes a calibration to the last digit",
            "an array that was measured roughly passes its limit",
            "share = CALIBRATION_SDS * math.hypot(",
            "share = 0 * CALIBRATION_SDS * math.hypot(",
            f"{_CONFIGURATION} {_HEAT}",
        ),
        (
            "a file may ask for any rise",
            "300 K, because somebody slipped",
            "rise_limit_k: Annotated[float, Field(",
            "rise_limit_k: Annotated[float, Field(le=300) or Field(",
        ),
        (
            "a file may name any kind of port",
            "a file that was sent along overwrites another",
            'return check_board_port(port, "tactiles")',
            "return port",
        ),
    ),
    *in_file(
        "haptics/session/glove.py",
        _OPEN,
        (
            "the thread that serves a glove does not tick its session",
            "an engine hangs, and what the hand held stays held",
            "            self._session.serve(now_ns)\n",
            "            self.devices.tick(now_ns)\n",
            "tests/session/test_session_on_glove.py -k 'real_time or grasp'",
        ),
        (
            "closing does not go off",
            "a script that raised leaves volts on",
            "            self._off_at_last()\n            self._settle()",
            "            self._settle()",
            _GLOVE,
        ),
        (
            "who waits for an arming keeps everybody else waiting",
            "a hand goes on moving, and nothing is let go of",
            "        while self._service is not None and self._service.serves and not procedure.done:",
            "        while self._service is None:",
            _SWITCHING,
        ),
        (
            "leaving by an exception closes nothing",
            "a script that raised leaves volts on",
            "            with unbroken:\n                self.close()",
            "            with unbroken:\n                self.close() if kind is None else None",
            _GLOVE,
        ),
        (
            "a closed glove takes calls",
            "a script believes in touches of a glove that is off",
            '                raise GloveEnded("this glove is closed; open another with haptics.open")',
            "                pass",
        ),
        (
            "a glove that nobody serves takes calls",
            "a thread died, and the script goes on believing",
            "                service.check()\n",
            "                pass\n",
        ),
    ),
    *in_file(
        "haptics/session/service.py",
        _OPEN,
        (
            "a dead-man that was missed is held against the glove for ever",
            "an engine arms again, and every call is still refused",
            "if self._missed is not None and self._devices.times_armed == self._missed_when:",
            "if self._missed is not None:",
        ),
        (
            "a dead-man that was missed is passed over",
            "a script that hung believes in touches of a glove that is off",
            "if self._missed is not None and self._devices.times_armed == self._missed_when:",
            "if self._missed == '':",
        ),
    ),
]
