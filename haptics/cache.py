"""Where the project keeps what it can make again: compiled cores, posed bodies."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder() -> Path:
    """``HAPTICS_CACHE``, or ``wearable-haptics`` in the folder that the platform has for caches.

    :return: the folder; it need not exist yet.
    """
    named = os.environ.get("HAPTICS_CACHE")
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "wearable-haptics"
