"""What a real board counts of its outputs: pulses begun, in the coil board's telemetry. A brake controller counts none."""

from __future__ import annotations

from typing import Any

_WRAP = 1 << 16


class Counted:
    """Pulses begun since the first telemetry, over all channels.

    ``perhaps`` is set by its owner: pulses of commands whose outcome is unknown.
    """

    def __init__(self) -> None:
        self.perhaps = 0
        self._last: list[int] | None = None
        self._begun = 0

    def take(self, telemetry: Any) -> None:
        """Count the pulses of one telemetry message; one without counters is ignored.

        :param telemetry: the message.
        """
        played = getattr(telemetry, "played", None)
        if played is None:
            return
        if self._last is not None:
            self._begun += sum((now - before) % _WRAP for now, before in zip(played, self._last, strict=True))
        self._last = list(played)

    def surplus(self, acknowledged: int) -> int:
        """Pulses begun beyond those acknowledged and those that may have been played besides.

        :param acknowledged: pulses that the board accepted.
        :return: how many too many; 0 if the board does not count.
        """
        return max(0, self._begun - acknowledged - self.perhaps) if self._last is not None else 0

    def missing(self, acknowledged: int) -> int | None:
        """Pulses acknowledged and not begun.

        :param acknowledged: pulses that the board accepted.
        :return: how many too few; None if the board does not count.
        """
        return max(0, acknowledged - self._begun) if self._last is not None else None
