"""Breaks of the loop: a hand that is gone, lost or impossible must let go of everything."""

from __future__ import annotations

from mutant import in_file

_LOOP = "tests/rendering/test_loop.py tests/rendering/test_letting_go.py"

RENDERING = [
    *in_file(
        "haptics/rendering/loop.py",
        _LOOP,
        (
            "goes on without poses",
            "a hand that nobody sees is held for ever",
            "not self._quiet and now_ns - self._heard_ns > LOST_NS:",
            "not self._quiet and now_ns - self._heard_ns > 100 * LOST_NS:",
        ),
        (
            "comes back at once when poses come again",
            "a hand is grabbed that still reaches into something",
            "        if touched and not gently:",
            "        if touched is None:",
        ),
        (
            "a hand that is gone keeps its brakes",
            "a finger stays held by a ball that is gone",
            "        if self.brake is not None:\n            self.brake.release_all(now_ns)\n\n    def _forget",
            "\n    def _forget",
        ),
        (
            "a hand that is gone keeps its pins",
            "pins rest on a skin that touches nothing",
            "        self._apply([], self._forget(now_ns), now_ns)\n        if self.tactiles is not None:\n"
            "            self.tactiles.release_all(now_ns)\n",
            "        self._forget(now_ns)\n",
        ),
        (
            "takes any pose",
            "one wild pose, and the glove grabs",
            "        if reason is not None:\n            side =",
            "        if reason == '':\n            side =",
        ),
        (
            "a gone hand's decisions are carried out",
            "a touch comes after the hand has left",
            "        self._touch_ahead.forget()\n",
            "",
        ),
        (
            "goes on after an arming as if nothing had been",
            "volts that an off took away come back without a touch",
            "        self._forget(now_ns)\n        self._heard_ns, self._absent = None, True",
            "        self._heard_ns, self._absent = None, True",
        ),
    ),
    *in_file(
        "haptics/rendering/grasping.py",
        _LOOP,
        (
            "a grasp closes with any volts",
            "a scene's file decides over the wearer's limit",
            "volts = share * min(effect.amplitude_v, self._amplitude_v)\n",
            "volts = share * effect.amplitude_v\n",
        ),
    ),
    *in_file(
        "haptics/rendering/pace_watch.py",
        _LOOP,
        (
            "says nothing of ticks that come too seldom",
            "touches are missing, and nobody knows why",
            "        if was or not self._overrunning:",
            "        if self._overrunning:",
        ),
    ),
    *in_file(
        "haptics/rendering/clutching.py",
        _LOOP,
        (
            "a clutch closes with any volts",
            "a scene's file decides over the wearer's limit",
            "{clutch.name: min(clutch.amplitude_v, amplitude_v) for clutch in scene.clutches}",
            "{clutch.name: clutch.amplitude_v for clutch in scene.clutches}",
        ),
        (
            "a lost hand keeps its clutches",
            "a garment stays stiff around a body that nobody sees",
            "wanted = self._rules.update(state) if hand else frozenset()",
            "wanted = self._rules.update(state)",
        ),
    ),
]
