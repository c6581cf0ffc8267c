"""What a simulated port offers beyond a serial port. Hardware lacks it; callers ask and do without.

``haptics.link`` only declares this protocol; the boards behind ``sim://`` live in another package.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class SimulatedPort(Protocol):
    """A port whose board lives in this process and in a clock that callers may move.

    Times are nanoseconds of the board's world. ``truth`` is what physics did, not what firmware believes.
    """

    def advance(self, to_ns: int) -> None:
        """Carry the whole world (every board in it) to ``to_ns``; refuses to go back.

        :param to_ns: time of the world (ns), not before where it is.
        """
        ...

    def next_event(self) -> int | None:
        """Time of the next thing that happens by itself (a byte arriving, a pulse ending).

        :return: time of the world (ns), or None if nothing is due.
        """
        ...

    def truth(self) -> dict[str, Any]:
        """The plant as it is now.

        :return: quantities by name; the names depend on the board, see ``firmware_models``.
        """
        ...

    def set_load(self, channel: int, **load: float) -> None:
        """Act on the plant from outside: a skin under a pin, a finger pulling a brake.

        :param channel: output, from 0.
        :param load: quantities by name, their units in the names; which there are depends on the board.
        """
        ...


@runtime_checkable
class SharedWorldPort(Protocol):
    """A simulated port that can let the others in its world act while its own board does nothing."""

    def pass_by(self, to_ns: int) -> int | None:
        """Carry the world through what others do, to ``to_ns`` at most, and not as far as the next thing that its own board does.

        :param to_ns: time of the world (ns).
        :return: when bytes waited at this port, which ends it (ns); None if none do.
        """
        ...


def simulated(port: object) -> SimulatedPort | None:
    """``port`` as a simulated one.

    :param port: any open port.
    :return: the same port, or None if it is real.
    """
    return port if isinstance(port, SimulatedPort) else None
