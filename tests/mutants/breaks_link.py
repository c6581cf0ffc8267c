"""Breaks of the host's side of the protocol: stop, disarm, retries, the window of commands, the board's clock."""

from __future__ import annotations

from mutant import in_file

_SESSION = "tests/link/test_link_session.py"
_CLOCK = "tests/link/test_clock.py"

LINK = [
    *in_file(
        "haptics/link/session.py",
        _SESSION,
        (
            "stop leaves bytes of earlier commands to be written after it",
            "a pulse goes out behind the stop",
            "        self._out.clear()\n        pending = self._stopping",
            "        pending = self._stopping",
        ),
        (
            "stop waits in the queue like any command",
            "eight open commands delay what must be at once",
            'self._window.submit_alone(pending, self.settings.stop_tries, "stopped")',
            "pending\n        self._window.submit(pending)",
        ),
        (
            "stop leaves the host believing in an armed board",
            "what comes later is scheduled for a board that is off",
            '        self.armed = False\n        pending = Pending("stop")',
            '        pending = Pending("stop")',
        ),
        (
            "disarm leaves the host believing in an armed board",
            "what comes later is scheduled for a board that is off",
            '        if name == "disarm":\n            self.armed = False\n',
            "",
        ),
        (
            "a disarm leaves what was asked for before it",
            "an arm that was lost is sent again behind the disarm",
            '            self._window.fail_all(LinkError, "disarmed")',
            "            pass",
        ),
        (
            "a stop without an answer is given up in silence",
            "keepalives hold a board up that was told to stop",
            "if pending is not None and isinstance(pending.error, ReplyTimeout) and self.identity is not None:",
            "if False:",
        ),
        (
            "schedules by a clock that it does not know",
            "a touch lands seconds away from where it was meant",
            "        if uncertain is not None:\n            raise",
            "        if uncertain is not None and self.clock is None:\n            raise",
        ),
        (
            "sends no keepalives",
            "the board's dead-man fires in every pause",
            "            self.counters.keepalives += 1\n            self._emit(_KEEPALIVE)",
            "            self.counters.keepalives += 1",
        ),
    ),
    *in_file(
        "haptics/link/receiving.py",
        _SESSION,
        (
            "a reboot fails nothing that is open",
            "commands of before play on the new boot",
            'self._window.fail_all(LinkLost, f"the board rebooted',
            'str(f"the board rebooted',
        ),
        (
            "a reboot leaves the host believing in an armed board",
            "the host schedules for a board that is off",
            "            self.armed = False\n            self._tell(happened.Rebooted",
            "            self._tell(happened.Rebooted",
        ),
        (
            "an interlock is no news",
            "the host schedules for a board that made itself safe",
            "elif pending.status == Status.INTERLOCK and self.armed:",
            "elif False:",
        ),
        (
            "telemetry that says disarmed is no news",
            "the host schedules for a board that made itself safe",
            "news = self.armed and message.state in _DOWN",
            "news = False and message.state in _DOWN",
        ),
        (
            "a reported fault is no news",
            "the host schedules for a board that made itself safe",
            'if self.armed and handshake.after(message.time, self._armed_ticks):\n            self._disarmed(f"fault',
            'if False:\n            self._disarmed(f"fault',
        ),
        (
            "limits that the board refuses are let pass",
            "a glove runs with limits that nobody holds",
            "            self._fail(pending.error or refused, now_ns)",
            "            self._become_ready(now_ns)",
        ),
        (
            "does not hold a board to the limits it was given",
            "a board that ignores its limits is used like any",
            "different = handshake.different_limits(self.identity, self._configured_limits)",
            "different = None",
        ),
    ),
    *in_file(
        "haptics/link/state.py",
        _SESSION,
        (
            "a lost port leaves the host believing in an armed board",
            "the script is told that all is well",
            "        self.phase, self.error = phase, error\n        self.armed = False",
            "        self.phase, self.error = phase, error",
        ),
    ),
    *in_file(
        "haptics/link/commands.py",
        _SESSION,
        (
            "a repetition gets a number of its own",
            "one lost reply, and the pulse is felt twice",
            "                emit(command.frame)",
            "                emit(encode_frame(command.frame[1], number % _NUMBERS + 1, command.pending.payload))",
        ),
        (
            "repeats what the board was made to forget",
            "a pulse of before the inquiry plays again",
            "            command.tries_allowed = command.tries",
            "            command.tries_allowed += 0",
        ),
        (
            "goes beyond what the board remembers",
            "a repetition is taken for a new command",
            "return self.alone is None and self._next_index - oldest.index < self._size",
            "return self.alone is None and len(self._open) < self._size",
        ),
        (
            "other commands go out beside a stop",
            "a pulse reaches the board right behind the stop",
            "return self.alone is None and self._next_index - oldest.index < self._size",
            "return self._next_index - oldest.index < self._size",
        ),
        (
            "what was open before a stop is repeated after it",
            "a lost pulse plays after the stop",
            "        self.fail_all(LinkError, reason)\n        self._waiting.append((pending, tries, NEVER_NS))",
            "        self._waiting.appendleft((pending, tries, NEVER_NS))",
        ),
        (
            "what waited behind a stop is sent after a second one",
            "a pulse of before the second stop plays after it",
            "            self._waiting.clear()\n            self._fail(later, LinkError, reason)",
            "            later.clear()",
        ),
        (
            "sends what has waited until it is late",
            "a queue that has once grown long makes all that follows late",
            "            if latest_ns < now_ns:",
            "            if latest_ns < 0:",
            "tests/link/test_coarse_lines.py",
        ),
        (
            "calls a command that was given up carried out",
            "nobody is told that nobody knows",
            "command.pending.fail(ReplyTimeout(self._port, seen, command.pending.name, advice))",
            "command.pending.answer(Status.OK, 0, None)",
        ),
    ),
    *in_file(
        "haptics/link/clock.py",
        _CLOCK,
        (
            "a clock's bound does not grow with age",
            "touches drift away while the host is sure of them",
            "return self.error_s + self.drift * self.age_s(host_ns)",
            "return self.error_s",
        ),
        (
            "a clock's bound leaves out half of the round trip",
            "touches are off by more than is said",
            "half = (arrived_ns - sent_ns - turn_ns) / 2 + self._tolerance",
            "half = (arrived_ns - sent_ns - turn_ns) / 4 + self._tolerance",
        ),
        (
            "believes an answer that was sent before the question came",
            "a clock from nonsense",
            "if turn_ns < 0 or half < 0:",
            "if False:",
        ),
        (
            "a jump of the clock is averaged away",
            "after a reboot touches land at times of the old clock",
            "            self._exchanges.clear()\n            estimate = newest.offset",
            "            estimate = newest.offset",
        ),
        (
            "the board's ticks lose count where they wrap",
            "after 36 minutes nothing is on time",
            "return ((later - earlier + _HALF) % _WRAP) - _HALF",
            "return later - earlier",
        ),
    ),
    *in_file(
        "haptics/link/sync.py",
        _SESSION,
        (
            "schedules by a stale clock",
            "touches drift away while the host is sure of them",
            "if (age_s := fit.age_s(host_ns)) > settings.max_age_s:",
            "if (age_s := fit.age_s(host_ns)) > 1e6 * settings.max_age_s:",
        ),
        (
            "schedules by a clock known only roughly",
            "a touch is felt tens of milliseconds off",
            "if (bound_s := fit.error_bound_s(host_ns)) > allowed_s:",
            "if (bound_s := fit.error_bound_s(host_ns)) > 1e6 * allowed_s:",
        ),
    ),
    *in_file(
        "haptics/link/sync.py",
        _SESSION,
        (
            "schedules by a coarse clock as by an exact one",
            "half of all touches are too late for their board",
            "return host_ns + self._shift_ns",
            "return host_ns",
        ),
    ),
    *in_file(
        "haptics/link/limits.py",
        "tests/session/test_heat.py -k 'reach_the_boards or built_stricter'",
        (
            "asks a board for looser limits than it has",
            "a board that was built stricter cannot be used at all",
            "max(want, own) if name == _STRICTER_UPWARD else min(want, own) for",
            "want for",
        ),
    ),
    *in_file(
        "haptics/link/handshake.py",
        _SESSION,
        (
            "talks to firmware of another message table",
            "bytes mean something else over there",
            "if identity.schema_hash != _SCHEMA_HASH:",
            "if False:",
        ),
        (
            "takes the brake controller for the coil board",
            "high volts where a tick was meant",
            "if identity.board in _CHANNELS and expected is not None and identity.board != expected:",
            "if False:",
        ),
    ),
]
