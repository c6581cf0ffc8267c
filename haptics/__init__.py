"""Wearable haptics, from a VR scene to volts on a wrist and back.

The names below are the public face; each is imported when first used, so that ``import haptics`` stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from haptics.version import __version__

_FACE = {
    "open": "haptics.session.open_glove",
    "Glove": "haptics.session.glove",
    "Session": "haptics.session.session",
    "load_configuration": "haptics.session.configuration",
    "load_scene": "haptics.scene",
    "shipped_scenes": "haptics.scene",
    "load_hand": "haptics.scene.hand_files.load",
    "HandFrame": "haptics.scene.hands.frame",
    "HapticsError": "haptics.errors",
    "InputError": "haptics.errors",
    "LimitError": "haptics.errors",
    "LinkError": "haptics.errors",
}

__all__ = ["__version__", *_FACE]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from haptics.errors import (
        HapticsError as HapticsError,
        InputError as InputError,
        LimitError as LimitError,
        LinkError as LinkError,
    )
    from haptics.scene import load_scene as load_scene, shipped_scenes as shipped_scenes
    from haptics.scene.hand_files.load import load_hand as load_hand
    from haptics.scene.hands.frame import HandFrame as HandFrame
    from haptics.session.configuration import load_configuration as load_configuration
    from haptics.session.glove import Glove as Glove
    from haptics.session.open_glove import open as open
    from haptics.session.session import Session as Session


def __getattr__(name: str) -> Any:
    if name in _FACE:
        return getattr(importlib.import_module(_FACE[name]), name)
    raise AttributeError(f"module 'haptics' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
