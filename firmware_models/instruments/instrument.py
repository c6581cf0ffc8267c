"""Bench instruments behind ``sim://``: one sample at a steady rate, one line of text each, of a board's plant in the same world.

What goes out, line by line (``docs/reference/instruments.md``)::

    # thermocouple rate_hz=10 resolution_k=0.0625
    0 25.0625
    1 25.0000

A line that begins with ``#`` states what the instrument is; it comes at power-on, and whenever the host sends ``?`` and a line
feed. All others are samples: a count from power-on, modulo 65536, and values; a word in place of a value is a fault that the
instrument itself noticed. An instrument knows the plant only through what it would touch; its noise, lag, drift, range and
steps are its own, drawn from its seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_models.line.uart import Line
from firmware_models.options import Option
from firmware_models.world import World
from haptics.errors import InputError

INDEX_MODULUS = 1 << 16
INSTRUMENT_OPTIONS: dict[str, Option] = {
    "seed": Option(1, "noise, offsets and clock are drawn from it", low=0, high=2**32 - 1, whole=True),
    "baud": Option(500_000, "what the instrument's UART is set to", "baud", 300, 4_000_000, whole=True),
    "channel": Option(0, "channel of the board that it is attached to", "", 0, 255, whole=True),
}


class Instrument:
    """Base of the simulated instruments.

    :param options: values of ``INSTRUMENT_OPTIONS`` and the subclass's own, ``rate_hz`` among them.
    :param transmitter: line to the host.
    :param start_ns: world time of power-on, ns.
    :param world: where the board is that it measures.
    """

    kind: str
    board: str
    """The board whose plant it touches."""
    clock_sd = 50e-6
    """Standard deviation of its sampling clock, as a share."""

    @classmethod
    def options(cls) -> dict[str, Option]:
        """URL keys beside ``INSTRUMENT_OPTIONS``.

        :return: default, unit and range by key.
        """
        raise NotImplementedError

    def __init__(self, options: Mapping[str, Any], transmitter: Line, start_ns: int, world: World):
        kind_seed = int.from_bytes(self.kind.encode()[:8], "little")
        self.rng = np.random.default_rng(np.random.SeedSequence([options["seed"], kind_seed]))
        self.settings = options
        self.channel: int = options["channel"]
        self.now_ns = self.start_ns = start_ns
        self._period_ns = 1e9 / (options["rate_hz"] * (1.0 + self.clock_sd * float(self.rng.standard_normal())))
        self._count = 0
        self._due_ns = self._when()
        self._line, self._world = transmitter, world
        self._typed = bytearray()
        self._introduce()

    # What a subclass provides.

    def header(self) -> dict[str, float | str]:
        """What the instrument states about itself in its first line.

        :return: numbers and words by key; keys end in their units.
        """
        raise NotImplementedError

    def sample(self) -> str:
        """One sample, taken at ``now_ns``.

        :return: its values as they are printed, apart by blanks; a word in place of a value is a fault that the instrument
            noticed.
        """
        raise NotImplementedError

    # What it touches.

    def plant(self) -> Any:
        """The board's plant, carried to now.

        :return: ``Actuators`` or ``Brakes``; None where there is no such board in this world.
        """
        cable = self._world.members.get(self.board)
        if cable is None:
            return None
        cable.advance(self.now_ns)
        return cable.board.plant  # type: ignore[attr-defined]  # a board's cable

    # What a cable asks of the device at its end.

    def next_event(self) -> int:
        """Time of the next sample.

        :return: world time, ns; ``NEVER_NS`` if none will come.
        """
        return self._due_ns

    def _when(self) -> int:
        """Time of the sample after ``_count`` of them; ``NEVER_NS`` if it will not come."""
        return self.start_ns + round(self._period_ns * (self._count + 1))

    def advance(self, to_ns: int) -> None:
        """Take the samples due up to and including ``to_ns``.

        :param to_ns: world time, ns; not before ``now_ns``.
        """
        while (at_ns := self._due_ns) <= to_ns:
            self.now_ns = at_ns
            self._line.send(f"{self._count % INDEX_MODULUS} {self.sample()}\n".encode(), at_ns)
            self._count += 1
            self._due_ns = self._when()
        self.now_ns = to_ns

    def handle(self, data: bytes) -> None:
        """Take what the host sent.

        :param data: any bytes; a line feed ends a line.
        """
        self._typed += data
        while (end := self._typed.find(b"\n")) >= 0:
            line, self._typed = bytes(self._typed[:end]).strip(), self._typed[end + 1 :]
            self.hear(line.decode("ascii", "replace"))

    def hear(self, line: str) -> None:
        """Deal with one line from the host; anything but ``?`` is ignored.

        :param line: without its line feed.
        """
        if line == "?":
            self._introduce()

    def send(self, line: str) -> None:
        """Send a line of text now.

        :param line: ASCII, without a line feed.
        """
        self._line.send(f"{line}\n".encode(), self.now_ns)

    def truth(self) -> dict[str, Any]:
        """What the instrument was drawn with.

        :return: values by name; ``time_ns``, ``period_ns`` and the subclass's own.
        """
        return {"time_ns": self.now_ns, "period_ns": self._period_ns}

    def set_load(self, channel: int, **load: float) -> None:
        """An instrument takes no load.

        :param channel: ignored.
        :param load: ignored but for the message.
        :raises InputError: always.
        """
        raise InputError(f"load {', '.join(load)} does not act on a {self.kind}; set it on the board that it measures")

    def energised(self) -> list[int]:
        """Nothing: an instrument energises nothing.

        :return: an empty list.
        """
        return []

    def _introduce(self) -> None:
        pairs = " ".join(f"{key}={value}" for key, value in self.header().items())
        self.send(f"# {self.kind} {pairs}")
