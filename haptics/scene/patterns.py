"""Spatial haptic patterns: lines, rings and sets of dots that travel through the hand as pulses (thesis 3.6.2).

A pattern refreshes at a fixed rate: 5, 5, 4 and 10 times in its reference of one second. In every refresh each line,
ring or set of dots passes once through the hand, and a site pulses when it is met. Playback keeps its own pace,
whatever the hand does.

What the thesis shows only as a drawing (Fig 3.7) is assumed here, and named: where the sites lie on a flat hand,
which end of the hand is met first, the share of a refresh that the passage takes, and how many dots are in a set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from haptics.scene.sites import SITE, SITES
from haptics.time import NS_PER_S
from haptics.units import in_range, one_of

REFERENCE_S = 1.0
"""Length of a reference stimulus (stated, thesis 3.6.2.2)."""
REFRESH_HZ = {"line_forward": 5.0, "line_sideways": 5.0, "radial": 4.0, "particle": 10.0}
"""Refreshes a second of each reference pattern (stated, thesis 3.6.2.2)."""
PATTERNS: tuple[str, ...] = tuple(REFRESH_HZ)
DIRECTIONS = ("forward", "reverse")
SWEEP_SHARE = 0.8
"""Share of a refresh in which the feature crosses the hand; the rest is the gap to the next one (assumed)."""
DOTS = 3
"""Dots in a set of the particle pattern (assumed): five sets visit all fifteen sites once."""
PARTICLE_SEED = 3
"""Seed of the particle pattern's shuffles, so that every playback is the same (assumed)."""
RATE_SCALES = (0.1, 10.0)

# Flat right hand, palm down, millimetres from the palm's centre: (to the right, toward the little finger; to the fingers).
# Assumed: a hand 190 mm long and 85 mm broad, thumb half abducted; only the order and the proportions matter.
_FLAT_HAND_MM = {
    "thumb_tip": (-78, 45),
    "index_tip": (-25, 115),
    "middle_tip": (-2, 125),
    "ring_tip": (20, 117),
    "little_tip": (42, 93),
    "thumb_phalanx": (-62, 18),
    "index_phalanx": (-25, 72),
    "middle_phalanx": (-2, 78),
    "ring_phalanx": (19, 72),
    "palm_thumb": (-42, -5),
    "palm_index": (-24, 32),
    "palm_middle": (-3, 35),
    "palm_ring": (17, 31),
    "palm_little": (36, 22),
    "palm_outer": (-28, -38),
}
FLAT_HAND_M = np.array([_FLAT_HAND_MM[site] for site in SITES]) / 1000.0
"""The nominal layout, (15, 2), metres: across (thumb side negative) and along the hand, in the order of ``SITES``. A
left hand is its mirror image; as the patterns run from one anatomical side to the other, the same numbers serve both.
"""


@dataclass(frozen=True)
class Pulse:
    """One pulse of a refresh.

    :param phase: when, as a share of the refresh, in [0, 1).
    :param site: 0 to 14, the place in ``SITES``.
    """

    phase: float
    site: int


def refresh_pulses(pattern: str, refresh: int = 0, direction: str = "forward") -> tuple[Pulse, ...]:
    """The pulses of one passage through the hand. The same arguments give the same pulses.

    ``line_forward``: the hand moves forward over a ridge, so the fingertips are met first and the heel of the hand last.
    ``line_sideways``: from the little finger's side to the thumb's. ``radial``: rings grow from the palm's centre.
    ``particle``: three dots cross from the little finger's side to the thumb's, each meeting one site; five refreshes
    visit every site once, in shuffled sets. ``reverse`` runs each of them backwards.

    :param pattern: one of ``PATTERNS``.
    :param refresh: number of the passage, from 0; only ``particle`` differs from one to the next.
    :param direction: ``forward`` or ``reverse``.
    :return: in order of time.
    :raises InputError: no such pattern or direction, or a refresh below 0.
    """
    one_of("pattern", pattern, PATTERNS)
    one_of("direction", direction, DIRECTIONS)
    in_range("refresh", refresh, 0, math.inf)
    cycle = refresh if pattern == "particle" else 0
    return _refresh_pulses(pattern, cycle, direction)


@lru_cache(maxsize=256)
def _refresh_pulses(pattern: str, refresh: int, direction: str) -> tuple[Pulse, ...]:
    across, along = FLAT_HAND_M.T
    met_at = {"line_forward": -along, "line_sideways": -across, "radial": np.hypot(across, along), "particle": -across}[pattern]
    if direction == "reverse":
        met_at = -met_at
    phase = SWEEP_SHARE * (met_at - met_at.min()) / np.ptp(met_at)
    sites = _dots(refresh) if pattern == "particle" else range(len(SITES))
    return tuple(sorted((Pulse(float(phase[site]), int(site)) for site in sites), key=lambda pulse: (pulse.phase, pulse.site)))


def _dots(refresh: int) -> Sequence[int]:
    sets = len(SITES) // DOTS
    cycle, place = divmod(refresh, sets)
    shuffled = np.random.default_rng([PARTICLE_SEED, cycle]).permutation(len(SITES))
    return shuffled[place * DOTS : (place + 1) * DOTS].tolist()


def stimulus(
    pattern: str, duration_s: float = REFERENCE_S, rate_scale: float = 1.0, direction: str = "forward"
) -> list[tuple[float, str]]:
    """The whole stimulus.

    :param pattern: one of ``PATTERNS``.
    :param duration_s: 0 to 3600 s.
    :param rate_scale: 0.1 to 10, multiplies the pattern's refresh rate.
    :param direction: ``forward`` or ``reverse``.
    :return: (seconds from its start, site's name), in order of time.
    :raises InputError: an argument out of its range.
    """
    in_range("duration_s", duration_s, 0.0, 3600.0, "s")
    player = PatternPlayer(pattern, direction=direction, rate_scale=rate_scale, duration_s=duration_s)
    player.start(0)
    return [(time_ns / NS_PER_S, SITES[site]) for time_ns, site in player.due(0, round(duration_s * NS_PER_S))]


class PatternPlayer:
    """Plays one pattern from a start until it is stopped, handing out each pulse once, in order of time.

    :param pattern: one of ``PATTERNS``.
    :param direction: one of ``DIRECTIONS``.
    :param rate_scale: 0.1 to 10, multiplies the refresh rate and with it the speed of the passage.
    :param duration_s: ends by itself after so long, 0 to 3600 s (the reference lasts 1 s); ``None`` goes on until stopped.
    :param sites: pulse only these, names of ``SITES``; ``None`` is all fifteen.
    :raises InputError: an unknown pattern, direction or site, or a number out of its range.
    """

    def __init__(
        self,
        pattern: str,
        *,
        direction: str = "forward",
        rate_scale: float = 1.0,
        duration_s: float | None = None,
        sites: Sequence[str] | None = None,
    ):
        refresh_pulses(pattern, 0, direction)  # refuses what is not allowed
        if sites is not None:
            for site in sites:
                one_of("site", site, SITES)
        self.pattern, self.direction = pattern, direction
        self._scale = _checked_scale(rate_scale)
        self._duration_ns = None if duration_s is None else round(in_range("duration_s", duration_s, 0.0, 3600.0, "s") * NS_PER_S)
        self._sites = None if sites is None else {SITE[site] for site in sites}
        self._playing = False
        self._end_ns: int | None = None
        self._anchor_ns, self._anchor_phase = 0, 0.0  # at this time the playback was at this phase, counted in refreshes
        self._refresh, self._index = 0, 0  # the next pulse to hand out
        self._missed: list[int] = []

    @property
    def playing(self) -> bool:
        """True from ``start`` until ``stop``, or until ``due`` was asked for pulses up to the end of ``duration_s``."""
        return self._playing

    @property
    def rate_scale(self) -> float:
        """What multiplies the pattern's refresh rate at present."""
        return self._scale

    @property
    def refresh_hz(self) -> float:
        """Refreshes a second at the present scale, Hz."""
        return REFRESH_HZ[self.pattern] * self._scale

    def start(self, now_ns: int) -> None:
        """Begin a playback; one that still plays begins again.

        :param now_ns: when the first refresh begins, ns.
        """
        self._playing = True
        self._end_ns = None if self._duration_ns is None else now_ns + self._duration_ns
        self._anchor_ns, self._anchor_phase = now_ns, 0.0
        self._refresh, self._index = 0, 0

    def stop(self) -> None:
        """No further pulses until the next start."""
        self._playing = False

    def set_rate_scale(self, scale: float, now_ns: int) -> None:
        """Go on at another rate without a jump in the pattern: no pulse is lost or repeated.

        :param scale: 0.1 to 10.
        :param now_ns: from when on.
        :raises InputError: ``scale`` outside 0.1 to 10.
        """
        scale = _checked_scale(scale)
        if scale == self._scale:
            return
        if now_ns > self._anchor_ns:
            self._anchor_phase += (now_ns - self._anchor_ns) * self.refresh_hz / NS_PER_S
            self._anchor_ns = now_ns
        self._scale = scale

    def due(self, now_ns: int, until_ns: int) -> list[tuple[int, int]]:
        """Hand out the pulses with ``now_ns <= time < until_ns`` that were not handed out before.

        Pulses that fell due before ``now_ns`` and were never asked for are dropped, as a late pulse would distort the pattern;
        ``take_missed`` has them.

        :param now_ns: beginning of the window.
        :param until_ns: end of the window, itself excluded.
        :return: (time_ns, site index), in order of time.
        """
        found: list[tuple[int, int]] = []
        while self._playing:
            pulses = _refresh_pulses(self.pattern, self._refresh if self.pattern == "particle" else 0, self.direction)
            pulse = pulses[self._index]
            ahead = self._refresh + pulse.phase - self._anchor_phase
            time_ns = self._anchor_ns + round(ahead / self.refresh_hz * NS_PER_S)
            if self._end_ns is not None and time_ns >= self._end_ns:
                self._playing = until_ns < self._end_ns
                break
            if time_ns >= until_ns:
                break
            self._index += 1
            if self._index == len(pulses):
                self._refresh, self._index = self._refresh + 1, 0
            if self._sites is None or pulse.site in self._sites:
                if time_ns >= now_ns:
                    found.append((time_ns, pulse.site))
                else:
                    self._missed.append(pulse.site)
        return found

    def take_missed(self) -> list[int]:
        """Hand out what was dropped since the last call.

        :return: site indices of the pulses.
        """
        missed, self._missed = self._missed, []
        return missed


def _checked_scale(scale: float) -> float:
    return in_range("rate_scale", scale, *RATE_SCALES)
