"""What an object does to a hand: the effects a scene can attach to it, as plain data.

``contact`` and ``fixed_set`` are the contact mode (a pin comes out, rests on the skin, goes back); ``pattern`` and
``proximity`` are the pulse mode (thesis 3.4.5, 3.6.3); ``grasp`` closes the brakes and shakes the fingertips (thesis
4.6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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
    """Each site that touches the object has its pin out while it does. ``sites``: only these; none named means any."""

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    sites: tuple[str, ...] | None = None
    kind: Literal["contact"] = "contact"

    def __post_init__(self) -> None:
        _check_sites(self.sites)


@dataclass(frozen=True)
class FixedSetEffect:
    """The same set of pins comes out while any part of the hand touches the object."""

    __pydantic_config__: ClassVar[dict] = _STRICT_FIELDS
    sites: tuple[str, ...]
    kind: Literal["fixed_set"] = "fixed_set"

    def __post_init__(self) -> None:
        _check_sites(self.sites)


@dataclass(frozen=True)
class PatternEffect:
    """A spatial pattern plays at its own pace from the first touch.

    ``lasts`` ``"contact"``: until the last site leaves; ``"stimulus"``: for ``duration_s`` (1 s in the study), once a touch.
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
        """A player of this effect, not yet started."""
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
        """The rate scale at a distance, or ``None`` where the effect is silent (also for a distance that is not a number)."""
        reach_m = self.range_m + (self.hysteresis_m if playing else 0.0)
        if math.isnan(distance_m) or distance_m > reach_m:
            return None
        near = min(max(distance_m / self.range_m, 0.0), 1.0)
        return self.near_scale + (self.far_scale - self.near_scale) * near

    def player(self) -> PatternPlayer:
        """A player of this effect, not yet started."""
        return PatternPlayer(self.pattern, direction=self.direction, rate_scale=self.far_scale, sites=self.sites)


@dataclass(frozen=True)
class GraspEffect:
    """The object can be grasped: both brakes hold from the beginning to the end, the piezos shake once at the beginning.

    ``brakes`` and ``piezo`` together give the study's four conditions: visual, piezo, brake, both (thesis 4.8.2.3).
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
    """The pattern players of a scene: told of touches and distances, it hands out the pulses of all of them.

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
        self._players = [(name, player) for name, players in self._touched.items() for player in players]
        self._players += [(name, player) for name, pairs in self._near.items() for _, player in pairs]

    @property
    def watched(self) -> tuple[str, ...]:
        """Objects whose distance must be told by ``approach``."""
        return tuple(self._near)

    @property
    def playing(self) -> tuple[str, ...]:
        """Objects with a pattern under way."""
        return tuple(name for name, player in self._players if player.playing)

    def touch(self, name: str, now_ns: int) -> None:
        """The hand began to touch the object; one stimulus under way is left to finish."""
        for player in self._touched.get(name, ()):
            if not player.playing:
                player.start(now_ns)

    def leave(self, name: str) -> None:
        """The last site left the object."""
        for player in self._lasting.get(name, ()):
            player.stop()

    def approach(self, name: str, distance_m: float, now_ns: int) -> None:
        """The hand's nearest site is ``distance_m`` from the object."""
        for effect, player in self._near.get(name, ()):
            scale = effect.rate_scale(distance_m, player.playing)
            if scale is None:
                player.stop()
                continue
            if not player.playing:
                player.start(now_ns)
            player.set_rate_scale(scale, now_ns)

    def due(self, now_ns: int, until_ns: int) -> list[tuple[int, int, str]]:
        """Pulses with ``now_ns <= time < until_ns`` not handed out before: (time_ns, site index, object), in order of time."""
        playing = [(name, player) for name, player in self._players if player.playing]
        return sorted((time_ns, site, name) for name, player in playing for time_ns, site in player.due(now_ns, until_ns))

    def take_missed(self) -> list[int]:
        """Site indices of pulses that nobody asked for in time, since the last call."""
        return [site for _, player in self._players for site in player.take_missed()]

    def stop(self) -> None:
        """Silence everything."""
        for _, player in self._players:
            player.stop()


def _check_sites(sites: Sequence[str] | None) -> None:
    if sites is None:
        return
    if not sites or len(set(sites)) != len(sites):
        raise InputError(f"sites = {list(sites)} is not allowed; allowed: at least one site, each once, of {', '.join(SITES)}")
    for site in sites:
        one_of("site", site, SITES)
