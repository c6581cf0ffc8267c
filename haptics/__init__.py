"""Wearable haptics, from a VR scene to volts on a wrist and back.

The names below are the public face (``docs/decisions/0009-public-face.md``); each is imported when first used, so that
``import haptics`` stays quick. ``haptics.physics`` and ``haptics.garments`` have faces of their own.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from haptics.version import __version__

if TYPE_CHECKING:
    from haptics.devices import Reason as Reason, Result as Result, ResultKind as ResultKind
    from haptics.errors import (
        ClockUncertain as ClockUncertain,
        CommandRefused as CommandRefused,
        DeadManMissed as DeadManMissed,
        GloveEnded as GloveEnded,
        HapticsError as HapticsError,
        InputError as InputError,
        LimitError as LimitError,
        LinkError as LinkError,
        LinkLost as LinkLost,
        NotABoard as NotABoard,
        PortBusy as PortBusy,
        PortMissing as PortMissing,
        ReplyTimeout as ReplyTimeout,
        WrongFirmware as WrongFirmware,
    )
    from haptics.link.readings import (
        BoardName as BoardName,
        BoardState as BoardState,
        BrakeLimits as BrakeLimits,
        BrakeTelemetry as BrakeTelemetry,
        Identity as Identity,
        TactilesLimits as TactilesLimits,
        TactilesTelemetry as TactilesTelemetry,
    )
    from haptics.recording import recording as _recording
    from haptics.recording.hdf5_file import DamagedFile as DamagedFile
    from haptics.recording.recording import Recording as Recording
    from haptics.rendering.events import EventKind as EventKind, LoopEvent as LoopEvent
    from haptics.scene.calibration.hand_calibration import HandCalibration as HandCalibration
    from haptics.scene.calibration.routine import CalibrationRoutine as CalibrationRoutine, CalibrationStep as CalibrationStep
    from haptics.scene.calibration.store import (
        load_calibration as load_calibration,
        save_calibration as save_calibration,
        saved_calibrations as saved_calibrations,
    )
    from haptics.scene.hand_files.load import load_hand as load_hand, shipped_hands as shipped_hands
    from haptics.scene.hands.basis import BASES as BASES, Basis as Basis
    from haptics.scene.hands.frame import HandFrame as HandFrame
    from haptics.scene.hands.joints import JOINTS as JOINTS, SIDES as SIDES, Side as Side
    from haptics.scene.hands.recording import HandRecording as HandRecording
    from haptics.scene.library import load_scene as load_scene, shipped_scenes as shipped_scenes
    from haptics.scene.objects import SceneObject as SceneObject
    from haptics.scene.scene import Scene as Scene
    from haptics.scene.sites import SITES as SITES
    from haptics.session.both_hands import BothHands as BothHands
    from haptics.session.configuration import Configuration as Configuration, load_configuration as load_configuration
    from haptics.session.glove import Glove as Glove, open as open
    from haptics.session.glove_state import (
        GloveIdentity as GloveIdentity,
        GloveState as GloveState,
        GloveTelemetry as GloveTelemetry,
    )
    from haptics.session.live import live as live
    from haptics.session.peer_clock import PeerClock as PeerClock
    from haptics.session.plant_truth import PlantTruth as PlantTruth
    from haptics.session.session import Session as Session

    load_recording = _recording.load

_ROOMS = {
    "haptics.devices": ("Reason", "Result", "ResultKind"),
    "haptics.errors": (
        "ClockUncertain",
        "CommandRefused",
        "DeadManMissed",
        "GloveEnded",
        "HapticsError",
        "InputError",
        "LimitError",
        "LinkError",
        "LinkLost",
        "NotABoard",
        "PortBusy",
        "PortMissing",
        "ReplyTimeout",
        "WrongFirmware",
    ),
    "haptics.link.readings": (
        "BoardName",
        "BoardState",
        "BrakeLimits",
        "BrakeTelemetry",
        "Identity",
        "TactilesLimits",
        "TactilesTelemetry",
    ),
    "haptics.recording.hdf5_file": ("DamagedFile",),
    "haptics.recording.recording": ("Recording",),
    "haptics.rendering.events": ("EventKind", "LoopEvent"),
    "haptics.scene.calibration.hand_calibration": ("HandCalibration",),
    "haptics.scene.calibration.routine": ("CalibrationRoutine", "CalibrationStep"),
    "haptics.scene.calibration.store": ("load_calibration", "save_calibration", "saved_calibrations"),
    "haptics.scene.hand_files.load": ("load_hand", "shipped_hands"),
    "haptics.scene.hands.basis": ("BASES", "Basis"),
    "haptics.scene.hands.frame": ("HandFrame",),
    "haptics.scene.hands.joints": ("JOINTS", "SIDES", "Side"),
    "haptics.scene.hands.recording": ("HandRecording",),
    "haptics.scene.library": ("load_scene", "shipped_scenes"),
    "haptics.scene.objects": ("SceneObject",),
    "haptics.scene.scene": ("Scene",),
    "haptics.scene.sites": ("SITES",),
    "haptics.session.both_hands": ("BothHands",),
    "haptics.session.configuration": ("Configuration", "load_configuration"),
    "haptics.session.glove": ("Glove", "open"),
    "haptics.session.glove_state": ("GloveIdentity", "GloveState", "GloveTelemetry"),
    "haptics.session.live": ("live",),
    "haptics.session.peer_clock": ("PeerClock",),
    "haptics.session.plant_truth": ("PlantTruth",),
    "haptics.session.session": ("Session",),
}
_FACE = {name: (room, name) for room, names in _ROOMS.items() for name in names}
_FACE["load_recording"] = ("haptics.recording.recording", "load")

__all__ = ["__version__", *_FACE]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _FACE:
        room, inner = _FACE[name]
        return getattr(importlib.import_module(room), inner)
    raise AttributeError(f"module 'haptics' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
