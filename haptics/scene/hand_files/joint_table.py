"""Hands as CSV: a row for each pose, or a row for each joint.

The first row names the columns, lines that begin with ``#`` declare (``docs/reference/hands.md``)::

    # basis=unity unit=m time=ms
    time,side,wrist_x,wrist_y,wrist_z,wrist_qx,wrist_qy,wrist_qz,wrist_qw,thumb_metacarpal_x,...
    time,side,joint,x,y,z,qx,qy,qz,qw

Columns may be in any order and apart by comma, semicolon or tab; both hands may stand in one row, in columns that begin with
``left_`` and ``right_``. What is no number, or none of a hand, is a joint that the tracker has lost.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from haptics.errors import InputError
from haptics.scene.hand_files.declared import declared_in
from haptics.scene.hand_files.pose_rows import LARGEST, LOST, PoseRows
from haptics.scene.hand_files.spelling import (
    PARTS,
    column_called,
    is_side,
    is_time,
    joint_called,
    part_called,
    plain,
    side_of,
    unit_of_time,
)
from haptics.scene.hand_files.text_source import Text, open_text
from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.shown import shown
from haptics.time import LATEST_NS

LONGEST_LINE_CHARS = 64 << 10
"""A line beyond this is refused; a row of two hands takes some eight thousand."""
MOST_HANDS = 100
"""At one time; a table of more is no table of hands, and is not kept whole in memory."""
_PIECE_CHARS = 256 << 10
_DELIMITERS = ",;\t"
_SEE = "(docs/reference/hands.md)"
_JOINT_NAMES = ("joint", "joint_name", "joint_id", "name", "id")


def read_joint_table(path: Path) -> PoseRows:
    """Collect the poses of a file.

    :param path: CSV of joints.
    :return: in the file's own numbers.
    :raises InputError: not CSV of that form, or nearly all of it cannot be used.
    """
    with open_text(path) as text:
        return _read(text)


def _read(text: Text) -> PoseRows:
    rows = PoseRows()
    lines = _lines(text, rows)
    number, head = next(lines, (0, ""))
    mark = max(_DELIMITERS, key=head.count)
    names = [name.strip() for name in next(csv.reader([head], delimiter=mark), [])]
    kind = _TallTable if any(plain(name) in _JOINT_NAMES for name in names) else _WideTable
    table = kind(names, rows, mark != ",")
    for number, line in lines:
        try:
            cells = line.split(mark) if '"' not in line else next(csv.reader([line], delimiter=mark, strict=True))
            wrong = f"has {len(cells)} cells; expected {len(names)}, as the row that names the columns"
        except csv.Error as error:
            cells, wrong = [], f"is not CSV: {error}"
        if len(cells) == len(names):
            table.take(f"line {number}", cells)
        else:
            rows.refuse(None, None, f"line {number} {wrong}")
    table.end_pose()
    return rows


def _lines(text: Text, rows: PoseRows) -> Iterator[tuple[int, str]]:
    """Lines with their numbers; blank ones are passed over, and what comments declare is kept."""
    left, number, ended = "", 0, False
    while not ended:
        piece = text(_PIECE_CHARS)
        ended = not piece
        *whole, left = (left + piece).replace("\r\n", "\n").split("\n")
        for line in (*whole, left) if ended else whole:
            number += 1
            if len(line) > LONGEST_LINE_CHARS:
                raise InputError(f"line {number} is longer than the allowed {LONGEST_LINE_CHARS} characters")
            if line.startswith("#"):
                words = (word.partition("=") for word in line.lstrip("# ").replace(",", " ").replace(": ", "=").split())
                said = declared_in({name: value for name, equals, value in words if equals}, f"line {number}", whole=True)
                rows.declared = rows.declared.agreed(said)
            elif line.strip():
                yield number, line
        if len(left) > LONGEST_LINE_CHARS:
            raise InputError(f"line {number + 1} is longer than the allowed {LONGEST_LINE_CHARS} characters")


def _looks_like(names: Sequence[str]) -> str:
    return f"it looks like CSV, a table of separated values, with the columns {shown(', '.join(names))}"


class _Table:
    """Columns that both forms have, and the numbers in a row."""

    def __init__(self, names: Sequence[str], rows: PoseRows, comma_is_point: bool):
        self._rows, self._comma_is_point = rows, comma_is_point
        twice = next((name for name, count in Counter(names).items() if count > 1 and name), None)
        if twice is not None:
            raise InputError(f"column {shown(twice)} is given twice")
        self._time = next((at for at, name in enumerate(names) if is_time(name)), None)
        self._side = next((at for at, name in enumerate(names) if is_side(name)), None)
        self._track = next((at for at, name in enumerate(names) if plain(name) in ("track", "track_id")), None)
        if self._time is None:
            raise InputError(f"{_looks_like(names)}, none of them a time; expected time_ns, side and the joints {_SEE}")
        unit = unit_of_time(names[self._time])
        if unit is not None:
            rows.declared = rows.declared.agreed(declared_in({"time": unit}, names[self._time]))

    def end_pose(self) -> None:
        """The pose that is being read has no more rows."""

    def _number(self, text: str) -> float:
        try:
            return float(text.replace(",", ".") if self._comma_is_point else text)
        except ValueError:
            return LOST[0]

    def _coordinate(self, text: str) -> float:
        number = self._number(text)
        return number if abs(number) <= LARGEST else LOST[0]

    def _moment(self, place: str, cells: Sequence[str]) -> float:
        assert self._time is not None
        text = cells[self._time].strip()
        time = int(text) if text.lstrip("-").isdecimal() and len(text) < 20 else self._number(text)
        if not abs(time) <= LATEST_NS:
            raise InputError(f"{place}: time = {shown(text)}; expected a number within 2^62")
        return time

    def _side_in(self, place: str, cells: Sequence[str]) -> str | None:
        return None if self._side is None else side_of(cells[self._side].strip(), f"{place}: side")

    def _track_in(self, place: str, cells: Sequence[str]) -> int:
        text = "0" if self._track is None else cells[self._track].strip()
        if not text.isdecimal() or len(text) > 9:
            raise InputError(f"{place}: track = {shown(text)}; expected a whole number of 0 or more")
        return int(text)


class _WideTable(_Table):
    """A row for each pose, or for a pose of each hand."""

    def __init__(self, names: Sequence[str], rows: PoseRows, comma_is_point: bool):
        super().__init__(names, rows, comma_is_point)
        self._of: dict[str | None, dict[int, int]] = {}
        for at, name in enumerate(names):
            found = column_called(name)
            if found is None:
                continue
            side, joint, part = found
            place = len(PARTS) * joint + PARTS.index(part)
            if place in self._of.setdefault(side, {}):
                raise InputError(f"column {name!r} is the {part} of {JOINTS[joint]}, which another column is, too")
            self._of[side][place] = at
        if not self._of:
            raise InputError(
                f"{_looks_like(names)}, none of them of a joint; expected such as index_tip_x, or a column `joint` {_SEE}"
            )

    def take(self, place: str, cells: Sequence[str]) -> None:
        """Read a row.

        :param place: where it is in the file.
        :param cells: as many as there are columns.
        """
        for of_side, columns in self._of.items():
            side, time = of_side, None
            try:
                time = self._moment(place, cells)
                side = of_side or self._side_in(place, cells)
                numbers = list(LOST) * len(JOINTS)
                for at, column in columns.items():
                    numbers[at] = self._coordinate(cells[column])
                self._rows.add(place, time, side, self._track_in(place, cells), numbers)
            except InputError as error:
                self._rows.refuse(time, side, str(error))


class _TallTable(_Table):
    """A row for each joint; those of one time and side are a pose."""

    def __init__(self, names: Sequence[str], rows: PoseRows, comma_is_point: bool):
        super().__init__(names, rows, comma_is_point)
        self._joint = next(at for at, name in enumerate(names) if plain(name) in _JOINT_NAMES)
        self._parts = {PARTS.index(part): at for at, name in enumerate(names) if (part := part_called(name)) is not None}
        if not {0, 1, 2} <= self._parts.keys():
            raise InputError(f"{_looks_like(names)}; a row a joint has x, y, z, qx, qy, qz, qw as well {_SEE}")
        self._now: float | None = None
        self._poses: dict[tuple[str | None, int], tuple[str, list[float], set[int]]] = {}

    def take(self, place: str, cells: Sequence[str]) -> None:
        """Read a row.

        :param place: where it is in the file.
        :param cells: as many as there are columns.
        """
        time, side = None, None
        try:
            time = self._moment(place, cells)
            side = self._side_in(place, cells)
            track = self._track_in(place, cells)
        except InputError as error:
            self._rows.refuse(time, side, str(error))
            return
        if time != self._now or len(self._poses) > MOST_HANDS:
            self.end_pose()
            self._now = time
        joint = joint_called(cells[self._joint])
        if joint is None:
            self._rows.dropped["rows of what is no joint"] += 1
            return
        _, numbers, seen = self._poses.setdefault((side, track), (place, list(LOST) * len(JOINTS), set()))
        if joint in seen:  # told by the joint's absence
            numbers[len(PARTS) * joint] = LOST[0]
            self._rows.dropped["joints given twice in a pose"] += 1
            return
        seen.add(joint)
        for part, at in self._parts.items():
            numbers[len(PARTS) * joint + part] = self._coordinate(cells[at])

    def end_pose(self) -> None:
        """Those of this time are whole."""
        for (side, track), (place, numbers, _) in self._poses.items():
            assert self._now is not None
            self._rows.add(place, self._now, side, track, numbers)
        self._poses.clear()
