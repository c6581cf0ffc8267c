"""How often, and until when, the port of a board that went away is tried."""

from __future__ import annotations

import threading

from haptics.errors import LinkError
from haptics.session.reopening import BACKOFF_NS, Reopening
from haptics.time import NS_PER_MS


class Port:
    """Remembers that it was closed."""

    closed = False

    def close(self) -> None:
        self.closed = True


class LostLink:
    """A link whose board is gone until a port is handed in."""

    def __init__(self) -> None:
        self.error: LinkError | None = LinkError("port", "unplugged")

    def close(self) -> None:
        pass

    def reopen(self, port: Port, now_ns: int) -> None:
        self.error = None


def tries(reopening: Reopening, tried: list[int], clock: list[int], from_ms: int, for_ms: int) -> list[int]:
    """Moments of the attempts within a time, ms since its begin."""
    tried.clear()
    for ms in range(for_ms):
        clock[0] = ms
        reopening.step((from_ms + ms) * NS_PER_MS)
    return list(tried)


def test_pauses_grow_and_are_short_again_at_the_next_loss():
    link, tried, clock, there = LostLink(), [], [0], [False]

    def open_port() -> Port:
        tried.append(clock[0])
        if not there[0]:
            raise LinkError("port", "not there")
        return Port()

    reopening = Reopening(link, open_port, realtime=False)  # type: ignore[arg-type]
    assert tries(reopening, tried, clock, 0, 6000) == [250, 750, 1750, 3750, 5750]
    there[0] = True
    assert len(tries(reopening, tried, clock, 6000, 2500)) == 1
    link.error, there[0] = LinkError("port", "unplugged"), False
    assert tries(reopening, tried, clock, 8500, 1000) == [250, 750]


def test_a_port_that_was_found_as_the_glove_closed_is_closed():
    may_open, port = threading.Event(), Port()

    def open_port() -> Port:
        may_open.wait(10.0)
        return port

    reopening = Reopening(LostLink(), open_port, realtime=True)  # type: ignore[arg-type]
    reopening.step(0)
    reopening.step(BACKOFF_NS[0])
    may_open.set()
    reopening.close()
    assert port.closed
