"""Where the pins are, by what boards acknowledged; never by what was asked of them."""

from __future__ import annotations


class Pin:
    """One bistable pin.

    ``out`` is True or False by the last stroke that a board acknowledged, and None where nobody knows: none was sent yet, or one
    was not answered, or the board may have been made safe before it played. Both a contact and a release are worth a stroke then.
    """

    __slots__ = ("_ended_ns", "_pulsed_ns", "_under_way", "out", "wanted_out")

    def __init__(self) -> None:
        self.out: bool | None = None  # an earlier host may have left it out
        self.wanted_out = False
        self._ended_ns = self._pulsed_ns = -(1 << 62)
        self._under_way: dict[int, bool] = {}  # direction of each stroke without a result, by token, oldest first

    @property
    def heading(self) -> bool | None:
        """Where the pin will be if all that is under way plays."""
        return next(reversed(self._under_way.values())) if self._under_way else self.out

    @property
    def moving(self) -> bool:
        """A stroke is asked for, or on its way."""
        return bool(self._under_way)

    def ask(self, token: int, out: bool) -> None:
        """A stroke was asked for.

        :param token: of the request.
        :param out: toward the skin.
        """
        self._under_way[token] = out

    def settle(self, token: int, played: bool | None, ends_ns: int) -> None:
        """A stroke's result.

        :param token: of the request.
        :param played: None if nobody knows.
        :param ends_ns: when it ends, ns; orders strokes, whichever was answered first.
        """
        out = self._under_way.pop(token)
        if played is False or ends_ns < self._ended_ns:
            return
        if played or out is not self.out:
            self.out = out if played else None
            self._ended_ns = ends_ns

    def pulsed(self, back: bool, ends_ns: int) -> None:
        """A board took a pulse or a burst, or part of one.

        A pin that was out before is not brought in by that: its stroke back may be too short.

        :param back: it ends for sure with a stroke back, as it should.
        :param ends_ns: when it ends, ns.
        """
        self._pulsed_ns = max(self._pulsed_ns, ends_ns)
        if not back and ends_ns >= self._ended_ns:
            self.out = None

    def doubt(self, from_ns: int) -> None:
        """Late strokes may not have played.

        :param from_ns: those that end after this, ns.
        """
        if max(self._ended_ns, self._pulsed_ns) > from_ns:
            self.out = None
