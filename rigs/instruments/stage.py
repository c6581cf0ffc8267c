"""A motion stage that speaks GRBL 1.1, as hobby and bench stages do: jogs, status, cancel.

On the wire are millimetres and millimetres a minute; here metres and metres a second. GRBL counts the steps it gives its motor:
the position it reports is where the stage should be, and a stage that is jammed or uncoupled does not show.
"""

from __future__ import annotations

import re

from haptics.errors import InputError
from haptics.link.ports import BytePort, PortErrors, open_port, read_waiting
from haptics.time import NS_PER_MS, seconds_to_ns
from haptics.units import in_range
from rigs.instruments.heard import Heard

POSITION_GAIN_SD = 1e-3
"""Standard deviation of actual over commanded travel, as a share: pitch of the screw (assumed)."""
DELAY_S, DELAY_SD_S = 5e-3, 5e-3
"""From when a move is sent until the stage is under way: line, planner, speeding up to 1 mm/s (assumed)."""
FARTHEST_M = 0.1
FASTEST_M_S = 0.1
_ASK_NS = 100 * NS_PER_MS
"""GRBL is asked no more often than ten times a second."""
_JOG_CANCEL = b"\x85"
_LONGEST_LINE = 256
_STATUS = re.compile(r"<(\w+)[^|]*\|(?:.*\|)?MPos:(-?[\d.]+)")


class Stage:
    """One stage on one port; not a source of samples.

    :param url: a serial port or ``sim://stage``.
    :param baud: GRBL's is 115200.
    :raises InputError, LinkError: the port will not open.

    ``state`` is the last it reported (``Idle``, ``Jog``, ``Alarm`` ...; empty: nothing yet), ``position_m`` likewise,
    ``refusals`` what it would not do.
    """

    kind = "stage"

    def __init__(self, url: str, baud: int = 115_200):
        self.url = url
        self.port: BytePort = open_port(url, baud)
        self.state = ""
        self.position_m = 0.0
        self.refusals: list[str] = []
        self._heard = Heard()
        self._rest = b""
        self._unanswered = 0
        self._asked_ns = -_ASK_NS
        self._fresh = True
        """A status has come that was asked for after the last jog."""
        self._taking_s = 0.0

    def move(self, relative_m: float, speed_m_s: float) -> None:
        """Begin to go by ``relative_m`` at ``speed_m_s``, behind moves that are not done yet.

        :param relative_m: distance and direction, -0.1 to 0.1 m.
        :param speed_m_s: 10 um/s to 0.1 m/s.
        :raises InputError: more than 0.1 m in either direction, or a speed outside 10 um/s to 0.1 m/s.
        :raises LinkLost: the port went away.
        """
        in_range("relative_m", relative_m, -FARTHEST_M, FARTHEST_M, "m")
        in_range("speed_m_s", speed_m_s, 1e-5, FASTEST_M_S, "m/s")
        self._write(f"$J=G91 X{1e3 * relative_m:.4f} F{6e4 * speed_m_s:.3f}\n".encode())
        self._unanswered += 1
        self._fresh = False
        self._taking_s = (0.0 if self.idle else self._taking_s) + abs(relative_m) / speed_m_s

    def stop(self) -> None:
        """Stop at once, and forget moves that are not done.

        :raises LinkLost: the port went away.
        """
        self._write(_JOG_CANCEL)

    @property
    def idle(self) -> bool:
        """It stands, by its own report since the last move was commanded."""
        return self._fresh and self._unanswered == 0 and self.state != "Jog"

    def due_ns(self, now_ns: int) -> int:
        """When moves asked for until now must be done.

        :param now_ns: on the bench's clock, ns.
        :return: latest time at which a sound stage has finished, ns.
        """
        return now_ns + seconds_to_ns(1.2 * self._taking_s + 2.0)

    def poll(self, now_ns: int) -> None:
        """Take in what came, and ask how it is when it is time to.

        :param now_ns: on the bench's clock, ns.
        :raises LinkLost: the port went away.
        """
        with PortErrors(self.url, "read"):
            data = read_waiting(self.port)
        if data:
            self._heard.take(data)
            *lines, self._rest = (self._rest + data).split(b"\n")
            self._rest = self._rest[-_LONGEST_LINE:]
            for line in lines:
                self._take(line.decode("ascii", "replace").strip())
        if now_ns - self._asked_ns >= _ASK_NS:
            self._asked_ns = now_ns
            self._write(b"?")

    def seen(self) -> str:
        """What came instead of a status, in words.

        :return: one sentence for an error message.
        """
        return self._heard.in_words("GRBL's '<Idle|MPos:0.000,0.000,0.000|FS:0,0>'")

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    def _take(self, line: str) -> None:
        if line == "ok":
            self._unanswered = max(0, self._unanswered - 1)
        elif line.startswith(("error:", "ALARM:")):
            self._unanswered = max(0, self._unanswered - 1)
            self.refusals.append(line)
        elif (seen := _STATUS.match(line)) is not None:
            self.state, self.position_m = seen[1], 1e-3 * float(seen[2])
            self._fresh = self._unanswered == 0
        elif line.startswith("#"):
            raise InputError(f"port = {self.url!r} is a {(line[1:].split() or ['?'])[0]}; expected a stage")
        else:
            self._heard.strange(line)

    def _write(self, data: bytes) -> None:
        with PortErrors(self.url, "write"):
            self.port.write(data)
