"""What became of what was asked of a glove's devices, whoever asked."""

from __future__ import annotations

from haptics.devices import Refusal, Result
from haptics.session.devices import Devices


class Told:
    """Collects results and refusals from now on.

    :param devices: of a glove.
    """

    def __init__(self, devices: Devices):
        self._devices = devices
        self._new: list[Result | Refusal] = []
        devices.on_result(lambda now_ns, one: self._new.append(one))

    def results(self) -> list[Result]:
        """Results since the last call."""
        return [one for one in self._take(Result) if isinstance(one, Result)]

    def refusals(self) -> list[Refusal]:
        """Refusals of the brake controller since the last call."""
        return [one for one in self._take(Refusal) if isinstance(one, Refusal)]

    def _take(self, kind: type) -> list[Result | Refusal]:
        self._devices.hand_on_results()
        taken = [one for one in self._new if isinstance(one, kind)]
        self._new = [one for one in self._new if not isinstance(one, kind)]
        return taken
