"""Rules that engage a garment's clutches (thesis 6.5): pure state machines from what the body does to the set of
clutches that hold.

A clutch resists being stretched and nothing else, so a rule never traps a limb: the opposite movement is always free. Where a
rule's signal is unknown, its clutches let go.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

from haptics.errors import InputError
from haptics.scene.signals import LARGEST_ANGLE_RAD, BodySignals
from haptics.time import seconds_to_ns
from haptics.units import in_range

_STRICT_FIELDS = {"extra": "forbid", "allow_inf_nan": False}  # for the scene file's parser
_NONE: frozenset[str] = frozenset()


@dataclass(frozen=True)
class BodyState:
    """What a rule may look at.

    :param time_ns: from the start of the run; must not decrease from one state to the next.
    :param signals: the body's angles.
    :param held: name of the object in the hand; None: none.
    :param touched: names of the objects touched.
    """

    time_ns: int
    signals: BodySignals
    held: str | None = None
    touched: Collection[str] = ()


class RunningRule(Protocol):
    """A rule in play; it remembers what it must."""

    def update(self, state: BodyState) -> frozenset[str]:
        """Advance to a state.

        :param state: the body now; its time must not be earlier than the last one's.
        :return: the clutches that this rule engages now.
        """
        ...


class Rule(Protocol):
    """What a scene asks of a rule; each rule is plain data."""

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the body signals that it reads."""
        ...

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that it looks at."""
        ...

    def start(self) -> RunningRule:
        """Put the rule in play.

        :return: with no clutch engaged.
        """
        ...


@dataclass(frozen=True)
class ByGrasp(Rule):
    """Workplace training: while the object is grasped, all its clutches hold and steady the upper body.

    :param object: name of the object; it needs a grasp effect.
    :param clutches: names, at least one, each once.
    :param kind: always ``by_grasp``.
    :raises InputError: no clutch, or one named twice.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    object: str
    clutches: tuple[str, ...]
    kind: Literal["by_grasp"] = "by_grasp"

    def __post_init__(self) -> None:
        _check_clutches(self.kind, self.clutches)

    @property
    def signals(self) -> tuple[str, ...]:
        return ()

    @property
    def objects(self) -> tuple[str, ...]:
        return (self.object,)

    def start(self) -> RunningRule:
        return _ByGrasp(self)


@dataclass(frozen=True)
class HeldPosture(Rule):
    """Posture correction: once upright, the posture is held for ``hold_s``, then a slouch is allowed for
    ``release_s``, over and over.

    :param signal: name of the angle that grows with the slouch.
    :param clutches: names, at least one, each once.
    :param upright_rad: upright is this or less, within ±2π rad. The hold begins only when upright, so that nobody is held in a
        slouch.
    :param hold_s: 0.1 to 86,400 s.
    :param release_s: 0 to 86,400 s.
    :param kind: always ``held_posture``.
    :raises InputError: a number out of range, no clutch, or one named twice.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    signal: str
    clutches: tuple[str, ...]
    upright_rad: float
    hold_s: float
    release_s: float
    kind: Literal["held_posture"] = "held_posture"

    def __post_init__(self) -> None:
        _check_clutches(self.kind, self.clutches)
        in_range("upright_rad", self.upright_rad, -LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD, "rad")
        in_range("hold_s", self.hold_s, 0.1, 86_400.0, "s")
        in_range("release_s", self.release_s, 0.0, 86_400.0, "s")

    @property
    def signals(self) -> tuple[str, ...]:
        return (self.signal,)

    @property
    def objects(self) -> tuple[str, ...]:
        return ()

    def start(self) -> RunningRule:
        return _HeldPosture(self)


@dataclass(frozen=True)
class SelectiveResistance(Rule):
    """Resistance training: the direction of the signal's motion chooses which clutches resist; the opposing ones are free.

    Below ``min_rate_rad_s`` the last choice stays, as a clutch that has stopped the motion must keep holding it.

    :param signal: name of the angle.
    :param rising: clutches that resist while the angle grows (flexion).
    :param falling: clutches that resist while it shrinks (extension); none of ``rising``.
    :param min_rate_rad_s: slower motion changes nothing, 0 to 20 rad/s.
    :param kind: always ``selective_resistance``.
    :raises InputError: a number out of range, no clutch in either direction, or one named twice.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    signal: str
    rising: tuple[str, ...]
    falling: tuple[str, ...]
    min_rate_rad_s: float = 0.1
    kind: Literal["selective_resistance"] = "selective_resistance"

    def __post_init__(self) -> None:
        _check_clutches(self.kind, self.rising)
        _check_clutches(self.kind, self.falling)
        if both := set(self.rising) & set(self.falling):
            raise InputError(
                f"clutches {sorted(both)} are in rising and in falling, which would lock the limb; name each in one of them"
            )
        in_range("min_rate_rad_s", self.min_rate_rad_s, 0.0, 20.0, "rad/s")

    @property
    def clutches(self) -> tuple[str, ...]:
        """All clutches of either direction."""
        return self.rising + self.falling

    @property
    def signals(self) -> tuple[str, ...]:
        return (self.signal,)

    @property
    def objects(self) -> tuple[str, ...]:
        return ()

    def start(self) -> RunningRule:
        return _SelectiveResistance(self)


@dataclass(frozen=True)
class OnContact(Rule):
    """VR gaming: the clutches hold from each contact with the object, for ``hold_s`` or as long as the contact lasts
    if that is longer.

    :param object: name of the object.
    :param clutches: names, at least one, each once.
    :param hold_s: shortest hold, 0 to 10 s.
    :param kind: always ``on_contact``.
    :raises InputError: a number out of range, no clutch, or one named twice.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    object: str
    clutches: tuple[str, ...]
    hold_s: float = 0.2
    kind: Literal["on_contact"] = "on_contact"

    def __post_init__(self) -> None:
        _check_clutches(self.kind, self.clutches)
        in_range("hold_s", self.hold_s, 0.0, 10.0, "s")

    @property
    def signals(self) -> tuple[str, ...]:
        return ()

    @property
    def objects(self) -> tuple[str, ...]:
        return (self.object,)

    def start(self) -> RunningRule:
        return _OnContact(self)


ClutchRule = ByGrasp | HeldPosture | SelectiveResistance | OnContact


class ClutchRules:
    """All rules of a scene in play; a clutch holds while any rule wants it to.

    :param rules: may share clutches.
    """

    def __init__(self, rules: Sequence[ClutchRule]):
        self._running = [rule.start() for rule in rules]

    def update(self, state: BodyState) -> frozenset[str]:
        """Advance all rules to a state.

        :param state: the body now; its time must not be earlier than the last one's.
        :return: the clutches that should hold now.
        """
        return _NONE.union(*(rule.update(state) for rule in self._running))


class _ByGrasp:
    def __init__(self, rule: ByGrasp):
        self._rule, self._clutches = rule, frozenset(rule.clutches)

    def update(self, state: BodyState) -> frozenset[str]:
        return self._clutches if state.held == self._rule.object else _NONE


class _HeldPosture:
    def __init__(self, rule: HeldPosture):
        self._rule, self._clutches = rule, frozenset(rule.clutches)
        self._held_since_ns: int | None = None
        self._free_until_ns: int | None = None

    def update(self, state: BodyState) -> frozenset[str]:
        reading = state.signals.read(self._rule.signal, state.time_ns)
        if reading is None:
            self._held_since_ns = None
            return _NONE
        if self._held_since_ns is not None:
            ends_ns = self._held_since_ns + seconds_to_ns(self._rule.hold_s)
            if state.time_ns < ends_ns:
                return self._clutches
            self._held_since_ns, self._free_until_ns = None, ends_ns + seconds_to_ns(self._rule.release_s)
        rested = self._free_until_ns is None or state.time_ns >= self._free_until_ns
        if rested and reading[0] <= self._rule.upright_rad:
            self._held_since_ns = state.time_ns
            return self._clutches
        return _NONE


class _SelectiveResistance:
    def __init__(self, rule: SelectiveResistance):
        self._rule = rule
        self._engaged = _NONE

    def update(self, state: BodyState) -> frozenset[str]:
        reading = state.signals.read(self._rule.signal, state.time_ns)
        if reading is None:
            self._engaged = _NONE
        elif reading[1] > self._rule.min_rate_rad_s:
            self._engaged = frozenset(self._rule.rising)
        elif reading[1] < -self._rule.min_rate_rad_s:
            self._engaged = frozenset(self._rule.falling)
        return self._engaged


class _OnContact:
    def __init__(self, rule: OnContact):
        self._rule, self._clutches = rule, frozenset(rule.clutches)
        self._touching = False
        self._until_ns: int | None = None

    def update(self, state: BodyState) -> frozenset[str]:
        touching = self._rule.object in state.touched
        if touching and not self._touching:
            self._until_ns = state.time_ns + seconds_to_ns(self._rule.hold_s)
        self._touching = touching
        holding = touching or (self._until_ns is not None and state.time_ns < self._until_ns)
        return self._clutches if holding else _NONE


def _check_clutches(kind: str, clutches: tuple[str, ...]) -> None:
    if not clutches or len(set(clutches)) != len(clutches):
        raise InputError(f"{kind} clutches = {list(clutches)}; expected at least one, each once")
