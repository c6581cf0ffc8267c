"""Calibrations are kept by name: whole, for people to read, never overwritten unasked; what is none is refused by line."""

from __future__ import annotations

import os
import re
import tomllib
from datetime import date
from pathlib import Path

import pytest

from haptics.errors import HapticsError, InputError
from haptics.folders import config_folder
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.calibration.store import (
    calibrations_folder,
    load_calibration,
    remove_calibration,
    save_calibration,
    saved_calibrations,
)

ANNA = HandCalibration(
    name="anna",
    side="right",
    tip_radius_m={"index": 0.0085},
    offset_m={"palm_index": (0.004, -0.002, 0.0)},
    bone_m={"index_distal": 0.016},
    made_on=date(2026, 3, 31),
    made_from='a "tracker" \\ é',
    notes=("one", "two"),
)
PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "calibration.md"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HAPTICS_CONFIG_FOLDER", str(tmp_path / "configuration"))
    return tmp_path / "configuration" / "calibrations"


def written(folder: Path, content: str | bytes, name: str = "anna") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_what_is_saved_is_loaded_and_reads_as_toml(folder):
    assert saved_calibrations() == ()
    path = save_calibration(ANNA)
    assert path == folder / "anna.toml"
    assert load_calibration("anna") == ANNA
    assert saved_calibrations() == ("anna",)
    assert tomllib.loads(path.read_text("utf-8"))["offset_m"] == {"palm_index": [0.004, -0.002, 0.0]}
    assert [entry.name for entry in folder.iterdir()] == ["anna.toml"]  # nothing half written is left
    assert remove_calibration("anna") == path
    assert saved_calibrations() == ()


def test_none_is_overwritten_unasked(folder):
    before = save_calibration(ANNA).read_bytes()
    other = HandCalibration(name="anna", side="left")
    with pytest.raises(InputError, match=r"anna\.toml exists and is not overwritten"):
        save_calibration(other)
    assert (folder / "anna.toml").read_bytes() == before
    save_calibration(other, force=True)
    assert load_calibration("anna") == other


def test_one_that_is_not_there_is_said_with_those_that_are(folder):
    with pytest.raises(
        InputError, match=re.escape(f"calibration 'anna' is not in {folder}; there is none yet; haptics calibrate")
    ):
        load_calibration("anna")
    save_calibration(ANNA)
    with pytest.raises(InputError, match=r"there are: anna; did you mean anna\?"):
        load_calibration("ana")
    with pytest.raises(InputError, match="there are: anna"):
        remove_calibration("bertha")


@pytest.mark.parametrize("name", ["../anna", "/etc/passwd", "anna.toml", "a b", "", "a\0b", ".", 3, None, b"anna"])
def test_no_name_leads_out_of_the_folder(folder, name):
    written(folder.parent, "side = 'left'")  # ../anna.toml
    for use in (load_calibration, remove_calibration):
        with pytest.raises(InputError, match="name = "):
            use(name)
    assert (folder.parent / "anna.toml").exists()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", r"anna\.toml:1: side is missing; expected one of left, right"),
        (b"\xff\xfe\x00", "anna.toml is not TOML: it is no text in UTF-8"),
        (b"\x00" * 4096, r"anna\.toml:1: .* is not TOML"),
        ("side = 'right", r"anna\.toml:1: .* is not TOML"),
        ("side = 'rihgt'", "anna.toml:1: side = 'rihgt' is not allowed; allowed: left, right; did you mean right?"),
        ("side = ['right']", "anna.toml:1: side = "),
        (
            "side = 'right'\ntip_radius = 0.007\n",
            r"anna\.toml:2: tip_radius = 0\.007: there is no such key; .* mean tip_radius_m",
        ),
        ("side = 'right'\n[tip_radius_m]\nthumb = 0.007\nindex = nan\n", r"anna\.toml:4: tip_radius_m\.index = nan m"),
        (
            "side = 'right'\n[tip_radius_m]\nindex = 8.5\n",
            r"anna\.toml:3: tip_radius_m\.index = 8\.5 m; allowed 0\.003 to 0\.015 m",
        ),
        ("side = 'right'\n\n[offset_m]\npalm_indx = [0, 0, 0]\n", r"anna\.toml:3: offset_m has no site .* mean palm_index\?"),
        ("side = 'right'\noffset_m = 3\n", r"anna\.toml:2: offset_m = 3 is no table"),
        ("side = 'right'\n[offset_m]\npalm_index = [inf, 0, 0]\n", r"anna\.toml:3: offset_m\.palm_index along x = inf m"),
        ("side = 'right'\nbreadth_m = " + "9" * 5000, r"anna\.toml is no calibration: .*limit"),
        ("side = 'right'\nmade_on = 2026-03-31T10:00:00\n", r"anna\.toml:2: made_on = datetime"),
        ("side = 'right'\nnotes = " + "[" * 20000 + "]" * 20000, r"anna\.toml"),
        ("side = 'right'\n" + "#" * 70_000, "anna.toml is no calibration: it has more than 64 kB"),
    ],
    ids=lambda value: value[:24] if isinstance(value, str) else None,
)
def test_a_file_that_is_none_is_refused_by_line(folder, content, said):
    written(folder, content)
    with pytest.raises(InputError, match=said):
        load_calibration("anna")


def test_a_gigabyte_is_not_read(folder):
    path = written(folder, "side = 'right'\n")
    os.truncate(path, 2**30)
    with pytest.raises(InputError, match="more than 64 kB"):
        load_calibration("anna")


def test_folders_pipes_and_files_in_the_way_are_refused(folder):
    (folder / "anna.toml").mkdir(parents=True)
    with pytest.raises(InputError, match="calibration 'anna' is not in"):
        load_calibration("anna")
    with pytest.raises(InputError, match="is a folder"):
        save_calibration(ANNA, force=True)
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe.toml")
        with pytest.raises(InputError, match="calibration 'pipe' is not in"):
            load_calibration("pipe")


def test_a_file_in_place_of_the_folder_is_refused(folder):
    folder.parent.mkdir()
    folder.write_text("")
    with pytest.raises(InputError, match="no folder can be made there"):
        save_calibration(ANNA)
    with pytest.raises(InputError, match="cannot be read"):
        saved_calibrations()


def test_what_is_no_calibration_is_not_saved():
    with pytest.raises(InputError, match="expected a HandCalibration, from CalibrationRoutine"):
        save_calibration({"side": "right"})
    with pytest.raises(InputError, match="force = 'no' is no truth value"):
        save_calibration(ANNA, force="no")


def test_a_full_disk_leaves_what_was_there(folder, monkeypatch):
    before = save_calibration(ANNA).read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(HapticsError, match="No space left on device"):
        save_calibration(HandCalibration(name="anna", side="left"), force=True)
    assert [entry.name for entry in folder.iterdir()] == ["anna.toml"]
    assert (folder / "anna.toml").read_bytes() == before


def test_the_file_on_the_page_is_a_calibration(folder):
    (example,) = re.findall(r"^```toml\n(side.*?)^```$", PAGE.read_text("utf-8"), flags=re.M | re.S)
    written(folder, example)
    assert load_calibration("anna").offset_m == {"palm_index": (0.004, -0.002, 0.0)}


@pytest.mark.parametrize(
    ("platform", "variable", "expected"),
    [
        ("linux", "XDG_CONFIG_HOME", "wearable-haptics"),
        ("linux", None, "home/.config/wearable-haptics"),
        ("darwin", None, "home/Library/Application Support/wearable-haptics"),
        ("win32", "APPDATA", "wearable-haptics"),
        ("win32", None, "home/AppData/Roaming/wearable-haptics"),
    ],
)
def test_the_folder_is_the_platforms(tmp_path, monkeypatch, platform, variable, expected):
    for name in ("HAPTICS_CONFIG_FOLDER", "XDG_CONFIG_HOME", "APPDATA"):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, str(tmp_path))
    monkeypatch.setattr("sys.platform", platform)
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert config_folder() == tmp_path / expected
    assert calibrations_folder() == tmp_path / expected / "calibrations"
