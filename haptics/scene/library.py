"""Finding scenes: the ones that ship, and files of one's own."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from os import PathLike

from haptics.errors import InputError
from haptics.scene.scene import Scene
from haptics.units import file_path, nearest

_SUFFIX = ".toml"
_SHIPPED = resources.files("haptics.scene") / "data"


def shipped_scenes() -> list[tuple[str, str]]:
    """The scenes that ship.

    :return: name and summary of each, in order of the names.
    """
    return [(name, load_scene(name).summary) for name in _shipped_names()]


def load_scene(source: str | PathLike[str]) -> Scene:
    """A scene: a shipped one by its name, or one's own from a TOML file.

    :param source: a shipped name, or a path; text counts as a path if it ends in ``.toml`` or names a folder.
    :return: not yet placed: objects at the palm or in the hand wait for a hand (``Scene.placed_for``).
    :raises InputError: no such scene or file, or its content is not a scene; with file, line and key.
    """
    from haptics.scene.model import read_scene  # here, as pydantic takes a third of a second to import

    path = file_path("source", source)
    if isinstance(source, str) and path.suffix != _SUFFIX and path.name == source:
        if source not in _shipped_names():
            names = _shipped_names()
            raise InputError(
                f"scene = {source!r} does not ship; expected one of {', '.join(names)}, or the path of a {_SUFFIX} file"
                f"{nearest(source, names)}"
            )
        scene = read_scene((_SHIPPED / f"{source}{_SUFFIX}").read_text("utf-8"), source, f"{source}{_SUFFIX}")
        return replace(scene, origin=source)
    try:
        text = path.read_text("utf-8")
    except (OSError, ValueError) as error:
        why = (error.strerror if isinstance(error, OSError) else None) or error
        shipped = ", ".join(_shipped_names())
        raise InputError(
            f"scene = {str(path)!r} cannot be read: {why}; expected a {_SUFFIX} file, or a scene that ships: {shipped}"
        ) from error
    return replace(read_scene(text, path.stem, str(path), path.parent), origin=str(path.absolute()))


def _shipped_names() -> list[str]:
    return sorted(item.name.removesuffix(_SUFFIX) for item in _SHIPPED.iterdir() if item.name.endswith(_SUFFIX))
