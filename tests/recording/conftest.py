"""A recorded session, finalised and opened once."""

from __future__ import annotations

import pytest
from recorded_session import record_session

from haptics.recording import Recording, finalise, load


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """The session, finalised and opened."""
    folder = tmp_path_factory.mktemp("recording")
    path = folder / "session.h5"
    finalise(record_session(folder / "session.journal", {"default_plot": {"stream": "ticks", "signal": "rise_k"}}), path)
    return load(path)
