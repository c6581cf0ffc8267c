"""What a person, or a bench, would notice of a model's error, and from where on.

A row names an observable, the threshold at which a difference is noticed, and the tolerance that a plan allows of it: a third
of the threshold where that is a just-noticeable difference, less where several errors add up. ``tolerance_jnd`` scales all of
them together; a third is the default.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.physics.brake.force_laws import default_law
from haptics.physics.parameters import Provenance
from haptics.units import in_range, one_of

DEFAULT_TOLERANCE_JND = 1.0 / 3.0


@dataclass(frozen=True, slots=True)
class Notice:
    """One observable, and from where on an error of it is noticed.

    :param observable: name of it.
    :param unit: of threshold and tolerance.
    :param threshold: difference that is just noticed.
    :param tolerance: error that a plan allows at the default fraction.
    :param provenance: how the threshold is known.
    :param source: thesis section, or what was assumed.
    """

    observable: str
    unit: str
    threshold: float
    tolerance: float
    provenance: Provenance
    source: str

    def limit(self, tolerance_jnd: float) -> float:
        """What a plan allows at a fraction of the just-noticeable difference.

        :param tolerance_jnd: fraction of the just-noticeable difference.
        :return: error allowed, in ``unit``.
        """
        return self.tolerance * tolerance_jnd / DEFAULT_TOLERANCE_JND


NOTICES = {
    row.observable: row
    for row in (
        Notice("wrong final state", "share", 0.0, 0.0, "assumed", "a touch that should be there and is not"),
        Notice(
            "arrival time", "ms", 15.0, 1.0, "assumed", "window of onset (Di Luca and Mahnan 2019); the loop's own error adds up"
        ),
        Notice("impact speed", "%", 10.0, 10.0 / 3.0, "assumed", "strength of a pulse"),
        Notice("energy", "%", 10.0, 10.0 / 3.0, "assumed", "strength of a pulse"),
        Notice("temperature", "K", 1.0, 0.5, "assumed", "warmth"),
        Notice("coil temperature", "K", 10.0, 10.0 / 3.0, "assumed", "insulation, not skin: nobody feels the coil itself"),
        Notice("response time", "ms", 100.0, 5.0, "stated", "thesis 4.7.3"),
        Notice("release time", "ms", 100.0, 5.0, "stated", "thesis 4.7.3"),
        Notice(
            "ripple",
            "%",
            10.0,
            10.0 / 3.0,
            "assumed",
            "of the plateau: 20 Hz is felt (4.10), from about the smallest force step on",
        ),
        Notice("supply power", "%", 10.0, 10.0 / 3.0, "assumed", "a bench's supply reading"),
    )
}
"""By observable. The force of a brake and the rate of a pattern depend on the scene: ``force_notice``, ``rate_notice``."""

JND_PERCENT_OF_VOLTS = {
    "index": {200.0: 20.6, 400.0: 5.6, 800.0: 7.8},
    "thumb": {200.0: 15.2, 400.0: 4.6, 800.0: 10.1},
}
"""Just-noticeable difference of blocking force, stepped in volts (thesis Table 4.2)."""
JND_PERCENT_OF_RATE = {"line_forward": 6.2, "line_sideways": 6.0, "radial": 3.2, "particle": 8.7}
"""Just-noticeable difference of a pattern's rate (thesis 3.6.2)."""


def force_notice(finger: str, amplitude_v: float) -> Notice:
    """Blocking force at an amplitude: the nearest published difference, from volts to force by the law's slope there.

    :param finger: index or thumb.
    :param amplitude_v: of the brake (V), 0 to 1500.
    :return: for observable ``plateau``, in %.
    :raises InputError: a finger without published differences, or an amplitude outside 0 to 1500 V.
    """
    published = JND_PERCENT_OF_VOLTS[one_of("finger", finger, tuple(JND_PERCENT_OF_VOLTS))]
    in_range("amplitude_v", amplitude_v, 0.0, 1500.0, "V")
    nearest_v = min(published, key=lambda volts: abs(volts - amplitude_v))
    law = default_law(finger)
    at_v = max(amplitude_v, 200.0)  # below the smallest published step there is next to no force to compare
    # The thumb's forces are published up to 800 V; its slope is taken from the law beyond them too.
    below_n, at_n, above_n = (law.force_n(share * at_v, extrapolate=True) for share in (0.99, 1.0, 1.01))
    slope = (above_n - below_n) / (0.02 * at_n)
    jnd = published[nearest_v] * slope
    return Notice(
        "plateau", "%", jnd, jnd / 3.0, "stated", f"thesis Table 4.2, {finger}, {nearest_v:g} V, by the law's slope {slope:.2f}"
    )


def rate_notice(pattern: str) -> Notice:
    """Rate of a spatial pattern.

    :param pattern: line_forward, line_sideways, radial or particle.
    :return: for observable ``rate``, in %.
    :raises InputError: an unknown pattern.
    """
    jnd = JND_PERCENT_OF_RATE[one_of("pattern", pattern, tuple(JND_PERCENT_OF_RATE))]
    return Notice("rate", "%", jnd, jnd / 3.0, "stated", f"thesis 3.6.2, {pattern}")
