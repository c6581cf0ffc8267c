"""The reference data that ships, looked up by id. Files are read and checked once, when first asked for."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from functools import lru_cache
from importlib.resources import files

from haptics.errors import InputError
from rigs.reference.published import Contradiction, Curve, Published
from rigs.reference.reading import Reference, read_reference

FILES = ("tactiles.toml", "brake.toml", "passive_garments.toml", "garments.toml")
"""Chapters 3, 4, 5 and 6."""


@lru_cache(maxsize=1)
def _shipped() -> Reference:
    folder = files("rigs.reference")
    return read_reference({name: folder.joinpath(name).read_text("utf-8") for name in FILES})


def published(id: str) -> Published:
    """The published number of an id, such as ``thermal_tau``.

    :param id: of a number.
    :return: the number.
    :raises InputError: unknown id; the message names the nearest.
    """
    row = _shipped().published.get(id)
    if row is None:
        raise _unknown("published", id, _shipped().published)
    return row


def curve(id: str) -> Curve:
    """The published curve of an id, such as ``force_index``.

    :param id: of a curve.
    :return: the curve.
    :raises InputError: unknown id; the message names the nearest.
    """
    row = _shipped().curves.get(id)
    if row is None:
        raise _unknown("curve", id, _shipped().curves)
    return row


def all_published() -> tuple[Published, ...]:
    """Every number, in the order of the files.

    :return: every published number.
    """
    return tuple(_shipped().published.values())


def all_curves() -> tuple[Curve, ...]:
    """Every curve, in the order of the files.

    :return: every published curve.
    """
    return tuple(_shipped().curves.values())


def contradictions() -> tuple[Contradiction, ...]:
    """Every contradiction, in the order of the files.

    :return: every contradiction.
    """
    return tuple(_shipped().contradictions.values())


def contradictions_of(id: str) -> tuple[Contradiction, ...]:
    """The contradictions that concern a number or curve; none if its source is of one mind.

    :param id: of a number or curve.
    :return: in the order of the files.
    :raises InputError: no number or curve has the id.
    """
    if id not in _shipped().published and id not in _shipped().curves:
        raise _unknown("published or curve", id, (*_shipped().published, *_shipped().curves))
    return tuple(row for row in contradictions() if id in row.concerns)


def _unknown(kind: str, id: str, known: Iterable[str]) -> InputError:
    near = get_close_matches(id, list(known), n=3, cutoff=0.4)
    nearest = f"nearest: {', '.join(near)}" if near else "see docs/reference/published.md"
    return InputError(f"{kind} id = {id!r} is not known; {nearest}")
