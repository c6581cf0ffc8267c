"""The public face (docs/decisions/0009-public-face.md): which names there are, what stands behind each, with which types."""

from __future__ import annotations

import dataclasses
import inspect
import subprocess
import sys
import typing
from pathlib import Path

import pytest

import haptics

FACE = [
    "BASES", "Basis", "BoardName", "BothHands", "BoardState", "BrakeLimits", "BrakeTelemetry", "CalibrationRoutine",
    "CalibrationStep", "ClockUncertain", "CommandRefused", "Configuration", "DamagedFile", "DeadManMissed", "EventKind",
    "Glove", "GloveEnded", "GloveIdentity", "GloveState", "GloveTelemetry", "HandCalibration", "HandFrame",
    "HandRecording", "HapticsError", "Identity", "InputError", "JOINTS", "LimitError", "LinkError", "LinkLost",
    "LoopEvent", "NotABoard", "PeerClock", "PlantTruth", "PortBusy", "PortMissing", "Reason", "Recording",
    "ReplyTimeout", "Result", "ResultKind", "SIDES", "SITES", "Scene", "SceneObject", "Session", "Side", "TactilesLimits",
    "TactilesTelemetry", "WrongFirmware", "__version__", "live", "load_calibration", "load_configuration", "load_hand",
    "load_recording", "load_scene", "open", "save_calibration", "saved_calibrations", "shipped_hands", "shipped_scenes",
]  # fmt: skip
ADR = Path(__file__).parents[2] / "docs" / "decisions" / "0009-public-face.md"


def test_the_face_is_this_list():
    assert dir(haptics) == sorted(FACE)
    assert sorted(haptics.__all__) == sorted(FACE)


def test_the_decision_names_every_one():
    text = ADR.read_text("utf-8")
    assert [name for name in FACE if not name.startswith("_") and f"`{name}`" not in text] == []


@pytest.mark.parametrize("name", FACE)
def test_every_name_is_there_and_its_types_resolve(name):
    thing = getattr(haptics, name)
    if inspect.isclass(thing):
        typing.get_type_hints(thing)
        for part in vars(thing).values():
            call = getattr(part, "__func__", getattr(part, "fget", part))
            if inspect.isfunction(call):
                typing.get_type_hints(call)
    elif inspect.isfunction(thing):
        hints = typing.get_type_hints(thing)
        assert hints["return"] is not typing.Any


def test_what_a_user_is_handed_is_frozen_and_has_no_untyped_field():
    handed = [
        getattr(haptics, name)
        for name in FACE
        if name.endswith(("Limits", "Telemetry", "State", "Identity", "Truth", "Result")) and name != "BoardState"
    ]
    assert len(handed) == 10
    for kind in handed:
        assert dataclasses.is_dataclass(kind)
        assert kind.__dataclass_params__.frozen
        assert typing.Any not in typing.get_type_hints(kind).values()


def test_importing_the_package_imports_nothing_heavy():
    heavy = ["numpy", "scipy", "h5py", "pydantic", "serial", "haptics.session", "haptics.link", "haptics.scene"]
    code = f"import sys, haptics; dir(haptics); print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


def test_joints_and_sites_name_each_other():
    assert len(haptics.JOINTS) == 26
    assert typing.get_args(haptics.Side) == haptics.SIDES
    assert {"openxr", "webxr", "unity", "unreal", "godot"} <= set(haptics.BASES)
    assert {f"{finger}_tip" for finger in ("thumb", "index", "middle", "ring", "little")} <= {*haptics.JOINTS} & {*haptics.SITES}


def test_every_error_is_of_one_family():
    errors = [getattr(haptics, name) for name in FACE if inspect.isclass(getattr(haptics, name))]
    errors = [kind for kind in errors if issubclass(kind, BaseException)]
    assert len(errors) == 15
    assert all(issubclass(kind, haptics.HapticsError) for kind in errors)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'OpenGlove'"):
        haptics.OpenGlove  # noqa: B018
