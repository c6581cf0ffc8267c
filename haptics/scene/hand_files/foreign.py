"""What a file is that holds no hands that are read, by its content, and what can be done about it.

This only makes messages helpful: what is not known here is refused all the same, at the first place that does not fit.
"""

from __future__ import annotations

import re

from haptics.recording.segments import MAGIC as JOURNAL_MAGIC

READABLE = (
    "a Leap Motion recording as LeapJS writes it (JSON, whole or by line, packed, lz-string, gzip), joints of WebXR, OpenXR or "
    "Unity as JSON or CSV, world landmarks of MediaPipe, or a recording of `haptics run`"
)
_TO_READ = f"hands are read from: {READABLE}; docs/reference/hands.md lists what each must hold"
_UNPACK = "unpack it and give the file inside"

_BYTES: tuple[tuple[bytes, str], ...] = (
    (b"\x89HDF", f"an HDF5 file; `haptics run --hand` and `haptics replay` read those that `haptics run` made; {_TO_READ}"),
    (JOURNAL_MAGIC, "the journal of a run that did not end; `haptics recording recover` makes a recording of it to play"),
    (b"PK\x03\x04", f"a zip archive; {_UNPACK}"),
    (b"PK\x05\x06", f"an empty zip archive; {_UNPACK}"),
    (b"BZh", f"packed by bzip2; {_UNPACK}"),
    (b"\xfd7zXZ", f"packed by xz; {_UNPACK}"),
    (b"\x28\xb5\x2f\xfd", f"packed by zstd; {_UNPACK}"),
    (b"7z\xbc\xaf", f"a 7z archive; {_UNPACK}"),
    (b"Rar!", f"a rar archive; {_UNPACK}"),
    (b"\x1f\x8b", f"packed by gzip twice; {_UNPACK}"),
    (b"glTF", f"a binary glTF model, a shape with no hand tracking in it; {_TO_READ}"),
    (b"Kaydara FBX", f"an FBX file, a model or animation; {_TO_READ}"),
    (b"PXR-USDC", f"a USD scene; {_TO_READ}"),
    (b"\x93NUMPY", f"a NumPy array; {_TO_READ}"),
    (b"SQLite format 3", f"an SQLite database; {_TO_READ}"),
    (b"\x89PNG", f"a picture; {_TO_READ}"),
    (b"\xff\xd8\xff", f"a picture; {_TO_READ}"),
    (b"\x1aE\xdf\xa3", f"a video; {_TO_READ}"),
)  # fmt: skip

_TEXTS: tuple[tuple[str, str], ...] = (
    ("<!doctype html", "a web page, perhaps an error in place of the download; fetch the file itself"),
    ("<html", "a web page, perhaps an error in place of the download; fetch the file itself"),
    ("<", f"XML; {_TO_READ}"),
    ("version https://git-lfs", "a Git LFS pointer in place of the file; `git lfs pull` fetches it"),
    ("hierarchy", f"a BVH motion, angles of a skeleton's joints; {_TO_READ}"),
    ("; fbx", f"an FBX file, a model or animation; {_TO_READ}"),
    ("#usda", f"a USD scene; {_TO_READ}"),
    ('"', "one text in quotes; store what is inside them, without the escapes"),
    ("eyj", "JSON in plain base64; decode it first (`base64 -d`)"),
    ("h4sia", "gzip in plain base64; decode it first (`base64 -d`)"),
)

_GLTF = {"asset", "accessors", "bufferviews", "meshes"}
_POSE = {"keypoints", "keypoints3d"}
_MEMBERS: tuple[tuple[set[str], str], ...] = (
    (_GLTF, "a glTF model, a shape with no hand tracking in it"),
    (_POSE, "keypoints of a picture, which have no scale"),
)
_DEEPEST = 4
_MOST_LOOKED_AT = 200


def foreign_bytes(head: bytes) -> str | None:
    """What a file is that is not a hand recording, by its first bytes.

    :param head: at least 262 bytes, or the whole file.
    :return: what it is, and what to do; None if it may be text.
    """
    if not head:
        return f"it is empty; hands are read from: {READABLE}"
    for mark, what in _BYTES:
        if head.startswith(mark):
            return f"it is {what}"
    if head[4:8] == b"ftyp":
        return f"it is a video or picture; {_TO_READ}"
    if head[257:262] == b"ustar":
        return f"it is a tar archive; {_UNPACK}"
    return None


def foreign_text(head: str) -> str | None:
    """What a text is that is not a hand recording, by its beginning.

    :param head: some thousand characters, or the whole text.
    :return: what it is, and what to do; None if it may be a recording.
    """
    plain = head.lstrip().lower()
    if not plain:
        return f"it is empty, or blank for {len(head)} characters; hands are read from: {READABLE}"
    for mark, what in _TEXTS:
        if plain.startswith(mark) and not (mark == '"' and is_table(plain)):  # a table's names may stand in quotes
            return f"it is {what}"
    return None


def is_table(head: str) -> bool:
    """Whether a text is a table of separated values.

    :param head: its beginning, of which the last line may be cut.
    :return: whether it is.
    """
    text = head.lstrip()
    text = text.rpartition("\n")[0] or text
    lines = [line for line in text.splitlines()[:2] if line.strip()]
    if not lines or re.search(r"[{\[]", lines[0]):
        return False
    wanted = 3 if len(lines) == 1 else 1
    return any(lines[0].count(mark) >= wanted and lines[0].count(mark) == lines[-1].count(mark) for mark in ",;\t")


def foreign_members(value: object) -> str | None:
    """What JSON is that is not a hand recording, by the names of its members.

    :param value: as parsed.
    :return: what it is, and what to do; None if that is not known.
    """
    names = {re.sub(r"[^a-z0-9]", "", name.lower()) for name in member_names(value)}
    for marks, what in _MEMBERS:
        if names & marks:
            return f"it seems to be {what}; {_TO_READ}"
    if {"x", "y"} <= names and not names & {"hands", "pointables"}:
        return f"it seems to be lists of points; {_TO_READ}"
    return None


def member_names(value: object) -> set[str]:
    """The names of members, some levels deep and not all of many.

    :param value: as parsed from JSON.
    :return: as they are spelt.
    """
    names: set[str] = set()
    level = [value]
    for _ in range(_DEEPEST):
        inner: list[object] = []
        for part in level[:_MOST_LOOKED_AT]:
            if isinstance(part, dict):
                names.update(name for name in list(part)[:_MOST_LOOKED_AT] if isinstance(name, str))
                inner += list(part.values())[:_MOST_LOOKED_AT]
            elif isinstance(part, list):
                inner += part[:_MOST_LOOKED_AT]
        level = inner
    return names
