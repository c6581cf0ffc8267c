"""The times of a JSON file's poses."""

from __future__ import annotations

from collections.abc import Mapping

from haptics.errors import InputError
from haptics.scene.hand_files.declared import declared_in
from haptics.scene.hand_files.pose_rows import PoseRows
from haptics.scene.hand_files.spelling import is_time, unit_of_time
from haptics.scene.hands.shown import shown
from haptics.time import LATEST_NS


class Clock:
    """Reads the times of one file's poses: the member that the first one has, and the unit in its name.

    :param rows: told the unit.
    """

    def __init__(self, rows: PoseRows):
        self._rows, self._name = rows, ""

    def read(self, frame: Mapping[str, object], place: str) -> float:
        """The time of a frame.

        :param frame: its members.
        :param place: where it is in the file, for messages.
        :return: in the file's unit.
        :raises InputError: it has none, or it is no number.
        """
        if not self._name:
            self._name = next((name for name, value in frame.items() if is_time(name) and isinstance(value, (int, float))), "")
            unit = unit_of_time(self._name)
            if unit is not None:
                self._rows.declared = self._rows.declared.agreed(declared_in({"time": unit}, place))
        if not self._name:
            raise InputError(f"{place} has no time; expected a member `time`, or `time_ns`, `time_us`, `time_ms`, `time_s`")
        value = frame.get(self._name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LATEST_NS:
            raise InputError(f"{place}.{self._name} = {shown(value)}; expected a number within 2^62")
        return value
