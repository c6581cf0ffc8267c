"""Where the project keeps what a person made and wants to keep: calibrations of hands."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def config_folder() -> Path:
    """``HAPTICS_CONFIG_FOLDER``, or ``wearable-haptics`` in the folder that the platform has for configuration.

    :return: the folder; it need not exist yet.
    """
    named = os.environ.get("HAPTICS_CONFIG_FOLDER")
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = os.environ.get("APPDATA") or str(Path.home() / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Application Support")
    else:
        base = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(base) / "wearable-haptics"
