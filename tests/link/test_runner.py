"""Runners over simulated ports made here (virtual time), a loop-back, and pseudo-terminals (real time)."""

from __future__ import annotations

import os
import select
import sys
import threading
import time

import pytest
from board_double import MS, BoardDouble

from haptics.errors import InputError, LinkLost, NotABoard, WrongFirmware
from haptics.link import (
    Board,
    Link,
    LinkSession,
    LinkSettings,
    Lost,
    RealtimeRunner,
    SimulatedPort,
    VirtualRunner,
    connect,
    open_port,
)
from haptics.link.runner import finish
from haptics.time import VirtualClock


class World:
    """A virtual clock that several boards share."""

    def __init__(self):
        self.now_ns = 0
        self.ports: list[DoublePort] = []

    def advance(self, to_ns: int) -> None:
        while True:
            times = [port.up[0][0] for port in self.ports if port.up]
            if not times or min(times) > to_ns:
                break
            self.now_ns = min(times)
            for port in self.ports:
                port.hear()
        assert to_ns >= self.now_ns
        self.now_ns = to_ns


class DoublePort:
    """A port with a board double behind 20 us a byte each way."""

    def __init__(self, board: BoardDouble, world: World | None = None):
        self.board, self.world = board, world or World()
        self.world.ports.append(self)
        self.up: list[tuple[int, bytes]] = []
        self.down: list[tuple[int, bytes]] = []
        self.is_open, self.broken = True, False

    def hear(self) -> None:
        while self.up and self.up[0][0] <= self.world.now_ns:
            answers = self.board.handle(self.up.pop(0)[1], self.world.now_ns)
            if answers:
                self.down.append((self.world.now_ns + self.board.turn_around_ns + 20_000 * len(answers), answers))

    def advance(self, to_ns: int) -> None:
        self.world.advance(to_ns)

    def next_event(self) -> int | None:
        times = [time for line in (self.up, self.down) for time, _ in line[:1] if time > self.world.now_ns]
        return min(times, default=None)

    def truth(self) -> dict:
        return {}

    def set_load(self, channel: int, **load: float) -> None: ...

    @property
    def in_waiting(self) -> int:
        if self.broken:
            raise OSError(5, "Input/output error")
        return sum(len(data) for time, data in self.down if time <= self.world.now_ns)

    def read(self, size: int = 1) -> bytes:
        data = b"".join(data for time, data in self.down if time <= self.world.now_ns)
        self.down = [item for item in self.down if item[0] > self.world.now_ns]
        return data

    def write(self, data: bytes) -> int:
        self.up.append((self.world.now_ns + 20_000 * len(data), bytes(data)))
        return len(data)

    def close(self) -> None:
        self.is_open = False


def link_to(port: DoublePort, name: str = "double", board: Board | None = Board.TACTILES) -> Link:
    return Link(port, LinkSession(board, name))


def test_virtual_connect_and_a_command():
    port = DoublePort(BoardDouble())
    assert isinstance(port, SimulatedPort)
    link = link_to(port)
    runner = VirtualRunner([link])
    (identity,) = connect(runner)
    assert identity.build == b"double\0\0"
    assert link.ready
    assert link.board is Board.TACTILES
    assert link.name == "double"
    assert not link.armed
    finish(runner, link.arm(runner.now_ns()))
    assert link.armed
    assert link.error is None
    runner.run_until(1_000 * MS)
    assert runner.now_ns() == port.world.now_ns == 1_000 * MS
    assert link.clock.error_bound_s(runner.now_ns()) < 1e-3
    assert abs(link.to_ticks(runner.now_ns()) - port.board.ticks(runner.now_ns())) <= 2e6 * 1e-3
    assert finish(runner, link.stop(runner.now_ns())).ok
    assert not port.board.armed


@pytest.mark.parametrize("skew", [-5e-5, 0.0, 5e-5])
def test_the_lines_own_time_is_no_part_of_the_clocks_error(skew):
    """Question and answer take 200 and 360 us at 500 kbaud: 80 us off the middle, which a host that knows the baud takes out."""
    errors_us = {}
    for baud in (0, 500_000):
        port = DoublePort(BoardDouble(skew=skew))
        link = Link(port, LinkSession(Board.TACTILES, "double", baud=baud))
        runner = VirtualRunner([link])
        connect(runner)
        runner.run_until(2_000 * MS)
        off_ticks = (link.to_ticks(runner.now_ns()) - port.board.ticks(runner.now_ns()) + 2**31) % 2**32 - 2**31
        errors_us[baud] = abs(off_ticks) / 2
        assert errors_us[baud] <= link.clock.error_bound_s(runner.now_ns()) * 1e6 + 0.5
    assert errors_us[0] == pytest.approx(80, abs=5)
    assert errors_us[500_000] < 5


def test_a_line_quicker_than_its_baud_is_found_out_and_the_bound_still_holds():
    port = DoublePort(BoardDouble())
    link = Link(port, LinkSession(Board.TACTILES, "double", baud=115_200))
    runner = VirtualRunner([link])
    connect(runner)
    runner.run_until(2_000 * MS)
    off_ticks = (link.to_ticks(runner.now_ns()) - port.board.ticks(runner.now_ns()) + 2**31) % 2**32 - 2**31
    assert abs(off_ticks) / 2e6 <= link.clock.error_bound_s(runner.now_ns()) + 1e-6
    assert link.session.counters.clock_contradictions == 0


def test_two_boards_in_one_world_and_one_in_its_own():
    world = World()
    shared = [DoublePort(BoardDouble(boot_id=1), world), DoublePort(BoardDouble(boot_id=2), world)]
    alone = DoublePort(BoardDouble(boot_id=3))
    runner = VirtualRunner([link_to(port, str(index)) for index, port in enumerate([*shared, alone])])
    assert [identity.boot_id for identity in connect(runner)] == [1, 2, 3]
    runner.run_until(runner.now_ns() + 100 * MS)
    assert world.now_ns == alone.world.now_ns == runner.now_ns()


def test_a_real_port_is_not_stepped():
    link = Link(open_port("loop://"), LinkSession(Board.TACTILES, "loop://"))
    with pytest.raises(InputError, match="loop"):
        VirtualRunner([link])
    link.close()


def test_every_event_is_handled_at_its_own_time():
    """A reply is seen when its last byte is in, however far the caller asks to run."""
    port = DoublePort(BoardDouble())
    times: list[tuple[int, str]] = []
    link = Link(port, LinkSession(Board.TACTILES, "double", tap=lambda at, way, data: times.append((at, way))))
    runner = VirtualRunner([link], VirtualClock())
    link.start(0)
    runner.run_until(200 * MS)
    # identify is 7 bytes with its leading delimiter, identity 40 bytes with this boot id: see the protocol page
    assert times[:2] == [
        (0, "out"),
        (20_000 * 7 + 50_000 + 20_000 * len(port.board.handle(bytes.fromhex("020103 9f1600"), 0)), "in"),
    ]


def test_the_same_run_gives_the_same_bytes():
    def run() -> list:
        seen: list[tuple] = []
        link = Link(DoublePort(BoardDouble()), LinkSession(Board.TACTILES, "double", tap=lambda *row: seen.append(row)))
        runner = VirtualRunner([link])
        connect(runner)
        link.arm(runner.now_ns())
        runner.run_until(1_000 * MS)
        return seen

    assert run() == run()


def test_connect_says_what_is_wrong():
    board = BoardDouble()
    board.schema_hash ^= 1
    with pytest.raises(WrongFirmware, match="message table"):
        connect(VirtualRunner([link_to(DoublePort(board))]))
    board = BoardDouble()
    board.silent = True
    with pytest.raises(NotABoard, match="no byte came"):
        connect(VirtualRunner([link_to(DoublePort(board))]))
    with pytest.raises(NotABoard, match="no byte came"):
        connect(VirtualRunner([link_to(DoublePort(board))]), timeout_s=0.5)


@pytest.mark.parametrize("how", ["read", "write"])
def test_a_port_that_fails_under_way_is_link_lost(how):
    port = DoublePort(BoardDouble())
    link = link_to(port)
    runner = VirtualRunner([link])
    connect(runner)
    link.events()
    if how == "read":
        port.broken = True
        pending = link.send("cancel", 1, now_ns=runner.now_ns())
    else:

        def fail(data: bytes) -> int:
            raise OSError(5, "Input/output error")

        port.write = fail
        pending = link.send("cancel", 1, now_ns=runner.now_ns())
    runner.run_until(runner.now_ns() + 10 * MS)
    assert isinstance(pending.error, LinkLost)
    assert isinstance(link.error, LinkLost)
    assert how in str(link.error)
    assert [type(event) for event in link.events()] == [Lost]


def test_real_time_over_a_loop_back_finds_the_echo():
    threads_before = threading.active_count()
    settings = LinkSettings(identify_every_ns=5 * MS, identify_tries=4)
    link = Link(open_port("loop://"), LinkSession(Board.TACTILES, "loop://", settings=settings))
    with RealtimeRunner([link]) as runner, pytest.raises(NotABoard, match="loop-back"):
        connect(runner)
    assert not link.port.is_open
    assert threads_before == threading.active_count()


pty = pytest.mark.skipif(sys.platform == "win32", reason="needs pseudo-terminals")


class PtyBoard:
    """A board double in a thread at the far end of a pseudo-terminal."""

    def __init__(self, board: BoardDouble):
        self.board = board
        board.turn_around_ns = 0
        self._end, self._near = os.openpty()  # the near side is held open, so that the far one lives while nobody is connected
        self.path = os.ttyname(self._near)
        self._wake, self._pull = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            ready, _, _ = select.select([self._end, self._wake], [], [])
            if self._wake in ready:
                return
            os.write(self._end, self.board.handle(os.read(self._end, 4096), time.monotonic_ns()))

    def unplug(self) -> None:
        os.write(self._pull, b"x")
        self._thread.join()
        for end in (self._end, self._near, self._wake, self._pull):
            os.close(end)


@pytest.fixture
def far():
    board = PtyBoard(BoardDouble(born_ns=time.monotonic_ns()))
    yield board
    if board._thread.is_alive():
        board.unplug()


# A test machine may pause for longer than a board would wait; these settings take that as it comes.
PATIENT = LinkSettings(
    reply_timeout_ns=500 * MS, sync_timeout_ns=2_000 * MS, max_error_s=10.0, max_age_s=100.0, clock_jump_s=60.0
)


@pytest.mark.pty
@pty
def test_real_time_over_a_pseudo_terminal(far):
    link = Link(open_port(far.path), LinkSession(Board.TACTILES, far.path, settings=PATIENT))
    with RealtimeRunner([link]) as runner:
        connect(runner, timeout_s=30)
        assert finish(runner, link.arm(runner.now_ns()), 10).ok
        pendings = []

        def fire():
            pendings.extend(link.send("cancel", 1, now_ns=runner.now_ns()) for _ in range(50))

        threads = [threading.Thread(target=fire) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert runner.wait_for(lambda: all(pending.done for pending in pendings), 30)
        assert len(pendings) == 150
        assert all(pending.ok for pending in pendings)
        assert finish(runner, link.stop(runner.now_ns()), 10).ok
    assert far.board.types().count(0x11) == 150
    assert not far.board.armed
    assert not link.port.is_open


@pytest.mark.pty
@pty
def test_a_cable_pulled_out_is_link_lost_and_closes_cleanly(far):
    link = Link(open_port(far.path), LinkSession(Board.TACTILES, far.path, settings=PATIENT))
    with RealtimeRunner([link]) as runner:
        connect(runner, timeout_s=30)
        far.unplug()
        pending = link.send("cancel", 1, now_ns=runner.now_ns())
        assert runner.wait_for(lambda: link.error is not None, 30)
        assert isinstance(link.error, LinkLost)
        assert pending.done


@pytest.mark.pty
@pty
def test_a_lost_port_is_opened_again_and_not_armed(far):
    link = Link(open_port(far.path), LinkSession(Board.TACTILES, far.path, settings=PATIENT))
    with RealtimeRunner([link], reopen=True) as runner:
        connect(runner, timeout_s=30)
        finish(runner, link.arm(runner.now_ns()), 10)
        first = link.port
        link.lose(LinkLost(far.path, "pulled out"), runner.now_ns())
        assert runner.wait_for(lambda: link.ready and link.port is not first, 30)
        assert not link.armed
