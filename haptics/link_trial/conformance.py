"""Whether a board keeps the protocol, rule by rule, seen from its port.

A simulated board is opened anew for each rule, in virtual time; hardware once, and brought to rest before each. Rules that arm
are tried on hardware only if a person asked for that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from haptics.errors import LinkError
from haptics.link.messages import DEFAULT_BAUD, Board
from haptics.link.port_url import is_simulated, query_of, with_defaults
from haptics.link.ports import open_port
from haptics.link.readings import build_name
from haptics.link_trial.raw_host import Broken, NotApplicable, RawHost
from haptics.link_trial.rules import brake, drive, frames, heat, line, safety, schedule, session, silence
from haptics.link_trial.rules.rule import Rule

RULES: tuple[Rule, ...] = (
    *session.RULES,
    *frames.RULES,
    *line.RULES,
    *schedule.RULES,
    *heat.RULES,
    *drive.RULES,
    *brake.RULES,
    *safety.RULES,
    *silence.RULES,
)
OK, FAILED, NOT_APPLICABLE = "ok", "failed", "not applicable"


@dataclass(frozen=True, slots=True)
class Result:
    """Outcome of one rule.

    :param id: of the rule, such as ``pulse.late``.
    :param title: of the rule.
    :param result: ``ok``, ``failed`` or ``not applicable``.
    :param seen: what was observed, or why the rule does not apply.
    """

    id: str
    title: str
    result: str
    seen: str


@dataclass(frozen=True, slots=True)
class Conformance:
    """Outcome of all rules on one board.

    :param port: its URL or path.
    :param identity: fields of its ``identity`` message, ids in hexadecimal.
    :param rules: results in the order of the rules.
    """

    port: str
    identity: dict[str, Any]
    rules: list[Result] = field(default_factory=list[Result])

    def count(self, result: str) -> int:
        """Number of rules with this outcome.

        :param result: ``ok``, ``failed`` or ``not applicable``.
        :return: how many.
        """
        return sum(one.result == result for one in self.rules)


def try_board(
    url: str,
    rules: Sequence[Rule] = RULES,
    *,
    arms: bool = False,
    baud: int = DEFAULT_BAUD,
    progress: Callable[[str], None] = lambda _: None,
) -> Conformance:
    """Try every rule on the board behind a port.

    :param url: a port. A simulated board runs in virtual time unless its URL names another clock.
    :param rules: which rules; all if not given.
    :param arms: rules that arm may be tried on hardware; on a simulated board they always are.
    :param baud: speed of a serial line.
    :param progress: called with each rule's title before it is tried.
    :return: what came of each rule.
    :raises InputError, LinkError: the port cannot be opened, or no board answers there.
    """
    simulated = is_simulated(url)
    host = _open(url, (), baud)
    try:
        report = Conformance(url, _in_words(host.meet()))
        for rule in rules:
            progress(rule.title)
            why = _out_of_question(rule, host, simulated or arms)
            if why is not None:
                report.rules.append(Result(rule.id, rule.title, NOT_APPLICABLE, why))
            elif simulated:
                report.rules.append(try_rule(url, rule, baud))
            else:
                host.rest()
                report.rules.append(_try(rule, host))
    finally:
        if arms and not simulated:
            _leave(host)
        host.port.close()
    return report


def _leave(host: RawHost) -> None:
    """However it ended, a real board is not left to its dead-man."""
    with suppress(LinkError, Broken):
        host.rest()


def _in_words(identity: Any) -> dict[str, Any]:
    """Its fields, readable: the name of the board and of its build, ids in hexadecimal."""
    ids = {name: f"{getattr(identity, name):08x}" for name in ("schema_hash", "boot_id")}
    return {**identity._asdict(), **ids, "board": Board(identity.board).name.lower(), "build": build_name(identity)}


def try_rule(url: str, rule: Rule, baud: int = DEFAULT_BAUD) -> Result:
    """Try one rule on a simulated board, opened for it.

    :param url: a ``sim://`` URL.
    :param rule: the rule.
    :param baud: speed of the simulated line.
    :return: what came of it.
    :raises InputError, LinkError: the port cannot be opened, or no board answers there.
    """
    host = _open(url, rule.query, baud)
    try:
        if rule.met:
            host.meet()
        return _try(rule, host)
    finally:
        host.port.close()


def _open(url: str, query: tuple[str, ...], baud: int) -> RawHost:
    return RawHost(open_port(_with_query(url, query), baud), url)


def _with_query(url: str, query: tuple[str, ...]) -> str:
    """A simulated port with a virtual clock and what a rule asks for, unless the URL names those keys; others as they are."""
    wanted = {"clock": "virtual", **dict(pair.split("=", 1) for pair in query)}
    if query_of(url).get("core") == "avr":  # its clock begins where it does
        wanted.pop("tick_offset", None)
    return with_defaults(url, **wanted)


def _out_of_question(rule: Rule, host: RawHost, may_arm: bool) -> str | None:
    if host.board not in rule.boards:
        return f"not for the {host.board.name.lower()} board"
    if rule.simulated and host.simulated is None:
        return "only a simulated board in virtual time shows this"
    if rule.arms and not may_arm:
        return "arms the board, which was not asked for"
    return None


def _try(rule: Rule, host: RawHost) -> Result:
    try:
        return Result(rule.id, rule.title, OK, rule.check(host))
    except Broken as broken:
        return Result(rule.id, rule.title, FAILED, str(broken))
    except NotApplicable as reason:
        return Result(rule.id, rule.title, NOT_APPLICABLE, str(reason))
