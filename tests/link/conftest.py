from __future__ import annotations

import pytest
from board_double import Bench, BoardDouble

from haptics.link import Board, LinkSession


@pytest.fixture
def bench() -> Bench:
    """A session not yet started, and a board, joined by 0.3 ms of wire each way."""
    return Bench(LinkSession(Board.TACTILES, "double"), BoardDouble())


@pytest.fixture
def ready(bench: Bench) -> Bench:
    """The same after its handshake."""
    bench.session.start(0)
    bench.run(50)
    assert bench.session.ready
    return bench


@pytest.fixture
def armed(ready: Bench) -> Bench:
    """The same, armed."""
    assert ready.session.arm(ready.now_ns).done is False
    ready.run(5)
    assert ready.session.armed
    assert ready.board.armed
    return ready
