"""What came of a trial: counts of commands and effects, and which promises were broken, in words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantiles:
    """Of a set of times (µs).

    :param p50: the median.
    :param p99: exceeded by one in a hundred.
    :param max: the largest.
    """

    p50: float
    p99: float
    max: float


def quantiles_us(values_ns: list[int]) -> Quantiles | None:
    """Quantiles (nearest rank) of magnitudes.

    :param values_ns: times of either sign (ns).
    :return: in microseconds; None of an empty list.
    """
    ordered = sorted(abs(value) for value in values_ns)
    if not ordered:
        return None
    ranks = (len(ordered) - 1) // 2, (99 * len(ordered) - 1) // 100, len(ordered) - 1
    return Quantiles(*(ordered[rank] / 1000 for rank in ranks))


@dataclass(frozen=True, slots=True)
class StressReport:
    """Counts of a trial. ``sent = acknowledged + refused + unknown_outcomes``.

    None stands where this port cannot show it: the edges, and what is on in silence.

    :param port: its URL or path.
    :param seed: of the commands and faults.
    :param faults: as given, or as the port's URL names them.
    :param sent: commands.
    :param acknowledged: commands that the board accepted.
    :param refused: by the board with a reply, or by the host before sending.
    :param unknown_outcomes: given up without a reply.
    :param late: refused because their time had passed.
    :param min_margin_ms: the shortest time that an acknowledged command lay ahead when the board dealt with it (ms); None if
        there was none.
    :param retried: repetitions.
    :param pulses: outputs that acknowledged commands put on.
    :param lost: acknowledged, and never played though nothing disarmed the board.
    :param duplicate_effects: outputs that one command put on twice.
    :param played_late: starts more than 100 us after their time.
    :param played_early: starts more than 100 us before it.
    :param played_uncommanded: starts that no command explains.
    :param played_too_long: outputs that went off more than 200 us after their time.
    :param played_too_short: outputs that went off more than 200 us before it.
    :param disarmed: how often the board disarmed itself and was armed again.
    :param disarmed_because: its reason, each time.
    :param max_energised_after_silence_ms: from the last byte that reached the board until its outputs are off for good (ms).
    :param silence_limit_ms: the dead-man time, 1 ms to notice, and 5 ms for a brake to discharge (ms).
    :param edge_error_us: magnitude of edge against commanded tick, on the board's own clock.
    :param lasted_s: how long the commands took (s of the runner's clock).
    :param ended: why the link ended early, or None.
    :param violations: promises of the protocol that were broken, in words.
    """

    port: str
    seed: int
    faults: str
    sent: int
    acknowledged: int
    refused: int
    unknown_outcomes: int
    late: int
    min_margin_ms: float | None
    retried: int
    pulses: int
    lost: int | None
    duplicate_effects: int
    played_late: int | None
    played_early: int | None
    played_uncommanded: int | None
    played_too_long: int | None
    played_too_short: int | None
    disarmed: int
    disarmed_because: list[str]
    max_energised_after_silence_ms: float | None
    silence_limit_ms: float
    edge_error_us: Quantiles | None
    lasted_s: float
    ended: str | None
    violations: list[str]
