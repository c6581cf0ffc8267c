"""How long a request may have to wait for its start: bounds that hold whatever the load (``docs/explanation/schedule.md``).

The wait counts from the moment a request *may* start: it has been seen by ``step``, its earliest start has come, and its own
coil is free. From then on it waits only while at least ``n`` coils are on, hence

    wait <= blocker + floor(k / n) * unit

with ``n`` coils at once, counted at the worst coil's current; ``k`` the number of units that start before it, ``unit`` the
longest of those, and ``blocker`` the longest that anything given out earlier still lasts.
"""

from __future__ import annotations

import math

from haptics.scheduling.requests import CHANNELS
from haptics.units import in_range


def latency_bound_s(
    coils_at_once: int,
    *,
    channels: int = CHANNELS,
    unit_s: float = 0.010,
    blocker_s: float = 0.010,
    overtakes: int = 0,
) -> float:
    """``blocker + floor((channels - 1)(1 + overtakes) / n) * unit``, the longest wait from when a request may start.

    Each other channel starts at most ``1 + overtakes`` units before this one. ``overtakes`` is 0 for requests made at the same
    moment, one a channel, whatever their classes, and for every release, whatever the load; 1 for a contact where each coil's
    contacts and releases wait for each other; 2 for a contact where a release only follows something that was given out,
    however they mix: a release that waits, the contact after it, and its release. It is reached for 0, 1 and 2, so it
    cannot be lowered.

    45 ms for 3 coils, 10 ms units and 5 ms blockers:

    >>> round(latency_bound_s(3, unit_s=0.010, blocker_s=0.005), 6)
    0.045

    :param coils_at_once: ``n``, units that may run at the same time, at least 1.
    :param channels: of the array, this one included, at least 1.
    :param unit_s: longest unit that may go before (s), with the scheduler's gap added: 10 ms; for a burst the whole burst.
    :param blocker_s: longest unit that may be running (s; 5 ms if only bursts do, else 10 ms; the whole burst if the request is
        a burst), plus the gap, plus how far ahead ``step`` commits.
    :param overtakes: units of one other channel that may start before this request, beyond the first; see above.
    :return: longest wait (s).
    :raises InputError: a number outside its range.
    """
    n = in_range("coils_at_once", coils_at_once, 1, math.inf)
    others = in_range("channels", channels, 1, math.inf) - 1
    before = others * (1 + in_range("overtakes", overtakes, 0, math.inf))
    in_range("unit_s", unit_s, 0.0, math.inf, "s")
    in_range("blocker_s", blocker_s, 0.0, math.inf, "s")
    return blocker_s + math.floor(before / n) * unit_s


def sustained_latency_bound_s(
    coils_at_once: int,
    spacing_s: float,
    *,
    channels: int = CHANNELS,
    unit_s: float = 0.010,
    blocker_s: float = 0.010,
) -> float:
    """The bound for any class under steady load: each other channel makes at most one request every ``spacing_s``.

    Smallest ``w`` with ``w = blocker + floor((channels - 1)(q + 1 + floor(w / spacing)) / n) * unit``: ``q`` requests that were
    waiting already and ``1 + floor(w / spacing)`` new ones a channel. ``q`` is 1 if a release has played by the time at which
    the next request of its channel may start, ``spacing >= unit + latency_bound_s(...)``, else 2. Infinite where the others
    alone use up all slots, ``(channels - 1) unit >= n spacing``: then the most urgent starve the rest.

    95 ms for 3 coils and 15 channels, each with at most ten requests a second:

    >>> round(sustained_latency_bound_s(3, 0.1, blocker_s=0.005), 6)
    0.095

    :param coils_at_once: ``n``, units that may run at the same time, at least 1.
    :param spacing_s: smallest time between two earliest starts on one channel (s), above 0.
    :param channels: of the array, this one included, at least 1.
    :param unit_s: see ``latency_bound_s`` (s).
    :param blocker_s: see ``latency_bound_s`` (s).
    :return: longest wait (s), infinite where there is no bound.
    :raises InputError: a number outside its range.
    """
    in_range("spacing_s", spacing_s, 1e-9, math.inf, "s")
    in_range("coils_at_once", coils_at_once, 1, math.inf)
    in_range("channels", channels, 1, math.inf)
    if (channels - 1) * unit_s >= coils_at_once * spacing_s:
        return math.inf
    release_s = unit_s + latency_bound_s(coils_at_once, channels=channels, unit_s=unit_s, blocker_s=blocker_s)
    waiting = 1 if spacing_s >= release_s else 2
    wait_s = blocker_s
    while True:
        more = waiting + math.floor(wait_s / spacing_s)
        longer_s = latency_bound_s(coils_at_once, channels=channels, unit_s=unit_s, blocker_s=blocker_s, overtakes=more)
        if longer_s <= wait_s:
            return wait_s
        wait_s = longer_s
