"""What an object does to a hand: the effects a scene can attach to it, as plain data.

``contact`` and ``fixed_set`` are the contact mode (a pin comes out, rests on the skin, goes back); ``pattern`` and
``proximity`` are the pulse mode (thesis 3.4.5, 3.6.3); ``grasp`` closes the brakes and shakes the fingertips (thesis
4.6).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from haptics.errors import InputError
from haptics.scene.patterns import DIRECTIONS, PATTERNS, RATE_SCALES, PatternPlayer
from haptics.scene.sites import SITES
from haptics.units import in_range, one_of

PIEZO_BURST_S = 0.3
"""Length of the fingertip vibration at the beginning of a grasp (stated, thesis 4.6.1)."""
ENGAGE_V = 1000.0
"""Amplitude at which the glove's brakes engage (stated, thesis 4.5.2)."""
ENGAGE_HZ = 20.0
"""Frequency of that drive (stated, thesis 4.5.2)."""
_STRICT_FIELDS = {"extra": "forbid", "allow_inf_nan": False}  # for the scene file's parser


@dataclass(frozen=True)
class ContactEffect:
    """Each site that touches the object has its pin out while it does.

    :param sites: names of the only sites that do; None: any.
    :param kind: always ``contact``.
    :raises InputError: an unknown site, one named twice, or none.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    sites: tuple[str, ...] | None = None
    kind: Literal["contact"] = "contact"

    def __post_init__(self) -> None:
        _check_sites(self.sites)


@dataclass(frozen=True)
class FixedSetEffect:
    """The same set of pins comes out while any part of the hand touches the object.

    :param sites: names of the pins' sites, at least one.
    :param kind: always ``fixed_set``.
    :raises InputError: an unknown site, one named twice, or none.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    sites: tuple[str, ...]
    kind: Literal["fixed_set"] = "fixed_set"

    def __post_init__(self) -> None:
        _check_sites(self.sites)


@dataclass(frozen=True)
class PatternEffect:
    """A spatial pattern plays at its own pace from the first touch.

    :param pattern: one of ``PATTERNS``.
    :param direction: ``forward`` or ``reverse``.
    :param rate_scale: multiplies the pattern's refresh rate, 0.1 to 10.
    :param lasts: ``contact``: until the last site leaves; ``stimulus``: for ``duration_s`` from each touch.
    :param duration_s: of a stimulus, 0.01 to 3600 s (1 s in the study).
    :param sites: names of the only sites that pulse; None: all fifteen.
    :param kind: always ``pattern``.
    :raises InputError: a value out of its range, or an unknown name.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    pattern: str
    direction: str = "forward"
    rate_scale: float = 1.0
    lasts: Literal["contact", "stimulus"] = "contact"
    duration_s: float = 1.0
    sites: tuple[str, ...] | None = None
    kind: Literal["pattern"] = "pattern"

    def __post_init__(self) -> None:
        one_of("pattern", self.pattern, PATTERNS)
        one_of("direction", self.direction, DIRECTIONS)
        in_range("rate_scale", self.rate_scale, *RATE_SCALES)
        in_range("duration_s", self.duration_s, 0.01, 3600.0, "s")
        _check_sites(self.sites)

    def player(self) -> PatternPlayer:
        """A player of this effect.

        :return: not yet started.
        """
        duration_s = self.duration_s if self.lasts == "stimulus" else None
        return PatternPlayer(
            self.pattern, direction=self.direction, rate_scale=self.rate_scale, duration_s=duration_s, sites=self.sites
        )


@dataclass(frozen=True)
class ProximityEffect:
    """A spatial pattern in mid-air whose rate grows as the hand comes near (the fan).

    Rate scale ``near + (far − near)·d/range`` for the distance d of the hand's nearest site, clamped below at d = 0;
    silent beyond ``range_m``. Once playing, it falls silent only ``hysteresis_m`` farther out, so that a hovering
    hand does not restart it.

    :param pattern: one of ``PATTERNS``.
    :param range_m: silent beyond this distance, 0.01 to 2 m.
    :param direction: ``forward`` or ``reverse``.
    :param far_scale: rate scale at ``range_m``, 0.1 to 10.
    :param near_scale: rate scale at the object, 0.1 to 10.
    :param hysteresis_m: 0 to 0.1 m.
    :param sites: names of the only sites that pulse; None: all fifteen.
    :param kind: always ``proximity``.
    :raises InputError: a value out of its range, or an unknown name.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    pattern: str
    range_m: float
    direction: str = "forward"
    far_scale: float = 1.0
    near_scale: float = 2.0
    hysteresis_m: float = 0.01
    sites: tuple[str, ...] | None = None
    kind: Literal["proximity"] = "proximity"

    def __post_init__(self) -> None:
        one_of("pattern", self.pattern, PATTERNS)
        one_of("direction", self.direction, DIRECTIONS)
        in_range("range_m", self.range_m, 0.01, 2.0, "m")
        in_range("far_scale", self.far_scale, *RATE_SCALES)
        in_range("near_scale", self.near_scale, *RATE_SCALES)
        in_range("hysteresis_m", self.hysteresis_m, 0.0, 0.1, "m")
        _check_sites(self.sites)

    def rate_scale(self, distance_m: float, playing: bool = False) -> float | None:
        """The rate scale at a distance.

        :param distance_m: of the hand's nearest site, metres; negative inside.
        :param playing: whether the pattern plays already, so that the hysteresis counts.
        :return: or None where the effect is silent, also for a distance that is not a number.
        """
        reach_m = self.range_m + (self.hysteresis_m if playing else 0.0)
        if math.isnan(distance_m) or distance_m > reach_m:
            return None
        near = min(max(distance_m / self.range_m, 0.0), 1.0)
        return self.near_scale + (self.far_scale - self.near_scale) * near

    def player(self) -> PatternPlayer:
        """A player of this effect at its far rate.

        :return: not yet started.
        """
        return PatternPlayer(self.pattern, direction=self.direction, rate_scale=self.far_scale, sites=self.sites)


@dataclass(frozen=True)
class GraspEffect:
    """The object can be grasped: both brakes hold from the beginning to the end, the piezos shake once at the beginning.

    ``brakes`` and ``piezo`` together give the study's four conditions: visual, piezo, brake, both (thesis 4.8.2.3).

    :param brakes: whether the brakes hold.
    :param piezo: whether the piezos shake.
    :param amplitude_v: of the brakes' drive, 0 to 1500 V (1000 V stated, thesis 4.5.2).
    :param frequency_hz: of the brakes' drive, 1 to 1000 Hz (20 Hz stated, thesis 4.5.2).
    :param piezo_s: length of the vibration, 0 to 5 s (0.3 s stated, thesis 4.6.1).
    :param kind: always ``grasp``.
    :raises InputError: a number out of its range.
    """

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    brakes: bool = True
    piezo: bool = True
    amplitude_v: float = ENGAGE_V
    frequency_hz: float = ENGAGE_HZ
    piezo_s: float = PIEZO_BURST_S
    kind: Literal["grasp"] = "grasp"

    def __post_init__(self) -> None:
        in_range("amplitude_v", self.amplitude_v, 0.0, 1500.0, "V")
        in_range("frequency_hz", self.frequency_hz, 1.0, 1000.0, "Hz")
        in_range("piezo_s", self.piezo_s, 0.0, 5.0, "s")


Effect = ContactEffect | FixedSetEffect | PatternEffect | ProximityEffect | GraspEffect


class PatternBank:
    """The pattern players of a scene: informed of touches and distances, it hands out the pulses of all of them.

    :param effects: the effects of each object, by its name.
    """

    def __init__(self, effects: dict[str, tuple[Effect, ...]]):
        self._touched: dict[str, list[PatternPlayer]] = {}
        self._lasting: dict[str, list[PatternPlayer]] = {}
        self._near: dict[str, list[tuple[ProximityEffect, PatternPlayer]]] = {}
        for name, of_object in effects.items():
            for effect in of_object:
                if isinstance(effect, PatternEffect):
                    player = effect.player()
                    self._touched.setdefault(name, []).append(player)
                    if effect.lasts == "contact":
                        self._lasting.setdefault(name, []).append(player)
                elif isinstance(effect, ProximityEffect):
                    self._near.setdefault(name, []).append((effect, effect.player()))
        self._list_players()

    def _list_players(self) -> None:
        self._players = [(name, player) for name, players in self._touched.items() for player in players]
        self._players += [(name, player) for name, pairs in self._near.items() for _, player in pairs]

    def adopt(self, other: PatternBank, names: Collection[str]) -> None:
        """Take over from another bank the players of some objects, whose effects are the same in both, as they play.

        :param other: not used any more.
        :param names: objects of both.
        """
        for mine, its in ((self._touched, other._touched), (self._lasting, other._lasting), (self._near, other._near)):
            mine.update({name: its[name] for name in names if name in its})  # type: ignore[attr-defined]
        self._list_players()

    @property
    def watched(self) -> tuple[str, ...]:
        """Objects whose distance ``approach`` must be given."""
        return tuple(self._near)

    @property
    def playing(self) -> tuple[str, ...]:
        """Objects with a pattern that plays now."""
        return tuple(name for name, player in self._players if player.playing)

    def touch(self, name: str, now_ns: int) -> None:
        """Take note that the hand began to touch an object; a stimulus that still plays is left to finish.

        :param name: the object's; one without patterns changes nothing.
        :param now_ns: when it did.
        """
        for player in self._touched.get(name, ()):
            if not player.playing:
                player.start(now_ns)

    def leave(self, name: str) -> None:
        """Take note that the last site left an object.

        :param name: the object's; one without patterns changes nothing.
        """
        for player in self._lasting.get(name, ()):
            player.stop()

    def approach(self, name: str, distance_m: float, now_ns: int) -> None:
        """Start, stop or pace the patterns of an object by its distance.

        :param name: the object's; one without proximity effects changes nothing.
        :param distance_m: of the hand's nearest site, metres; negative inside.
        :param now_ns: when it was measured.
        """
        for effect, player in self._near.get(name, ()):
            scale = effect.rate_scale(distance_m, player.playing)
            if scale is None:
                player.stop()
                continue
            if not player.playing:
                player.start(now_ns)
            player.set_rate_scale(scale, now_ns)

    def due(self, now_ns: int, until_ns: int) -> list[tuple[int, int, str]]:
        """Hand out the pulses with ``now_ns <= time < until_ns`` that were not handed out before.

        :param now_ns: pulses due earlier are dropped; ``take_missed`` has them.
        :param until_ns: end of the window, itself excluded.
        :return: (time_ns, site index, object), in order of time.
        """
        playing = [(name, player) for name, player in self._players if player.playing]
        if not playing:
            return []
        return sorted((time_ns, site, name) for name, player in playing for time_ns, site in player.due(now_ns, until_ns))

    def take_missed(self) -> list[int]:
        """Hand out what was dropped since the last call.

        :return: site indices of pulses that nobody asked for in time.
        """
        return [site for _, player in self._players for site in player.take_missed()]

    def stop(self) -> None:
        """Silence everything."""
        for _, player in self._players:
            player.stop()


def _check_sites(sites: Sequence[str] | None) -> None:
    if sites is None:
        return
    if not sites or len(set(sites)) != len(sites):
        raise InputError(f"sites = {list(sites)}; expected at least one site, each once, of {', '.join(SITES)}")
    for site in sites:
        one_of("site", site, SITES)
