"""Breaks of the simulated boards in Python: what a board must refuse, and what it must let go of by itself."""

from __future__ import annotations

from mutant import in_file

_BRAKE = "tests/firmware_models/boards/test_sim_brake.py -k 'not level'"
_COILS = "tests/firmware_models/boards/test_sim_tactiles.py -k 'not level'"
_BOTH = "tests/firmware_models/test_sim_protocol.py tests/firmware_models/boards/test_sim_tactiles.py " + _BRAKE
_RULES = "tests/link_trial/test_conformance.py -k 'backend and -py-'"
_FAULTS = "tests/firmware_models/plants/test_plant_faults.py -k 'not -c- and not avr and not c- and not -c]'"

_ACCOUNT = "tests/firmware_models/boards/test_on_time_account.py -k 'py]'"

BOARDS = [
    *in_file(
        "firmware_models/boards/board.py",
        _BOTH,
        (
            "stop leaves the outputs as they are",
            "volts stay on the skin's neighbour after the one command that must always work",
            "def _stop(self, message: Any) -> int:\n        self._outputs_off()",
            "def _stop(self, message: Any) -> int:",
        ),
        (
            "disarm leaves the outputs as they are",
            "a disarmed glove goes on driving",
            "def _disarm(self, message: Any) -> int:\n        self._outputs_off()",
            "def _disarm(self, message: Any) -> int:",
        ),
        (
            "disarm forgets faults whose cause is still there",
            "a bridge that never discharged is armed again",
            "if self.faults >> fault & 1 and self._cause_gone(fault):",
            "if self.faults >> fault & 1:",
        ),
        (
            "arms with any boot id",
            "a host arms a board that rebooted behind its back",
            "if message.boot_id != self.boot_id:",
            "if False:",
            _RULES,
        ),
        (
            "arms over a latched fault",
            "a short or a stuck driver is fed again",
            "if self.faults:\n            raise Refusal(Status.INTERLOCK, self.faults)",
            "if False:\n            raise Refusal(Status.INTERLOCK, self.faults)",
            _RULES,
        ),
        (
            "waits twice the dead-man time",
            "volts stay for another tenth of a second after the host died",
            "return self._fed_ns + DEAD_MAN_MS * NS_PER_MS if",
            "return self._fed_ns + 2 * DEAD_MAN_MS * NS_PER_MS if",
        ),
        (
            "any frame of a known sum feeds the dead-man",
            "a babbling line keeps a dead host alive",
            "        if name:\n            self._fed_ns = self.now_ns",
            "        if frame:\n            self._fed_ns = self.now_ns",
        ),
        (
            "a latched fault does not make safe",
            "the fault is reported and the current flows on",
            'reported within 0 to 65535.\n        """\n        self._outputs_off()',
            'reported within 0 to 65535.\n        """',
        ),
        (
            "a reset leaves the outputs as they are",
            "opening a port leaves volts on that no command explains",
            'a reboot."""\n        self._outputs_off()\n        self._line',
            'a reboot."""\n        self._line',
            "tests/link/test_fault_matrix.py -k 'py and (opening or brown_out)'",
        ),
        (
            "plays what came too late",
            "a touch is felt long after it was meant",
            "if ahead < 0:\n            raise Refusal(Status.LATE",
            "if ahead < -FARTHEST_TICKS:\n            raise Refusal(Status.LATE",
        ),
        (
            "takes times that lie far ahead",
            "a forgotten command plays minutes later",
            "if ahead > FARTHEST_TICKS:",
            "if ahead > 100 * FARTHEST_TICKS:",
        ),
        (
            "takes timed commands in the self test",
            "untested brakes are driven",
            "if not self.armed or self.state == State.SELF_TEST:",
            "if not self.armed:",
        ),
        (
            "timed commands need no arming",
            "a board that nobody armed drives",
            "if not self.armed or self.state == State.SELF_TEST:",
            "if self.state == State.SELF_TEST:",
        ),
        (
            "takes limits while armed",
            "limits change under a running drive",
            "    def _configure(self, message: Any) -> int:\n        if self.armed:",
            "    def _configure(self, message: Any) -> int:\n        if False:",
            _RULES,
        ),
        (
            "takes looser limits",
            "a host talks the board out of what it was built with",
            "if wanted < present if index in self.stricter_upward else wanted > present:",
            "if False:",
        ),
        (
            "carries out a repetition",
            "one lost reply, and the pulse is felt twice",
            'elif frame.seq in self._answered and name != "stop":',
            "elif False:",
        ),
        (
            "hides a brown-out",
            "a supply that breaks down looks like a sound one",
            "self.faults, self.state = 1 << Fault.BROWN_OUT, State.FAULT",
            "self.faults, self.state = 0, State.DISARMED",
            "tests/link/test_fault_matrix.py -k 'py and brown_out'",
        ),
    ),
    *in_file(
        "firmware_models/boards/tactiles_board.py",
        _COILS,
        (
            "takes pulses of any length",
            "a coil burns through its wire",
            "if any(not 1 <= message.duration[channel] <= self.limits[_LONGEST_PULSE] for channel in chosen):",
            "if any(not 1 <= message.duration[channel] for channel in chosen):",
        ),
        (
            "lets one coil more than the current allows",
            "the supply sags and pins stay where they should not",
            "if coils * COIL_WORST_MA > self.limits[_COIL_CURRENT]:",
            "if (coils - 1) * COIL_WORST_MA > self.limits[_COIL_CURRENT]:",
        ),
        (
            "lets pulses of one coil overlap",
            "ten milliseconds become twenty",
            "        if blocked:\n",
            "        if False:\n",
        ),
        (
            "has no end to its queue",
            "seconds of touch wait in a board that nobody can see into",
            "if len(self._queue) + len(chosen) > self.limits[_QUEUE]:",
            "if False:",
        ),
        (
            "keeps its queue when made safe",
            "pulses of before the stop play after it",
            "        self._queue.clear()\n        self._charge_unasked(",
            "        self._charge_unasked(",
        ),
        (
            "feeds its drivers while disarmed",
            "a stuck driver burns though nobody armed",
            "        self.plant.feed(False, self.now_ns)\n\n    def _forget",
            "\n    def _forget",
            _FAULTS,
        ),
        (
            "cancel forgets nothing",
            "what was taken back plays",
            "kept = [pulse for pulse in self._queue if not message.channels >> pulse.channel & 1]",
            "kept = list(self._queue)",
        ),
        (
            "arms without a coil supply",
            "the host believes in pins that cannot move",
            "if self._supply_low():\n            raise Refusal",
            "if False:\n            raise Refusal",
            _FAULTS,
        ),
    ),
    *in_file(
        "firmware_models/boards/tactiles_board.py",
        _ACCOUNT,
        (
            "takes pulses of a coil that was on for too long",
            "ten milliseconds every ten: 319 K in half a minute",
            "            raise Refusal(Status.HOT, hot)\n\n    def _max_on_s",
            "            pass\n\n    def _max_on_s",
        ),
        (
            "charges nothing to its coils' accounts",
            "a coil burns, and its account says cold",
            "            self.heat.begin(pulse.channel, _length_s(pulse), self.now_ns)\n            self._played",
            "            self._played",
        ),
        (
            "counts nothing of what waits",
            "a queue full of pulses takes a coil beyond its account",
            "hot = self.heat.hot(_on_time_s(wanted), _on_time_s(self._queue), self._max_on_s(), self.now_ns)",
            "hot = self.heat.hot(_on_time_s(wanted), _NOTHING_S, self._max_on_s(), self.now_ns)",
        ),
        (
            "charges nothing for a driver that was stuck",
            "each arming warms the stuck coil anew",
            "            self._charge_unasked(flowed_ns)\n",
            "",
        ),
        (
            "arms beyond its account",
            "a stuck driver is fed as often as it is armed",
            "            raise Refusal(Status.HOT, hot)\n        self.state",
            "            pass\n        self.state",
        ),
        (
            "a brown-out makes coils cold",
            "who pulls the plug may burn a coil again",
            "        self.heat.lose_power(self._max_on_s(), self.now_ns)\n",
            "        self.heat = CoilHeat(self.now_ns)\n",
        ),
        (
            "a reset makes coils cold",
            "who opens the port again may burn a coil again",
            "        super().reset()\n\n    def brown_out",
            "        super().reset()\n        self.heat = CoilHeat(self.now_ns)\n\n    def brown_out",
        ),
    ),
    *in_file(
        "firmware_models/boards/coil_heat.py",
        _ACCOUNT,
        (
            "accounts cool twice as fast as coils",
            "after a minute a coil is 40 K warm, and its account says 25",
            "kept = math.exp((self._at_ns - now_ns) / NS_PER_S / THERMAL.tau_s)",
            "kept = math.exp((self._at_ns - now_ns) / NS_PER_S / THERMAL.tau_s * 2)",
        ),
        (
            "a loss of power hides a warm coil",
            "who pulls the plug may burn a coil again",
            "worst_s = limit_s if self._warm else",
            "worst_s = WARM_S if self._warm else",
        ),
    ),
    *in_file(
        "firmware_models/boards/coil_guards.py",
        _FAULTS,
        (
            "does not watch the coils' supply",
            "pins half move, and nobody learns of it",
            "if supply_mv < min_mv:",
            "if supply_mv < 0:",
        ),
        (
            "does not watch the coils' current",
            "a shorted coil is fed on",
            "if now_ns - self._over_since_ns >= OVER_NS:",
            "if now_ns - self._over_since_ns >= 1000 * OVER_NS:",
        ),
        (
            "does not find a driver that sticks",
            "one coil on for ever: 60 K a minute",
            "if unexplained and self._unasked_ns >= longest",
            "if unexplained and self._unasked_ns >= 1000 * longest",
        ),
    ),
    *in_file(
        "firmware_models/boards/brake_board.py",
        _BRAKE,
        (
            "has no limit of its charge",
            "more than 45 uC stand behind a fingertip",
            " or charge_c > 1e-9 * self.limits[_CHARGE]:",
            ":",
        ),
        (
            "has no limit of its amplitude",
            "1501 V and more",
            "message.amplitude > self.limits[_AMPLITUDE] or charge_c",
            "charge_c",
        ),
        (
            "reverses faster than its supply can charge",
            "the brake holds less than was asked, and nobody learns of it",
            "min(self.limits[_FREQUENCY], fastest_dhz)",
            "self.limits[_FREQUENCY]",
        ),
        (
            "drives for as long as it is asked to",
            "volts outlive a host that said 'for ever'",
            "if not 0 < message.ttl <= self.limits[_TTL]:",
            "if not 0 < message.ttl:",
        ),
        (
            "vibrates for as long as it is asked to",
            "a fingertip buzzes for a minute",
            "if not 0 < message.duration <= self.limits[_TTL]:",
            "if not 0 < message.duration:",
            _RULES,
        ),
        (
            "arms with its lid open",
            "volts under a hand that is in the box",
            "if self.plant.lid_open or self.plant.highest_v",
            "if self.plant.highest_v",
            _FAULTS,
        ),
        (
            "arms with volts left on it",
            "what has not discharged is driven again",
            "self.plant.highest_v(self.now_ns) >= TOUCHABLE_VOLTS:",
            "self.plant.highest_v(self.now_ns) >= 100 * TOUCHABLE_VOLTS:",
        ),
        (
            "a lid that opens while nothing is driven leaves it armed",
            "the next command drives into an open box",
            "if self.plant.lid_open and self.armed:",
            "if self.plant.lid_open and self._drive is not None:",
            _FAULTS,
        ),
        (
            "a lid that opens while it drives changes nothing",
            "volts under a hand that is in the box",
            "if self.plant.lid_open and self.armed:",
            "if self.plant.lid_open and self.state == State.ARMED:",
            _FAULTS,
        ),
        (
            "a drive does not end with its time",
            "volts stay when the host has lost interest",
            "if self._drive is not None and self._drive.end_ns <= now_ns:",
            "if self._drive is not None and self._drive.end_ns + 20 * NS_PER_MS <= now_ns:",
        ),
        (
            "keeps its drives when made safe",
            "volts come back after a stop",
            "        self._queue.clear()\n        self._bursts.clear()",
            "        self._bursts.clear()",
        ),
        (
            "keeps its bursts when made safe",
            "a fingertip buzzes after a stop",
            "        self._queue.clear()\n        self._bursts.clear()",
            "        self._queue.clear()",
        ),
        (
            "a drive that waited for empty outputs survives a stop",
            "volts two milliseconds after a stop",
            "self._drive, self._test, self._waiting = None, None, None",
            "self._drive, self._test = None, None",
        ),
        (
            "does not notice that its outputs do not discharge",
            "volts stay where the host sees none",
            "self.latch(Fault.BRIDGE_STUCK, WHOLE_BOARD, round(volts))",
            "pass",
        ),
        (
            "drives outputs without a brake",
            "volts on a bare connector",
            "if message.channels & ~_ALL or any(self._guards.capacitance_f[channel] == 0.0 for channel in chosen):",
            "if message.channels & ~_ALL:",
        ),
        (
            "begins another wave without shorting first",
            "an output that was let go of keeps its charge",
            "            self._discharge(State.ARMED)\n        self._waiting = None if drive.mask == 0 else drive",
            "            pass\n        self._waiting = None if drive.mask == 0 else drive",
            _RULES,
        ),
        (
            "a dead-man does not guard the way back to armed",
            "a host that dies while it discharges leaves a board armed for ever",
            "return super().armed or (self.state == State.DISCHARGING and self._then == State.ARMED)",
            "return super().armed",
        ),
    ),
    *in_file(
        "firmware_models/boards/brake_guards.py",
        "tests/firmware_models/boards/test_sim_brake.py -k 'trips or found or latches or stuck or leak'",
        ("does not watch for too many volts", "the dielectric breaks", "OVER_VOLTAGE = 1.05", "OVER_VOLTAGE = 105.0"),
        ("does not watch the supply's current", "a short is fed on", "OVER_CURRENT_A = 550e-6", "OVER_CURRENT_A = 550.0"),
        (
            "does not notice a bridge that stands still",
            "one polarity for ever charges the dielectric, and the brake never lets go",
            "now_ns - self._sign_ns > STUCK_HALF_PERIODS * self._half_ns + slack_ns",
            "False",
        ),
        (
            "takes a short for a slow ramp",
            "a brake that broke down is fed on",
            "return Trip(Fault.SHORT, channel, round(volts))",
            "pass",
            _FAULTS,
        ),
        (
            "does not notice that a brake is gone",
            "the hand is not held, and volts stand on an open wire",
            "return Trip(Fault.OPEN, channel, round(volts))",
            "pass",
        ),
        (
            "does not watch for leaks",
            "current through skin",
            "return Trip(Fault.LEAK, channel, round(leak_a * 1e7)) if leak_a > LEAK_A else None",
            "return None",
        ),
    ),
    *in_file(
        "firmware_models/boards/brake_power_on.py",
        "tests/firmware_models/boards/test_sim_brake.py -k 'self_test or brake_at_all or arming or without_a_brake'",
        (
            "tests with volts that make a force",
            "arming jerks a finger",
            "TEST_V = 40.0\nREAD_V = 25.0",
            "TEST_V = 400.0\nREAD_V = 250.0",
        ),
        (
            "takes a torn brake for a sound one",
            "a brake that cannot hold is armed",
            "return Failed(Fault.OPEN, channel, round(measured_f * 1e12))",
            "pass",
        ),
        (
            "arms with no brake at all",
            "volts on bare connectors",
            "if any(self._capacitance_f) else Failed(Fault.SELF_TEST, WHOLE_BOARD, 0)",
            "",
        ),
    ),
]
