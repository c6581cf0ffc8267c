"""A board that is lost, or never met, is lost in words: nothing came, or this came, quoted."""

from __future__ import annotations

import pytest
from board_double import BoardDouble, frame

from haptics.errors import LinkLost, NotABoard
from haptics.link.framing import Deframer
from haptics.link.messages import Board
from haptics.link.session import LinkSession

MS = 1_000_000


class Line:
    """A session and a board that answers at once, until ``instead`` says what comes instead of its answers."""

    def __init__(self):
        self.session, self.board, self.now_ns = LinkSession(Board.TACTILES, "line"), BoardDouble(), 0
        self.session.start(0)

    def run(self, ms, instead=None):
        for _ in range(ms):
            self.now_ns += MS
            self.session.poll(self.now_ns)
            answer = self.board.handle(self.session.outgoing(), self.now_ns)
            answer = answer if instead is None else instead(answer)
            if answer:
                self.session.receive(answer, self.now_ns + MS // 4)
        return self.session


@pytest.fixture
def ready():
    line = Line()
    assert line.run(200).ready
    return line


def debug_print_between_frames(answer):
    return answer.replace(b"\0", b"\0dbg: loop 12 ms\r\n", 1)


@pytest.mark.parametrize(
    ("instead", "seen", "not_seen"),
    [
        (lambda _: b"", ["no byte came from the board for 4 s", "check cable and power"], ["bytes came"]),
        (
            lambda _: b"dbg: loop 12 ms\r\n\0",
            ["no valid frame for 4 s", "bytes came that form no frame", "dbg: loop 12 ms", "that is text"],
            ["no byte"],
        ),
        (
            lambda _: b"\xfe\x81\x9a\0",
            ["no valid frame for 4 s", "bytes came that form no frame", "\\xfe\\x81\\x9a", "baud rate"],
            ["no byte"],
        ),
        (lambda _: b"\xfe\x81", ["bytes came that form no frame", "\\xfe\\x81\\xfe\\x81"], ["no byte"]),
        (
            lambda _: frame(0x90, 1, bytes(7)),
            ["no identity for 4 s", "valid frames, none an identity, and 0 damaged ones"],
            ["no byte"],
        ),
    ],
    ids=["nothing", "text", "noise", "noise without end", "frames of something else"],
)
def test_a_silent_board_is_not_taken_for_one_that_sends_something_else(ready, instead, seen, not_seen):
    session = ready.run(8000, instead)
    assert isinstance(session.error, LinkLost)
    assert all(text in str(session.error) for text in seen), str(session.error)
    assert not any(text in str(session.error) for text in not_seen)


def test_what_came_before_the_trouble_is_not_counted(ready):
    ready.run(3000)
    before = ready.session.counters.bytes_in
    assert before > 100
    error = str(ready.run(8000, lambda answer: b"?" if answer else b"").error)
    assert int(error.split(" bytes came")[0].split()[-1]) < 100


def test_debug_prints_in_front_of_frames_are_quoted():
    line = Line()
    session = line.run(6000, debug_print_between_frames)
    # its first answer ends with the text, and every later frame begins with it
    assert isinstance(session.error, NotABoard | LinkLost)
    assert "dbg: loop 12 ms" in str(session.error)


def test_a_deframer_keeps_the_beginning_of_its_first_garbage_only():
    deframer = Deframer()
    deframer.feed(frame(0x90, 1, bytes(7)) + b"first garbage\0second\0" + b"x" * 500)
    assert deframer.sample == b"first garbage"
    deframer.sample = b""
    deframer.feed(b"y" * 500 + b"\0")
    assert deframer.sample.startswith((b"x", b"y"))
    assert len(deframer.sample) <= 32
