"""A scene in use: objects with their effects, body signals, clutches and rules, and the devices that all this needs.

A ``Scene`` never changes; placing or moving an object gives another one. What happens over time (touches, grasps,
patterns) is kept by the trackers of ``contact``, ``grasp``, ``effects`` and ``clutch_rules``, which are made from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from haptics.errors import InputError
from haptics.scene.clutch_rules import ClutchRule, ClutchRules
from haptics.scene.contact import ContactTracker
from haptics.scene.effects import (
    ContactEffect,
    Effect,
    FixedSetEffect,
    GraspEffect,
    PatternBank,
    PatternEffect,
    ProximityEffect,
)
from haptics.scene.geometry.mesh import TriangleMesh, slow_notice
from haptics.scene.geometry.pose import Array, Pose
from haptics.scene.grasp import RULES, GraspTracker, grasp_rule
from haptics.scene.hands.recording import HandRecording
from haptics.scene.objects import SceneObject, check_object, place_by_palm, size_in_hand
from haptics.scene.patterns import REFRESH_HZ
from haptics.scene.placement import InHand, place_at_palm, place_in_hand
from haptics.scene.signals import BodySignals, Signal
from haptics.scene.sites import SITES
from haptics.units import an_instance, brief, in_range, nearest, one_of


@dataclass(frozen=True)
class Clutch:
    """An electrostatic clutch of a garment (14 cm by 1 cm at 350 V stated, thesis 6.3.3).

    :param name: unique in its scene.
    :param where: on the body, in words.
    :param length_m: along the pull, 0.01 to 1 m.
    :param width_m: 0.001 to 0.2 m.
    :param amplitude_v: of its drive, 0 to 1500 V.
    :raises InputError: a number out of its range.
    """

    __pydantic_config__: ClassVar[dict] = {"extra": "forbid", "allow_inf_nan": False}
    name: str
    where: str
    length_m: float = 0.14
    width_m: float = 0.01
    amplitude_v: float = 350.0

    def __post_init__(self) -> None:
        in_range(f"clutch {self.name!r} length_m", self.length_m, 0.01, 1.0, "m")
        in_range(f"clutch {self.name!r} width_m", self.width_m, 0.001, 0.2, "m")
        in_range(f"clutch {self.name!r} amplitude_v", self.amplitude_v, 0.0, 1500.0, "V")


@dataclass(frozen=True)
class SceneNeeds:
    """What a scene can ask of hand, models and devices; what is not named here need not exist.

    :param sites: hand sites whose distance to some object matters, in the order of ``SITES``.
    :param pins: sites driven in contact mode.
    :param pulses: sites driven in pulse mode.
    :param patterns: spatial patterns played.
    :param refresh_hz: fastest refresh of any of them, Hz; 0 without patterns.
    :param brakes: fingers whose brake may hold.
    :param brake_v: highest amplitude asked of them, V.
    :param piezos: fingers whose piezo may shake.
    :param clutches: garment clutches that a rule may engage.
    :param signals: body signals that a rule reads.
    :param shapes: kinds of shape, by class name.
    """

    sites: tuple[str, ...] = ()
    pins: tuple[str, ...] = ()
    pulses: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()
    refresh_hz: float = 0.0
    brakes: tuple[str, ...] = ()
    brake_v: float = 0.0
    piezos: tuple[str, ...] = ()
    clutches: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()

    @property
    def boards(self) -> tuple[str, ...]:
        """The boards that it has a use for: ``tactiles``, ``brake``."""
        brake = bool(self.brakes or self.piezos or self.clutches)
        return tuple(name for name, use in (("tactiles", self.tactiles), ("brake", brake)) if use)

    @property
    def tactiles(self) -> bool:
        """Whether the array of tactors is used at all."""
        return bool(self.pins or self.pulses)


@dataclass(frozen=True)
class Scene:
    """Objects, signals, clutches and rules under a name.

    :param name: of the scene.
    :param objects: each with a name of its own.
    :param signals: body signals with profiles.
    :param clutches: of a garment.
    :param rules: which engage them.
    :param grasp_rule: ``rearming`` or ``thesis``.
    :param summary: what it is, for people.
    :param source: where it comes from, such as a thesis section.
    :param absent: objects left out when the scene was placed, each with the reason.
    :param origin: the shipped name or the file that it was loaded from; empty for one that a program made.
    :raises InputError: two objects of one name, a rule about something that is not there, or an unknown grasp rule.
    """

    name: str
    objects: tuple[SceneObject, ...] = ()
    signals: tuple[Signal, ...] = ()
    clutches: tuple[Clutch, ...] = ()
    rules: tuple[ClutchRule, ...] = ()
    grasp_rule: str = RULES[0]
    summary: str = ""
    source: str = ""
    absent: tuple[tuple[str, str], ...] = field(default=())
    origin: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        one_of("grasp_rule", self.grasp_rule, RULES)
        for what, names in (("object", self.names), ("signal", _names(self.signals)), ("clutch", _names(self.clutches))):
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise InputError(
                    f"{what} {twice[0]!r} appears more than once in scene {self.name!r}; each needs a name of its own"
                )
        for item in self.objects:
            check_object(item)
        known = self.names + tuple(name for name, _ in self.absent)
        for rule in self.rules:
            _check_known(rule.kind, "object", rule.objects, known)
            _check_known(rule.kind, "signal", rule.signals, _names(self.signals))
            _check_known(rule.kind, "clutch", rule.clutches, _names(self.clutches))
            if rule.kind == "by_grasp" and any(item.name == rule.object and item.grasp is None for item in self.objects):
                raise InputError(
                    f"rule by_grasp: object {rule.object!r} has no grasp effect; give it one, or name an object that has one"
                )

    @property
    def names(self) -> tuple[str, ...]:
        """The objects' names, in order."""
        return _names(self.objects)

    def object(self, name: str) -> SceneObject:
        """An object by its name.

        :param name: the object's.
        :return: the object.
        :raises InputError: no such object.
        """
        for item in self.objects:
            if item.name == name:
                return item
        known = (", ".join(self.names) or "none") + nearest(name, self.names)
        raise InputError(f"object = {brief(name)} is not in scene {self.name!r}; its objects: {known}")

    @property
    def effects(self) -> dict[str, tuple[Effect, ...]]:
        """The effects of each object, by its name."""
        return {item.name: item.effects for item in self.objects}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to meshes when they were read, by object, and what they will cost."""
        meshes = [(item.name, item.body.shape) for item in self.objects if isinstance(item.body.shape, TriangleMesh)]
        slow = self.slow_notice
        return (*(f"{name}: {note}" for name, mesh in meshes for note in mesh.notes), *([slow] if slow else []))

    @property
    def slow_notice(self) -> str | None:
        """That its meshes will make a run slow, before it begins; None where they will not."""
        return slow_notice([item.body.shape for item in self.objects if isinstance(item.body.shape, TriangleMesh)])

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Objects whose place still depends on a hand."""
        return tuple(item.name for item in self.objects if not item.resolved)

    def moved(self, name: str, pose: Pose) -> Scene:
        """The scene with one object elsewhere in the world.

        :param name: the object's.
        :param pose: in the world.
        :return: another scene; this one stays as it is.
        :raises InputError: no such object.
        """
        there = replace(self.object(name), body=self.object(name).body.at(pose), resolved=True)
        return replace(self, objects=tuple(there if item.name == name else item for item in self.objects))

    def without_unresolved(self) -> Scene:
        """The scene as long as no hand has placed it: of objects without a place nothing is there.

        :return: another scene; this one stays as it is.
        """
        return (
            replace(
                self,
                objects=tuple(item for item in self.objects if item.resolved),
                absent=(*self.absent, *((name, "not placed yet") for name in self.unresolved)),
            )
            if self.unresolved
            else self
        )

    def placed(self, palm_m: Sequence[float] | Array | None, in_hand: InHand | None = None, side: str = "right") -> Scene:
        """The scene with every object in world coordinates.

        ``palm`` objects are shifted by ``palm_m``, axes staying the world's so that a table stays level, and
        mirrored to the other side for a left hand. ``in_hand`` objects take the centre and radius of ``in_hand``, a
        cylinder across the ray from thumb to index, a box with its x edge along it. Without a place an object is left
        out and named in ``absent``.

        :param palm_m: the palm's position, (3,), metres; None: no hand.
        :param in_hand: where the tips meet an object; None: they do not.
        :param side: ``left`` or ``right``.
        :return: another scene; this one stays as it is.
        :raises InputError: an unknown side.
        """
        one_of("side", side, ("left", "right"))
        there: list[SceneObject] = []
        absent = list(self.absent)
        for item in self.objects:
            if item.resolved:
                there.append(item)
            elif item.placement == "palm" and palm_m is not None:
                there.append(place_by_palm(item, np.asarray(palm_m, float), mirror=side == "left"))
            elif item.placement == "in_hand" and in_hand is not None:
                there.append(size_in_hand(item, in_hand))
            else:
                reason = "no hand" if item.placement == "palm" else "the hand makes no closing stroke to place it by"
                absent.append((item.name, reason))
        return replace(self, objects=tuple(there), absent=tuple(absent))

    def placed_for(self, recording: HandRecording, side: str | None = None) -> Scene:
        """The scene placed for a recorded hand: by its median palm, and its first closing stroke.

        :param recording: of one or both hands.
        :param side: ``left`` or ``right``; None: the one with most frames.
        :return: another scene; this one stays as it is.
        :raises InputError: no recording, an unknown side, or a hand that the recording does not have.
        """
        an_instance("recording", recording, HandRecording, "from haptics.load_hand")
        side = recording.side_with_most_frames if side is None else side
        return self.placed(place_at_palm(recording, side=side, at="median").centre_m, place_in_hand(recording, side), side)

    def contact_tracker(self) -> ContactTracker:
        """Make a tracker of touches with this scene's objects.

        :return: with nothing touched.
        """
        return ContactTracker(self.effects)

    def pattern_bank(self) -> PatternBank:
        """Make the players of this scene's patterns.

        :return: with nothing playing.
        """
        return PatternBank(self.effects)

    def grasp_tracker(self, rule: str | None = None) -> GraspTracker:
        """Make a tracker of grasps among this scene's graspable objects.

        :param rule: ``rearming`` or ``thesis``; None: the scene's.
        :return: with nothing held.
        :raises InputError: an unknown rule.
        """
        bodies = {item.name: item.body for item in self.objects if item.grasp is not None}
        others = [item.name for item in self.objects if item.owner == "engine"]
        return GraspTracker(bodies, grasp_rule(rule or self.grasp_rule), others)

    def clutch_rules(self) -> ClutchRules:
        """Make this scene's clutch rules, ready to run.

        :return: with no clutch engaged.
        """
        return ClutchRules(self.rules)

    def body_signals(self) -> BodySignals:
        """Make the body's signals, from the scene's profiles until an engine supplies them.

        :return: with nothing supplied.
        """
        return BodySignals({signal.name: signal for signal in self.signals})

    @property
    def needs(self) -> SceneNeeds:
        """What this scene can ask for."""
        effects = [effect for item in self.objects for effect in item.effects]
        contacts = [effect for effect in effects if isinstance(effect, ContactEffect)]
        fixed = [effect for effect in effects if isinstance(effect, FixedSetEffect)]
        patterns = [effect for effect in effects if isinstance(effect, PatternEffect | ProximityEffect)]
        grasps = [effect for effect in effects if isinstance(effect, GraspEffect)]
        scales = [
            (effect.pattern, effect.rate_scale if isinstance(effect, PatternEffect) else max(effect.far_scale, effect.near_scale))
            for effect in patterns
        ]
        touch_rule = any(rule.kind == "on_contact" for rule in self.rules)
        whole_hand = bool(fixed or patterns or touch_rule)
        tips = {"thumb_tip", "index_tip"} if grasps else set()
        contact_sites = {site for effect in contacts for site in effect.sites or SITES}
        fingers = ("index", "thumb")
        return SceneNeeds(
            sites=SITES if whole_hand else _in_order(contact_sites | tips),
            pins=_in_order(contact_sites | {site for effect in fixed for site in effect.sites}),
            pulses=_in_order({site for effect in patterns for site in effect.sites or SITES}),
            patterns=tuple(sorted({pattern for pattern, _ in scales})),
            refresh_hz=max((REFRESH_HZ[pattern] * scale for pattern, scale in scales), default=0.0),
            brakes=fingers if any(effect.brakes for effect in grasps) else (),
            brake_v=max((effect.amplitude_v for effect in grasps if effect.brakes), default=0.0),
            piezos=fingers if any(effect.piezo and effect.piezo_s > 0.0 for effect in grasps) else (),
            clutches=tuple(name for name in _names(self.clutches) if any(name in rule.clutches for rule in self.rules)),
            signals=tuple(sorted({name for rule in self.rules for name in rule.signals})),
            shapes=tuple(sorted({type(item.body.shape).__name__ for item in self.objects})),
        )


def _check_known(rule: str, what: str, asked: Iterable[str], known: tuple[str, ...]) -> None:
    for name in asked:
        if name not in known:
            there = (", ".join(known) or "none") + nearest(name, known)
            raise InputError(f"rule {rule}: {what} {name!r} is not in the scene; it has: {there}")


def _in_order(sites: set[str]) -> tuple[str, ...]:
    return tuple(site for site in SITES if site in sites)


def _names(items: Iterable) -> tuple[str, ...]:
    return tuple(item.name for item in items)
