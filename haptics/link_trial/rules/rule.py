"""What a rule of the protocol is, and how files of rules list theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from haptics.link.messages import Board
from haptics.link_trial.raw_host import RawHost

BOTH = (Board.TACTILES, Board.BRAKE)
COILS = (Board.TACTILES,)
BRAKES = (Board.BRAKE,)

Check = Callable[[RawHost], str]


@dataclass(frozen=True, slots=True)
class Rule:
    """A promise of the protocol, and how to test whether a board keeps it.

    :param id: short name, such as ``pulse.late``.
    :param title: the promise in one sentence.
    :param check: tries it on a board that is known and at rest; returns what was seen. Raises ``Broken`` or ``NotApplicable``.
    :param boards: whose promise it is.
    :param arms: outputs may be energised on the way.
    :param simulated: only a simulated board shows it, or can be treated so.
    :param met: whether the board is identified beforehand.
    :param query: how a simulated board is opened for it, ``key=value``, unless the URL names that key.
    """

    id: str
    title: str
    check: Check
    boards: tuple[Board, ...] = BOTH
    arms: bool = False
    simulated: bool = False
    met: bool = True
    query: tuple[str, ...] = ()


class Rules(list[Rule]):
    """Rules in their order."""

    def rule(
        self,
        id_: str,
        title: str,
        boards: tuple[Board, ...] = BOTH,
        *,
        arms: bool = False,
        simulated: bool = False,
        met: bool = True,
        query: tuple[str, ...] = (),
    ) -> Callable[[Check], Check]:
        """List the function below as a rule.

        :param id_: see ``Rule``, as for all that follows.
        :param title: the promise in one sentence.
        :param boards: whose promise it is.
        :param arms: outputs may be energised on the way.
        :param simulated: only a simulated board shows it, or can be treated so.
        :param met: whether the board is identified beforehand.
        :param query: how a simulated board is opened for it, ``key=value``.
        :return: a decorator.
        """

        def add(check: Check) -> Check:
            self.append(Rule(id_, title, check, boards, arms, simulated, met, query))
            return check

        return add
