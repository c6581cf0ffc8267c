"""A pattern's files."""

from __future__ import annotations

from pathlib import Path

from haptics.errors import InputError
from haptics.garments.pattern.dxf import dxf_bytes
from haptics.garments.pattern.pattern import Pattern
from haptics.garments.pattern.sheet import lay_out
from haptics.garments.pattern.svg import svg_bytes
from haptics.recording.output import refuse_existing, replacing


def write_pattern(pattern: Pattern, folder: Path, stem: str, force: bool = False) -> list[Path]:
    """Each sheet as ``stem.svg`` and ``stem.dxf`` (``stem-2.svg`` and so on for more sheets).

    :param pattern: what to write.
    :param folder: must exist.
    :param stem: the files' name without ending and without folders.
    :param force: overwrite files that exist.
    :return: the paths written.
    :raises InputError: no such folder, a file exists, a panel does not fit the sheet, or ezdxf is missing.
    """
    if not stem or Path(stem).name != stem:
        raise InputError(f"stem = {stem!r} is not a file name; expected a name without folders")
    contents: dict[Path, bytes] = {}
    for number, sheet in enumerate(lay_out(pattern), start=1):
        name = stem if number == 1 else f"{stem}-{number}"
        contents[Path(folder) / f"{name}.svg"] = svg_bytes(sheet)
        contents[Path(folder) / f"{name}.dxf"] = dxf_bytes(sheet)
    for path in contents:
        refuse_existing(path, force)
    for path, content in contents.items():
        with replacing(path, force) as partial:
            partial.write_bytes(content)
    return list(contents)
