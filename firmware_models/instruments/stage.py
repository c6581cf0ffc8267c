"""A motion stage that moves the hand of one brake, and speaks a little GRBL 1.1: ``sim://stage?world=NAME``.

::

    $J=G91 X10 F60      jog 10 mm on at 60 mm/min; answered ok when taken, error:n when not; jogs wait for the one before
    ?                   <Idle|MPos:10.000,0.000,0.000|FS:0,0>, or <Jog|...>, at once
    0x85 or !           jogs are over: it brakes, and forgets those that wait

It counts the steps it gives the motor: what it reports is where the carriage should be. The carriage goes by the screw's pitch, a
little off; it speeds up and brakes at ``accel_m_s2``. Faults to play: ``slip_n``, the tension at which its clamp slips along the
strip; ``stuck=1``, the motor turns and the carriage does not; ``locked=1``, it is in alarm and takes no jog.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_models.line.uart import NEVER_NS, Line
from firmware_models.options import Option
from firmware_models.world import World
from haptics.errors import InputError
from haptics.time import NS_PER_MS

PITCH_SD = 1e-3  # assumed: a rolled screw
BUFFER = 15  # moves that wait, as in GRBL's planner
_STEP_NS = NS_PER_MS
_STEP_S = _STEP_NS / 1e9
_FASTEST_M_S = 0.5
_FARTHEST_M = 1.0
_BAD_NUMBER, _BAD_STATEMENT, _LOCKED, _NO_FEED = 2, 3, 9, 22  # GRBL's numbers of errors
_CANCEL = (0x85, ord("!"))
_LINE = re.compile(r"\$J=(?:G91|G21|G91G21|G21G91)X(-?[\d.]+)F([\d.]+)")


class Stage:
    """One axis. Not an instrument that samples; a member of the world as they are.

    :param options: values of ``options()`` and of every instrument.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the brake board is.
    """

    kind = "stage"
    board = "brake"

    @classmethod
    def options(cls) -> dict[str, Option]:
        """URL keys beside those of every instrument.

        :return: default, unit and range by key.
        """
        return {
            "baud": Option(115_200, "what GRBL's UART is set to", "baud", 300, 4_000_000, whole=True),
            "accel_m_s2": Option(0.5, "speeding up and braking", "m/s2", 1e-3, 100.0),
            "pitch": Option(None, f"travel made over travel asked for; default drawn, sd {PITCH_SD:g}", "", 0.5, 2.0),
            "slip_n": Option(None, "tension at which the clamp slips; default: it holds", "N", 0.0, 1e5),
            "stuck": Option(0, "1: the motor turns, the carriage stands", "", 0, 1, whole=True),
            "locked": Option(0, "1: in alarm, takes no jog", "", 0, 1, whole=True),
        }

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        rng = np.random.default_rng(np.random.SeedSequence([options["seed"], int.from_bytes(b"stage", "little")]))
        drawn = 1.0 + PITCH_SD * float(rng.standard_normal())
        self.pitch: float = drawn if options["pitch"] is None else options["pitch"]
        self.settings = options
        self.channel: int = options["channel"]
        self.now_ns = self.start_ns = start_ns
        self._line, self._world = transmitter, world
        self._typed = bytearray()
        self._waiting: deque[tuple[float, float]] = deque()
        self._at_m = self._speed_m_s = 0.0
        self._hand_m = self._hand_m_s = 0.0
        self._goal_m: float | None = None
        """Where the present move ends; None: it stands."""
        self._fastest_m_s = 0.0
        self._cancelled = False
        self._step_ns = NEVER_NS
        self.send("\r\nGrbl 1.1h ['$' for help]")

    # What a cable asks of the device at its end.

    def next_event(self) -> int:
        """Time of the next step of the ramp, or of the end of a steady stretch.

        :return: world time, ns; ``NEVER_NS`` while it stands.
        """
        return self._step_ns

    def advance(self, to_ns: int) -> None:
        """Move on up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        """
        while (at_ns := self._step_ns) <= to_ns:
            self._go(at_ns)
            self._plan()
            self._push()
        self._go(to_ns)

    def handle(self, data: bytes) -> None:
        """Take what the host sent; single bytes that GRBL acts on at once are picked out of any line.

        :param data: any bytes; a line feed ends a line.
        """
        for byte in data:
            if byte == ord("?"):
                self._report()
            elif byte in _CANCEL:
                self._cancel()
            elif byte == ord("\n"):
                line, self._typed = self._typed.decode("ascii", "replace"), bytearray()
                self._hear(line.strip())
            elif byte != ord("\r"):
                self._typed.append(byte)

    def send(self, line: str) -> None:
        """Send a line of text now.

        :param line: ASCII, without its end.
        """
        self._line.send(f"{line}\r\n".encode(), self.now_ns)

    def truth(self) -> dict[str, Any]:
        """Where the carriage should be, where the hand is, and what the stage was drawn with.

        :return: ``time_ns, at_m`` (by the steps counted), ``hand_m, hand_m_s`` and ``pitch`` (travel made over travel asked for).
        """
        return {
            "time_ns": self.now_ns,
            "at_m": self._at_m,
            "hand_m": self._hand_m,
            "hand_m_s": self._hand_m_s,
            "pitch": self.pitch,
        }

    def set_load(self, channel: int, **load: float) -> None:
        """A stage takes no load.

        :param channel: ignored.
        :param load: ignored but for the message.
        :raises InputError: always.
        """
        raise InputError(f"load {', '.join(load)} does not act on a stage; set it on the board whose brake it pulls")

    def energised(self) -> list[int]:
        """Nothing: a stage energises no output.

        :return: an empty list.
        """
        return []

    # Words.

    def _hear(self, line: str) -> None:
        if not line:
            self.send("ok")
            return
        jog = _LINE.fullmatch(line.replace(" ", "").upper())
        if self.settings["locked"]:
            self.send(f"error:{_LOCKED}")
        elif jog is None:
            self.send(f"error:{_NO_FEED if line.startswith('$J=') and 'F' not in line else _BAD_STATEMENT}")
        else:
            self._take_jog(jog[1], jog[2])

    def _take_jog(self, travel_mm: str, feed_mm_min: str) -> None:
        try:
            travel_m, speed_m_s = 1e-3 * float(travel_mm), float(feed_mm_min) / 6e4
        except ValueError:
            self.send(f"error:{_BAD_NUMBER}")
            return
        if not speed_m_s > 0.0 or abs(travel_m) > _FARTHEST_M or len(self._waiting) >= BUFFER:
            self.send(f"error:{_NO_FEED if speed_m_s <= 0.0 else _BAD_NUMBER}")
            return
        self._waiting.append((travel_m, min(speed_m_s, _FASTEST_M_S)))
        self.send("ok")
        if self._goal_m is None:
            self._plan()
            self._push()

    def _report(self) -> None:
        state = "Alarm" if self.settings["locked"] else "Idle" if self._goal_m is None else "Jog"
        at_mm, feed = 1e3 * self._at_m, 6e4 * abs(self._speed_m_s)
        self.send(f"<{state}|MPos:{at_mm:.3f},0.000,0.000|FS:{feed:.0f},0>")

    def _cancel(self) -> None:
        self._waiting.clear()
        if self._goal_m is not None:
            self._cancelled = True
            self._plan()
            self._push()

    # Motion.

    def _go(self, to_ns: int) -> None:
        """Steadily on to ``to_ns``."""
        gone_s = (to_ns - self.now_ns) / 1e9
        self._at_m += self._speed_m_s * gone_s
        self._hand_m += self._hand_m_s * gone_s
        self.now_ns = to_ns

    def _plan(self) -> None:
        """Speed from now on, and when to plan again."""
        if self._goal_m is None or self._arrived():
            self._begin()
        if self._goal_m is None:
            self._speed_m_s, self._step_ns = 0.0, NEVER_NS
            return
        accel = self.settings["accel_m_s2"]
        left_m = self._goal_m - self._at_m
        direction = 1.0 if left_m > 0.0 else -1.0
        now_m_s, left_m = abs(self._speed_m_s), abs(left_m)
        change_m_s = accel * _STEP_S
        # From this speed, steps of equal change end where the travel does: v^2 / 2 a + v dt / 2 = left.
        braking_m_s = (0.25 * change_m_s**2 + 2.0 * accel * left_m) ** 0.5 - 0.5 * change_m_s
        allowed_m_s = 0.0 if self._cancelled else min(self._fastest_m_s, max(change_m_s, braking_m_s))
        next_m_s = max(now_m_s - change_m_s, min(now_m_s + change_m_s, allowed_m_s))
        self._speed_m_s = direction * next_m_s
        steady = next_m_s == self._fastest_m_s and self.settings["slip_n"] is None
        # At full speed there is nothing to plan until it is time to brake.
        until_s = left_m / next_m_s - 0.5 * (next_m_s / accel + _STEP_S) if steady else _STEP_S
        if not self._cancelled and next_m_s > 0.0:
            until_s = min(max(until_s, _STEP_S), left_m / next_m_s)
        self._step_ns = self.now_ns + max(1, round(until_s * 1e9))

    def _arrived(self) -> bool:
        if self._cancelled:
            return self._speed_m_s == 0.0
        assert self._goal_m is not None
        return abs(self._goal_m - self._at_m) < 1e-9

    def _begin(self) -> None:
        """The next move that waits, if any."""
        if self._goal_m is not None and not self._cancelled:
            self._at_m = self._goal_m
        self._cancelled, self._speed_m_s = False, 0.0
        if self._waiting:
            travel_m, self._fastest_m_s = self._waiting.popleft()
            self._goal_m = self._at_m + travel_m
        else:
            self._goal_m = None

    def _push(self) -> None:
        """Tell the plant where the hand is and how fast it goes from now on."""
        cable = self._world.members.get(self.board)
        self._hand_m_s = 0.0 if self.settings["stuck"] else self.pitch * self._speed_m_s
        if cable is None:
            return
        cable.advance(self.now_ns)
        board, slip_n = cable.board, self.settings["slip_n"]  # type: ignore[attr-defined]  # a board's cable
        if slip_n is not None and self._hand_m_s > 0.0 and board.plant.tension(self.channel, self.now_ns) >= slip_n:
            self._hand_m_s = 0.0
        board.set_load(self.channel, hand_m=self._hand_m, hand_m_s=self._hand_m_s)
