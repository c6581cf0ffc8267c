"""The conformance suite: every backend keeps every rule, and a board that breaks one is caught by it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from broken_boards import BREAKAGES
from cores import CORE_NAMES, marks_of
from tcp_board import TcpBoard

from haptics.errors import LinkError
from haptics.link.framing import encode_frame
from haptics.link.messages import Board
from haptics.link.runner import connect
from haptics.link_trial import raw_frames
from haptics.link_trial.conformance import FAILED, NOT_APPLICABLE, OK, RULES, try_board, try_rule
from haptics.link_trial.examples import EXAMPLES, example_frame
from haptics.link_trial.monitor import Monitor, close, open_link
from haptics.link_trial.raw_host import RawHost
from haptics.link_trial.rules.rule import Rule

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "protocol.md"


def url_of(board: Board, core: str) -> str:
    return f"sim://{board.name.lower()}?core={core}"


def named(id_: str, board: Board) -> Rule:
    return next(rule for rule in RULES if rule.id == id_ and board in rule.boards)


@pytest.mark.parametrize(
    ("board", "core", "rule"),
    [
        pytest.param(board, core, rule, marks=marks_of(core))
        for board in Board
        for core in CORE_NAMES
        for rule in RULES
        if board in rule.boards
    ],
    ids=lambda one: one.id if isinstance(one, Rule) else one.name.lower() if isinstance(one, Board) else one,
)
def test_every_backend_keeps_every_rule(board: Board, core: str, rule: Rule) -> None:
    result = try_rule(url_of(board, core), rule)
    assert result.result == OK, result.seen


def test_rules_have_names_of_their_own_and_say_what_they_hold_a_board_to() -> None:
    for board in Board:
        mine = [rule for rule in RULES if board in rule.boards]
        assert len({rule.id for rule in mine}) == len(mine) >= 60
    assert all(rule.title[0].isalpha() and not rule.title.endswith(".") for rule in RULES)


def test_the_golden_frames_are_those_of_the_page() -> None:
    block = re.search(r"```golden\n(.*?)```", PAGE.read_text(), re.S)
    assert block
    rows = [[part.strip() for part in line.split("|")] for line in block[1].strip().splitlines()]
    page = {name: bytes.fromhex(wire) for name, _, _, wire in rows}
    assert {name: example_frame(name) for name in EXAMPLES} == page
    for name, head, payload, _ in rows:
        type_, seq = bytes.fromhex(head)
        assert raw_frames.frame(type_, seq, bytes.fromhex(payload)) == page[name]


def test_the_raw_host_codes_frames_as_the_links_own_coder_does() -> None:
    for payload in (b"", bytes(64), bytes(range(1, 65)), b"\0\1\0\0\2\0"):
        wire = raw_frames.frame(0x33, 7, payload)
        assert wire == encode_frame(0x33, 7, payload)
        assert raw_frames.unstuffed(wire[:-1]) == bytes((0x33, 7)) + payload + raw_frames.checksum(bytes((0x33, 7)) + payload)
    assert raw_frames.unstuffed(b"\x05ab") is None
    assert raw_frames.unstuffed(b"\x00") is None


def test_a_report_counts_what_came_of_the_rules_and_says_what_is_not_for_a_board() -> None:
    chosen = [named("identify.always", Board.BRAKE), named("lid", Board.BRAKE)]
    report = try_board("sim://tactiles", chosen)
    assert [one.result for one in report.rules] == [OK, NOT_APPLICABLE]
    assert (report.count(OK), report.count(FAILED), report.count(NOT_APPLICABLE)) == (1, 0, 1)
    assert report.rules[1].seen == "not for the tactiles board"
    assert (report.identity["board"], report.identity["build"]) == ("tactiles", "py-tac-1")


def test_a_url_that_names_its_clock_keeps_it_and_shows_no_outputs() -> None:
    report = try_board("sim://tactiles?clock=real", [named("pulse.edges", Board.TACTILES)])
    assert report.rules[0].result == NOT_APPLICABLE


def state_of(url: str) -> str:
    runner, link = open_link(url)
    try:
        connect(runner)
        return Monitor(runner, link).watch(0.3).state
    finally:
        close(runner, link)


def test_a_real_board_is_disarmed_when_the_last_rule_is_done_and_when_the_user_breaks_off() -> None:
    def armed_and_left(host: RawHost) -> str:
        host.arm()
        return "armed"

    def broken_off(host: RawHost) -> str:
        host.arm()
        raise KeyboardInterrupt

    left, broken = (Rule("x", "x", check, arms=True) for check in (armed_and_left, broken_off))
    with TcpBoard() as board:
        assert try_board(board.url, [left], arms=True).count(OK) == 1
        assert state_of(board.url) == "disarmed"
        with pytest.raises(KeyboardInterrupt):
            try_board(board.url, [broken], arms=True)
        assert state_of(board.url) == "disarmed"


def test_without_a_board_there_is_nothing_to_hold_to_rules() -> None:
    with pytest.raises(LinkError, match="no identity within 4 s"):
        try_board("sim://tactiles?faults=drop=1")


@pytest.mark.parametrize(
    ("breakage", "board", "ids"),
    BREAKAGES,
    ids=[f"{one.__name__.strip('<>')}-{board.name.lower()}-{min(ids)}" for one, board, ids in BREAKAGES],
)
def test_a_broken_board_is_caught_by_the_rules_it_breaks(
    monkeypatch: pytest.MonkeyPatch, breakage: Callable[[pytest.MonkeyPatch], None], board: Board, ids: set[str]
) -> None:
    breakage(monkeypatch)
    results = {id_: try_rule(url_of(board, "py"), named(id_, board)) for id_ in ids}
    assert {id_: one.result for id_, one in results.items()} == dict.fromkeys(ids, FAILED)
    assert all(one.seen for one in results.values())
