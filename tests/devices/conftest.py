"""An open glove on simulated boards in virtual time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from told import Told

from haptics.session.glove import Glove, open as open_glove


@pytest.fixture
def glove() -> Iterator[Glove]:
    """Both boards, nominal plants, not armed."""
    with open_glove(tactiles="sim://tactiles?spread=0", brake="sim://brake?spread=0", clock="virtual") as opened:
        yield opened


@pytest.fixture
def told(glove: Glove) -> Told:
    """What becomes of what is asked of its drivers, whoever asks."""
    return Told(glove.devices)
