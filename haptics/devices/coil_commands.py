"""Coil pulses as commands to a board, and the answers, by request (protocol: ``pulse`` in ``docs/reference/protocol.md``)."""

from __future__ import annotations

from collections.abc import Sequence

from haptics.devices.coil_ends import CoilEnds
from haptics.errors import ClockUncertain
from haptics.link.commands import Pending, status_name
from haptics.link.connection import Link
from haptics.link.messages import COIL_CHANNELS, DURATION_UNIT_US
from haptics.scheduling import CoilPulse
from haptics.time import seconds_to_ns


class CoilCommands:
    """Commands on their way. A request, known by its token, may need several; one command may serve several requests.

    :param link: with a tactiles board.

    :ivar busy_until_ns: when the last of all pulses handed to ``send`` so far ends, ns on the link's clock; refused ones count,
        too; 0 before the first.
    """

    def __init__(self, link: Link):
        self._link = link
        self._open: dict[int, int] = {}  # commands without an answer, by token
        self._refused: dict[int, str] = {}
        self._taken: dict[int, tuple[int, bool | None]] = {}  # last stroke that a board took, or may have
        self._replies: list[tuple[Pending, list[CoilPulse]]] = []
        self._ends = CoilEnds()
        self.busy_until_ns = 0

    @property
    def idle(self) -> bool:
        """Every command was answered."""
        return not self._replies

    def send(self, pulses: Sequence[CoilPulse], now_ns: int) -> None:
        """Pulses with a common start share a command; where the clock is not known well enough they are refused, ``clock``.

        :param pulses: in any order, each with its request's token.
        :param now_ns: ns on the link's clock.
        """
        together: dict[int, list[CoilPulse]] = {}
        for pulse in pulses:
            together.setdefault(pulse.start_ns, []).append(pulse)
        for start_ns, group in sorted(together.items()):
            channels = toward = 0
            durations = [0] * COIL_CHANNELS
            for pulse in group:
                bit = 1 << pulse.channel
                channels |= bit
                toward |= bit if pulse.toward_skin else 0
                durations[pulse.channel] = round(pulse.duration_s * 1e6 / DURATION_UNIT_US)
                self.busy_until_ns = max(self.busy_until_ns, start_ns + seconds_to_ns(pulse.duration_s))
            try:
                ticks = self._ends.start(self._link.to_ticks(start_ns), {p.channel: durations[p.channel] for p in group})
            except ClockUncertain:
                for pulse in group:
                    self._refused[_token(pulse)] = "clock"
                continue
            pending = self._link.send("pulse", ticks, channels, toward, durations, now_ns=now_ns)
            for pulse in group:
                self._open[_token(pulse)] = self._open.get(_token(pulse), 0) + 1
            self._replies.append((pending, group))

    def read(self) -> list[int]:
        """Take in what was answered.

        :return: tokens of requests whose commands are all answered now.
        """
        done, waiting = [], []
        for pending, group in self._replies:
            if not pending.done:
                waiting.append((pending, group))
                continue
            for pulse in group:
                done += self._answered(pulse, _refusal(pending, pulse.channel))
        self._replies = waiting
        return done

    def give_up(self) -> list[int]:
        """Wait for no answer any more: what became of those commands is ``unknown``.

        :return: their requests' tokens.
        """
        replies, self._replies = self._replies, []
        return [token for _, group in replies for pulse in group for token in self._answered(pulse, "unknown")]

    def waits_for(self, token: int) -> bool:
        """Whether a request is still open.

        :param token: the request's.
        :return: True if some command of it has no answer yet.
        """
        return token in self._open

    def take_refusal(self, token: int) -> str | None:
        """Why the board did not carry out all of a request. Forgotten with that.

        :param token: the request's.
        :return: the reason, or None if it did.
        """
        return self._refused.pop(token, None)

    def take_last(self, token: int) -> tuple[int, bool | None] | None:
        """The last stroke that a board took of a request. Forgotten with that.

        :param token: the request's.
        :return: when it ends (ns), and whether it goes toward the skin, None where nobody knows that it plays; None altogether if
            the board took no stroke.
        """
        return self._taken.pop(token, None)

    def _answered(self, pulse: CoilPulse, refused: str | None) -> list[int]:
        token = _token(pulse)
        if refused is not None:
            self._refused.setdefault(token, refused)
        if refused in (None, "unknown"):
            ends_ns = pulse.start_ns + seconds_to_ns(pulse.duration_s)
            if ends_ns > self._taken.get(token, (ends_ns - 1, None))[0]:
                self._taken[token] = (ends_ns, pulse.toward_skin if refused is None else None)
        self._open[token] -= 1
        if self._open[token]:
            return []
        del self._open[token]
        return [token]


def _token(pulse: CoilPulse) -> int:
    assert isinstance(pulse.token, int)  # the driver's own
    return pulse.token


def _refusal(pending: Pending, channel: int) -> str | None:
    """Why a command that is done did not move this channel's coil; None if it did."""
    if pending.error is not None:
        return "unknown"
    if pending.ok:
        return None
    reason = status_name(pending.status)
    another_is_hot = reason == "hot" and pending.detail is not None and not pending.detail >> channel & 1
    return "company" if another_is_hot else reason  # of a command that was refused whole for another coil's sake
