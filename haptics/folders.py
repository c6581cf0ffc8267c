"""Where the project keeps things on a person's machine: what it can make again, and what the person made."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_NAME = "wearable-haptics"


def cache_folder() -> Path:
    """For what can be made again (compiled cores, posed bodies): ``HAPTICS_CACHE``, or the platform's folder for caches.

    :return: the folder; it need not exist yet.
    """
    return _folder("HAPTICS_CACHE", ("LOCALAPPDATA", "AppData/Local"), "Library/Caches", ("XDG_CACHE_HOME", ".cache"))


def config_folder() -> Path:
    """For what a person made (calibrations of hands): ``HAPTICS_CONFIG_FOLDER``, or the platform's folder for configuration.

    :return: the folder; it need not exist yet.
    """
    windows, mac, others = ("APPDATA", "AppData/Roaming"), "Library/Application Support", ("XDG_CONFIG_HOME", ".config")
    return _folder("HAPTICS_CONFIG_FOLDER", windows, mac, others)


def _folder(own: str, windows: tuple[str, str], mac: str, others: tuple[str, str]) -> Path:
    """The variable of our own, else the platform's: a variable, and a place at home where that is not set."""
    named = os.environ.get(own)
    if named:
        return Path(named)
    if sys.platform == "darwin":
        return Path.home() / mac / _NAME
    variable, at_home = windows if sys.platform == "win32" else others
    return Path(os.environ.get(variable) or Path.home() / at_home) / _NAME
