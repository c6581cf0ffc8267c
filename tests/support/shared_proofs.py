"""Runs of a proof that several tests look at are played once a process.

A test that uses this belongs to the group ``proof``, so that all of them are of one process.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

import pytest

from haptics.session import prove

_play = prove._run
_kept: dict[tuple[str, ...], Any] = {}


def _once(scene: str, hand: str, configuration: Any, options: Any) -> Any:
    asked = (repr((field.name, getattr(options, field.name))) for field in fields(options))
    key = (scene, hand, configuration.model_dump_json(), *asked)
    if key not in _kept:
        _kept[key] = _play(scene, hand, configuration, options)
    return _kept[key]


@contextmanager
def shared_proofs() -> Iterator[None]:
    """Proofs within the context share what they play of the same scene, hand, configuration and options."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(prove, "_run", _once)
        yield
