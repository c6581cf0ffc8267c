"""Whoever sends poses, on a clock and over a line of its own."""

from __future__ import annotations

import numpy as np

from haptics.session.peer_clock import PeerClock
from haptics.time import NS_PER_MS, NS_PER_S


class Peer:
    """A peer whose clock is off by so much, runs so much too fast, and is so many ms of line away, each way at random."""

    def __init__(self, offset_s: float, ppm: float, seed: int = 1, line_ms: tuple[float, float] = (0.2, 4.0)):
        self.offset_ns, self.rate, self.line_ms = round(offset_s * NS_PER_S), 1.0 + ppm * 1e-6, line_ms
        self.rng, self.clock = np.random.default_rng(seed), PeerClock()

    def at(self, host_ns: int) -> int:
        """What the peer's clock shows."""
        return round(host_ns * self.rate) + self.offset_ns

    def ask(self, now_ns: int) -> bool:
        there, working, back = (round(ms * NS_PER_MS) for ms in self.rng.uniform(*self.line_ms, 3))
        received_ns = now_ns + there
        arrived_ns = received_ns + working + back
        return self.clock.exchange(now_ns, self.at(received_ns), self.at(received_ns + working), arrived_ns)
