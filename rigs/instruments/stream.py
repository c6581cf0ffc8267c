"""Reading an instrument that prints one line of text for each sample (``docs/reference/instruments.md``).

The instrument's own count gives the spacing of samples; the host's clock gives where they lie. A line arrives late by what the
wire and the reader's polling take, never early, so the earliest arrivals fix the count's origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptics.errors import InputError, LinkError
from haptics.link.ports import BytePort, PortErrors, open_port, read_waiting
from haptics.units import in_range
from rigs.instruments.heard import Heard

INDEX_MODULUS = 1 << 16
_LONGEST_LINE = 256
_RATE_SPAN = 200
"""Samples that must have come before the spacing is taken from their arrival and not from the header."""


class InstrumentSilent(LinkError):
    """An instrument that should print samples does not."""


@dataclass(frozen=True)
class Samples:
    """Samples of one instrument.

    :param start_ns: time of the first sample on the host's clock, ns.
    :param time_s: of each sample since the first (n,), s.
    :param values: one column for each quantity that the instrument measures (n, columns), in the units of its ``columns``.
    """

    start_ns: int
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]

    def column(self, index: int = 0) -> NDArray[np.float64]:
        """One quantity over the samples (n,).

        :param index: of the quantity, from 0.
        :return: its values (n,).
        """
        return self.values[:, index]

    def since(self, time_ns: int) -> NDArray[np.float64]:
        """Times of the samples (n,) in seconds after ``time_ns`` of the host's clock.

        :param time_ns: on the host's clock, ns.
        :return: s, negative for samples before.
        """
        return self.time_s + (self.start_ns - time_ns) / 1e9


class SampleStream:
    """One instrument on one port.

    :param url: a serial port or ``sim://`` URL.
    :param baud: of the line.
    :raises InputError, LinkError: the port will not open.

    ``header`` holds what the instrument reports of itself; ``faults`` words it printed in place of values, with the sample's
    number; ``bad_lines`` counts lines that were neither.
    """

    kind = "instrument"
    columns: tuple[tuple[str, str], ...] = ()
    """Name and unit of each value, as they are recorded and returned."""
    example = "25.5"
    """A value as it is printed, for people whose instrument prints something else."""

    def __init__(self, url: str, baud: int = 500_000):
        self.url = url
        self.port: BytePort = open_port(url, baud)
        self.header: dict[str, str] = {}
        self.faults: list[tuple[int, str]] = []
        self.bad_lines = 0
        self._heard = Heard()
        self._rest = b""
        self._index: list[int] = []
        self._values: list[tuple[float, ...]] = []
        self._batches: list[tuple[int, int]] = []  # number of a batch's last sample, and when it was read
        self._given = 0

    def convert(self, words: list[str]) -> tuple[float, ...]:
        """The values of one line, in the units of ``columns``.

        :param words: of the line, without its count.
        :return: one value for each column.
        :raises ValueError: not finite numbers.
        """
        values = tuple(map(float, words))
        if len(values) != len(self.columns) or not all(map(math.isfinite, values)):
            raise ValueError(f"{len(words)} values, or none")
        return values

    # Reading.

    def ask(self) -> None:
        """Ask the instrument what it is."""
        with PortErrors(self.url, "ask"):
            self.port.write(b"?\n")

    def poll(self, now_ns: int) -> int:
        """Take in what has come; returns how many samples.

        :param now_ns: on the host's clock, ns.
        :return: count of new samples.
        :raises LinkLost: the port went away.
        """
        with PortErrors(self.url, "read"):
            data = read_waiting(self.port)
        if not data:
            return 0
        self._heard.take(data)
        before = len(self._index)
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-_LONGEST_LINE:]
        for line in lines:
            self._take(line.decode("ascii", "replace").strip())
        if len(self._index) > before:
            self._batches.append((self._index[-1], now_ns))
        return len(self._index) - before

    def fresh(self) -> list[tuple[int, tuple[float, ...]]]:
        """Number and values of the samples since the last call.

        :return: count on the line and values of each, oldest first.
        """
        start, self._given = self._given, len(self._index)
        return list(zip(self._index[start:], self._values[start:], strict=True))

    def latest(self) -> tuple[float, ...] | None:
        """Values of the last sample.

        :return: values in the units of ``columns``; None before the first sample.
        """
        return self._values[-1] if self._values else None

    @property
    def count(self) -> int:
        """Samples so far."""
        return len(self._index)

    @property
    def lost(self) -> int:
        """Samples that the instrument counted and that did not come, before the last one that did."""
        if not self._index:
            return 0
        first, last = self._index[0], self._index[-1]
        return last - first + 1 - len(self._index) - sum(first < number < last for number, _ in self.faults)

    @property
    def rate_hz(self) -> float:
        """Samples a second: as they arrived, once enough have come, until then as the header states.

        :raises InputError: neither enough samples nor a header.
        """
        period_s = self._measured_period_s()
        return self._stated_rate_hz() if period_s is None else 1.0 / period_s

    def samples(self) -> Samples:
        """All samples so far.

        :return: times spread evenly by the instrument's own count.
        :raises InstrumentSilent: there are none.
        """
        if not self._index:
            raise InstrumentSilent(self.url, f"no sample came from the {self.kind}: {self.seen()}", "measure")
        number = np.array(self._index, dtype=np.int64)
        last, arrived_ns = (np.array(column, dtype=np.int64) for column in zip(*self._batches, strict=True))
        period_s = 1.0 / self.rate_hz
        after_s = (arrived_ns - arrived_ns[0]) / 1e9 - (last - number[0]) * period_s
        start_ns = int(arrived_ns[0]) + round(float(after_s.min()) * 1e9)
        return Samples(start_ns, (number - number[0]) * period_s, np.array(self._values, dtype=float))

    def seen(self) -> str:
        """What came instead of a sample or a header, in words.

        :return: one sentence for an error message.
        """
        if self._index and not self.header:
            return f"it prints samples, but does not answer '?' with '# {self.kind} rate_hz=...'"
        if self.header and not self._index:
            return f"it identifies itself, but prints no sample: {self._heard.in_words(self._expected, answered=True)}"
        return self._heard.in_words(self._expected)

    @property
    def _expected(self) -> str:
        values = " ".join(name.upper() for name, _ in self.columns)
        return f"'COUNT {values}', such as '7 {' '.join([self.example] * len(self.columns))}'"

    def number(self, key: str, low: float, high: float, unit: str = "") -> float:
        """A number of the header.

        :param key: in the header.
        :param low: minimum that makes sense, in ``unit``.
        :param high: maximum that makes sense, in ``unit``.
        :param unit: for the message.
        :return: the number, in ``unit``.
        :raises InputError: the header does not hold it, or holds a number out of range.
        """
        if key not in self.header:
            found = ", ".join(self.header) or "nothing"
            raise InputError(f"{self.url}: the {self.kind}'s header has no {key}; it has {found}")
        return in_range(f"{self.kind} {key}", self.header[key], low, high, unit)  # type: ignore[arg-type]

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    def _take(self, line: str) -> None:
        if line.startswith("#"):
            kind, *pairs = line[1:].split() or [""]
            if kind == self.kind:
                self.header = dict(pair.split("=", 1) for pair in pairs if "=" in pair)
            elif kind:
                raise InputError(f"port = {self.url!r} is a {kind} (it prints {line[:60]!r}); expected a {self.kind}")
            return
        count, *words = line.split()[:8] or [""]
        if not count.isdigit() or not words:
            self._heard.strange(line)
            self.bad_lines += 1 if line and (self._index or self.header) else 0  # the first may be the end of one
            return
        index = int(count)
        if self._index:
            index = self._index[-1] + ((index - self._index[-1]) % INDEX_MODULUS or INDEX_MODULUS)
        try:
            values = self.convert(words)
        except ValueError:
            if words[0].isalpha():
                self.faults.append((index, words[0]))
            else:
                self._heard.strange(line)
                self.bad_lines += 1
            return
        self._index.append(index)
        self._values.append(values)

    def _stated_rate_hz(self) -> float:
        return self.number("rate_hz", 1e-3, 1e6, "Hz")

    def _measured_period_s(self) -> float | None:
        """Slope of arrival over count, by least squares."""
        if len(self._batches) < 10 or self._batches[-1][0] - self._batches[0][0] < _RATE_SPAN:
            return None
        number, arrived_ns = (np.array(column, dtype=float) for column in zip(*self._batches, strict=True))
        number, arrived_s = number - number.mean(), (arrived_ns - arrived_ns.mean()) / 1e9
        return float(number @ arrived_s / (number @ number))
