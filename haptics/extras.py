"""Packages that only some users need: how to get those of an extra."""

from __future__ import annotations


def install(extra: str) -> str:
    """What gets the packages of an extra.

    :param extra: a name under ``optional-dependencies`` in ``pyproject.toml``.
    :return: a line for a shell, in the checkout.
    """
    return f"pip install '.[{extra}]' in the checkout"
