"""Heat that outlives hosts: what a board's account holds of the time before, taken over when a glove is armed.

A board keeps on-time accounts (telemetry ``heat``) through hosts that come and go, and through resets; where it cannot know, it
starts them at its limit. A host that begins takes them over as the maximum that may be behind them (``CoilHeat.rise_k``).
"""

from __future__ import annotations

from collections.abc import Sequence

from haptics.link.messages import HEAT_UNIT_MS
from haptics.physics.thermal.one_node import PULSE_S
from haptics.scheduling import CoilHeat, ThermalBudget

WORTH_A_WORD = 0.1
"""A warm start by less than this share of the limit is taken over without a word: a board that was without power since it was
last used starts its accounts at 100 ms (2 K)."""


def take_over(
    budgets: Sequence[ThermalBudget], coils: Sequence[CoilHeat], account: Sequence[int], now_ns: int, booked: bool
) -> str | None:
    """Raise each budget to what the board's account holds, where that is more than this host knows of.

    :param budgets: of this host, by channel; changed in place.
    :param coils: what each account goes by, by channel.
    :param account: telemetry's ``heat``, a count of ``HEAT_UNIT_MS``, rounded up, for each channel.
    :param now_ns: ns on the glove's clock.
    :param booked: since this host last armed nothing has happened that it did not ask for, so that what the account is above its
        own by less than the rounding is the rounding.
    :return: a note for people where coils start warm, else None.
    """
    warm: list[tuple[float, float]] = []
    unit_s = HEAT_UNIT_MS / 1000
    for budget, coil, count in zip(budgets, coils, account, strict=False):
        known_k = budget.rise_k(max(now_ns, budget.latest_ns))
        for_sure = count - 1 if booked else count
        if count and for_sure * unit_s * coil.jump_k_per_s >= known_k:
            budget.raise_to(coil.rise_k(count * unit_s), budget.latest_ns)
            rise_k = budget.rise_k(budget.latest_ns)
            if rise_k - known_k >= WORTH_A_WORD * budget.limit_k:
                warm.append((rise_k, budget.wait_s(2, budget.latest_ns, coil.power_w * PULSE_S)))
    if not warm:
        return None
    hottest_k, wait_s = max(warm)
    until = f": denied until cooled, up to {wait_s:.0f} s" if wait_s else ": there is room for less than usual"
    coils_start = "coil starts" if len(warm) == 1 else "coils start"
    return f"tactiles: {len(warm)} {coils_start} warm (up to {hottest_k:.0f} K, from the board's account){until}"
