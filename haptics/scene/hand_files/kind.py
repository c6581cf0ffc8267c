"""What kind of hands a text holds, by its first content."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Literal

from haptics.scene.hand_files.foreign import is_table, member_names
from haptics.scene.hand_files.json_stream import Item, read_items
from haptics.scene.hand_files.mediapipe import OLD_WORLD, PICTURE, WORLD
from haptics.scene.hand_files.spelling import joint_called, plain
from haptics.scene.hand_files.text_source import open_text

Kind = Literal["leap", "joint lines", "joint table", "landmarks"]

_LEAP = {"pointables", "palm_position", "palm_normal"}
_LANDMARKS = {*WORLD, OLD_WORLD, *PICTURE, "multi_handedness"}
_JOINTS = {"joints", "joint_poses", "input_sources", "left", "right"}
_ENOUGH_JOINTS = 2
_LOOKED_AT = 100
_HEAD_CHARS = 32 << 10


def kind_of(path: Path) -> Kind:
    """Look at the beginning of a file.

    :param path: a file of text, in any packing that is read.
    :return: its kind; ``leap`` where none shows.
    :raises InputError: it cannot be read as text.
    """
    with open_text(path) as text:
        head = ""
        while len(head) < _HEAD_CHARS and (more := text(_HEAD_CHARS)):
            head += more
    if head.lstrip()[:1] not in ("{", "["):
        return "joint table" if head.lstrip().startswith("#") or is_table(head) else "leap"
    items = (item for item in read_items(path, "frames") if isinstance(item, Item))
    for item in islice(items, _LOOKED_AT):
        spelt = member_names(item.value)
        names = {plain(name) for name in spelt}
        if names & _LEAP:
            return "leap"
        if names & _LANDMARKS:
            return "landmarks"
        if names & _JOINTS or sum(joint_called(name) is not None for name in spelt) >= _ENOUGH_JOINTS:
            return "joint lines"
    return "leap"
