"""How long each coil was on of late, as the coil board's firmware keeps it: a limit that no host can lift.

``a' = u - a / tau`` (s), ``u`` 1 while the coil is on, ``tau`` that of the nominal tactor (thesis 3.5.2). A pulse counts from
its begin, and whole; one that waits in the queue is counted beside the account, and so is gone with the queue.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from haptics.link.messages import COIL_CHANNELS, HEAT_UNIT_MS
from haptics.physics.thermal.one_node import THERMAL
from haptics.time import NS_PER_S

WARM_S = 0.1
"""That an account has been above this is noted where a loss of power leaves it."""
COOLED_S = 0.05
"""The note is taken back when all are below this: far enough from the other that an EEPROM lasts."""
_ROUNDING_S = 1e-9


class CoilHeat:
    """Accounts of all coils, in seconds of on-time; a new board is cold.

    :param now_ns: world time of power-on, ns.
    """

    def __init__(self, now_ns: int):
        self._accounts_s = [0.0] * COIL_CHANNELS
        self._at_ns = now_ns
        self._used = self._warm = False

    def begin(self, channel: int, on_s: float, now_ns: int) -> None:
        """A pulse begins, and counts whole.

        :param channel: coil, 0 to 14.
        :param on_s: its length, s.
        :param now_ns: world time, ns.
        """
        self._cool(now_ns)
        self._accounts_s[channel] += on_s

    def hot(self, wanted_s: Sequence[float], waiting_s: Sequence[float], limit_s: float, now_ns: int) -> int:
        """Coils for which what is wanted is too much; a coil for which nothing is wanted is not hot.

        :param wanted_s: on-time asked for, s (15,).
        :param waiting_s: on-time in the queue, s (15,).
        :param limit_s: maximum of an account, s.
        :param now_ns: world time, ns.
        :return: their mask, bit 0 for coil 0.
        """
        self._cool(now_ns)
        return sum(
            1 << channel
            for channel, (account_s, more_s, next_s) in enumerate(zip(self._accounts_s, waiting_s, wanted_s, strict=True))
            if next_s and account_s + more_s + next_s > limit_s + _ROUNDING_S
        )

    def beyond(self, limit_s: float, now_ns: int) -> int:
        """Coils above the limit already.

        :param limit_s: maximum of an account, s.
        :param now_ns: world time, ns.
        :return: their mask, bit 0 for coil 0.
        """
        self._cool(now_ns)
        return sum(1 << channel for channel, account_s in enumerate(self._accounts_s) if account_s > limit_s + _ROUNDING_S)

    def note(self, waiting_s: Sequence[float], now_ns: int) -> None:
        """Note what a loss of power must not hide; after a pulse was taken.

        :param waiting_s: on-time in the queue, s (15,).
        :param now_ns: world time, ns.
        """
        self._cool(now_ns)
        max_s = max(account_s + more_s for account_s, more_s in zip(self._accounts_s, waiting_s, strict=True))
        self._used |= max_s > 0.0
        self._warm = max_s > WARM_S or (self._warm and max_s >= COOLED_S)

    def lose_power(self, limit_s: float, now_ns: int) -> None:
        """Accounts are lost: each becomes the worst that the notes allow, the limit, ``WARM_S`` or 0.

        :param limit_s: maximum of an account, s.
        :param now_ns: world time, ns.
        """
        self.note([0.0] * COIL_CHANNELS, now_ns)
        worst_s = limit_s if self._warm else WARM_S if self._used else 0.0
        self._accounts_s = [worst_s] * COIL_CHANNELS

    def units(self, waiting_s: Sequence[float], now_ns: int) -> list[int]:
        """The accounts as telemetry reports them.

        :param waiting_s: on-time in the queue, s (15,); counted in.
        :param now_ns: world time, ns.
        :return: of each coil (15,), in units of ``HEAT_UNIT_MS``, rounded up.
        """
        self._cool(now_ns)
        return [
            math.ceil(1000.0 * (account_s + more_s) / HEAT_UNIT_MS)
            for account_s, more_s in zip(self._accounts_s, waiting_s, strict=True)
        ]

    def _cool(self, now_ns: int) -> None:
        if now_ns != self._at_ns:
            kept = math.exp((self._at_ns - now_ns) / NS_PER_S / THERMAL.tau_s)
            self._accounts_s = [kept * account_s if account_s > _ROUNDING_S else 0.0 for account_s in self._accounts_s]
            self._at_ns = now_ns
