from __future__ import annotations

import shutil

import pytest


@pytest.fixture(scope="session")
def simulator() -> str:
    """Where ngspice is; a test that needs it asks for this."""
    found = shutil.which("ngspice")
    if found is None:
        pytest.skip("ngspice is not installed; it is the package ngspice of Debian and Ubuntu")
    return found
