"""Breaks of the scheduler: who may start when, under which current, with how much heat."""

from __future__ import annotations

from mutant import in_file

_SCHEDULER = "tests/scheduling/test_scheduler.py"
_BUDGET = "tests/scheduling/test_thermal_budget.py"

SCHEDULING = [
    *in_file(
        "haptics/scheduling/scheduler.py",
        _SCHEDULER,
        (
            "takes requests while unarmed",
            "what was asked before arming plays at arming",
            '        if not self.armed:\n            outcomes.append(entry.denied("unarmed"))',
            '        if self.armed is None:\n            outcomes.append(entry.denied("unarmed"))',
        ),
        (
            "disarming leaves what waits",
            "what was asked before an off plays after the next arm",
            'return [] if armed else self.stop("unarmed")',
            "return []",
        ),
        (
            "stopping leaves what waits",
            "what was asked before an off plays after the next arm",
            "        self._releases.clear()\n        self._waiting.clear()",
            "        self._releases.clear()",
        ),
        (
            "stopping leaves releases that wait",
            "a pin moves after the stop",
            "        self._releases.clear()\n        self._waiting.clear()",
            "        self._waiting.clear()",
        ),
        (
            "stopping leaves bursts under way",
            "a burst goes on after the stop",
            "        self._bursting.clear()\n        self._releases.clear()",
            "        self._releases.clear()",
        ),
        (
            "a newer request takes the place of a release",
            "a pin is stranded out, for ever",
            "        if older.request.priority is Priority.RELEASE and channel not in self._releases:",
            "        if older.request.priority is None:",
        ),
        (
            "what is left of the current goes to whoever needs less",
            "a strong coil's touch waits for ever behind weak ones",
            "            enough = not kept and self._supply",
            "            enough = self._supply",
        ),
        (
            "keeps no room for the release",
            "a pin that came out for its last heat stays out",
            "return None if budget.allows(energy_j, at_ns, self._reserve_j[channel]) else",
            "return None if budget.allows(energy_j, at_ns) else",
        ),
        (
            "asks no account of heat",
            "a coil passes its limit",
            "return None if budget.allows(energy_j, at_ns, self._reserve_j[channel]) else",
            "return None if energy_j > 0 else",
        ),
        (
            "any number of releases is paid for",
            "releases without contacts heat a coil without end",
            "if self._release_paid[channel] or budget.allows(energy_j, at_ns):",
            "if self.armed or budget.allows(energy_j, at_ns):",
        ),
        (
            "books no heat",
            "the account says 0 K while the coil burns",
            "self.budgets[channel].spend(self._unit_energy_j(entry), end_ns)",
            "self.budgets[channel].spend(0.0, end_ns)",
        ),
        (
            "counts no shares of the current",
            "fifteen coils at once",
            "        self._supply.take(self._current_na[channel], at_ns, self._channel_free_ns[channel])\n",
            "",
        ),
        (
            "lets strokes of one coil overlap",
            "a pin is driven both ways at once",
            "        self._channel_free_ns[channel] = end_ns + self._gap_ns\n        self._supply.take("
            "self._current_na[channel], at_ns, self._channel_free_ns[channel])",
            "        self._supply.take(self._current_na[channel], at_ns, end_ns + self._gap_ns)",
        ),
        (
            "plays what is past its latest start",
            "a touch is felt long after it was meant",
            "for channel in [channel for channel, entry in queue.items() if entry.latest_ns < at_ns]:",
            "for channel in [channel for channel, entry in queue.items() if entry.latest_ns < 0]:",
        ),
        (
            "starts before the earliest start",
            "a touch is felt before the hand is there",
            "ready = [w for w in self._all_waiting() if w.due_ns <= at_ns and self._channel_free_ns",
            "ready = [w for w in self._all_waiting() if self._channel_free_ns",
        ),
        (
            "goes by the order of arrival alone",
            "pins are withdrawn last",
            "        ready.sort(key=_urgency)\n",
            "",
        ),
    ),
    *in_file(
        "haptics/scheduling/limits.py",
        _SCHEDULER,
        (
            "one coil more than the supply can feed",
            "the supply sags under every third touch",
            "return math.floor(",
            "return 1 + math.floor(",
        ),
        (
            "goes by the weakest coil's current",
            "three strong coils draw more than is allowed",
            "self.current_limit_a / max(_each(self.coil_current_a))",
            "self.current_limit_a / min(_each(self.coil_current_a))",
        ),
    ),
    *in_file(
        "haptics/scheduling/requests.py",
        _SCHEDULER,
        (
            "takes strokes of any length",
            "a coil burns through its wire",
            'in_range("duration_s", self.duration_s, 50e-6, LONGEST_STROKE_S, "s")',
            'in_range("duration_s", self.duration_s, 50e-6, 1.0, "s")',
        ),
        (
            "takes a release of several strokes",
            "a pin's way back costs more than was kept for it",
            "if self.priority is Priority.RELEASE and len(self.strokes) > 1:",
            "if False:",
        ),
    ),
    *in_file(
        "haptics/scheduling/thermal_budget.py",
        _BUDGET,
        (
            "energy warms half as much as it does",
            "25 K are 50",
            "self._rise_k = self.rise_k(at_ns) + jump_k",
            "self._rise_k = self.rise_k(at_ns) + jump_k / 2",
        ),
        (
            "a clock that steps back cools",
            "a coil is cold because somebody set the time",
            "self.latest_ns = max(self.latest_ns, now_ns)",
            "self.latest_ns = now_ns",
        ),
        (
            "leaves the reserve out of its answer",
            "a pin that came out for its last heat stays out",
            "jump_k = pulse_rise_k(energy_j + reserve_j, self.parameters)",
            "jump_k = pulse_rise_k(energy_j, self.parameters)",
        ),
        (
            "allows a tenth more than its limit",
            "25 K are 27.5",
            "return self._look_ahead(now_ns) + jump_k <= self.limit_k * (1 + GUARD)",
            "return self._look_ahead(now_ns) + jump_k <= self.limit_k * 1.1",
        ),
        (
            "cools twice as fast as a coil",
            "25 K are 40 after a minute of touches",
            "relax(self._rise_k, 0.0, elapsed_ns / NS_PER_S, self.parameters)",
            "relax(self._rise_k, 0.0, 2 * elapsed_ns / NS_PER_S, self.parameters)",
        ),
        (
            "begins cold, whatever it is given",
            "heat of the session before is forgotten",
            'self._rise_k = in_range("rise_k", rise_k, 0.0, math.inf, "K")',
            'self._rise_k = 0.0 * in_range("rise_k", rise_k, 0.0, math.inf, "K")',
        ),
    ),
]
