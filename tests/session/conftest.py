"""What several tests of sessions share."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest

from firmware_models import world as worlds

_names = itertools.count()


@pytest.fixture
def world() -> Iterator[tuple[str, Any]]:
    """A world that lives on while hosts come and go: its name, and the world itself."""
    name = f"hosts-{next(_names)}"
    entered = worlds.enter(name, "virtual")
    yield name, entered
    worlds.leave(name, entered)
