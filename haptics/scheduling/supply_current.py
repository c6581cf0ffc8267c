"""Who has the supply's current until when.

The current is a pool of *shares*, each free from a certain moment on. A unit takes shares that are free when it starts, as many
amperes as its coil draws, and gives them back at its end as one. Whole numbers of nanoamperes, so that shares add up exactly.
Where all coils draw the same, each share taken is one coil's and the pool is ``floor(limit / current)`` slots.
"""

from __future__ import annotations

NA_PER_A = 10**9
_ALWAYS_NS = -(1 << 62)


class SupplyCurrent:
    """The current of one supply, as it was given out.

    :param limit_a: what the supply may be asked for (A).
    """

    def __init__(self, limit_a: float):
        self.limit_na = round(limit_a * NA_PER_A)
        self._shares: list[tuple[int, int]] = [(_ALWAYS_NS, self.limit_na)]  # free from, nA; the earliest first

    def free_ns(self, current_na: int) -> int:
        """From when some current can be had.

        :param current_na: how much (nA), at most the limit.
        :return: earliest time (ns); far in the past if it was never given out.
        :raises ValueError: more than the limit.
        """
        for free_ns, share_na in self._shares:
            current_na -= share_na
            if current_na <= 0:
                return free_ns
        raise ValueError("more current than the supply has")  # such a request is denied when it is made

    def take(self, current_na: int, at_ns: int, until_ns: int) -> None:
        """Give current out for a span.

        The shares longest in use among those free go first: what has been idle stays good for earlier starts.

        :param current_na: how much (nA), at most the limit.
        :param at_ns: from when (ns), not before ``free_ns``.
        :param until_ns: until when (ns).
        """
        kept: list[tuple[int, int]] = []
        wanted_na = current_na
        for free_ns, share_na in reversed(self._shares):
            taken_na = min(share_na, wanted_na) if free_ns <= at_ns else 0
            wanted_na -= taken_na
            if share_na > taken_na:
                kept.append((free_ns, share_na - taken_na))
        kept.append((until_ns, current_na))
        kept.sort()
        self._shares = kept
