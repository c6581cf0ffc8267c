"""``haptics calibrate`` and ``haptics calibration``: made, listed, shown, used, removed; what cannot be is refused."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HAPTICS_CONFIG_FOLDER", str(tmp_path / "configuration"))
    return tmp_path / "configuration" / "calibrations"


def test_a_calibration_is_made_listed_shown_and_removed(command, answer, folder):
    assert answer("calibration", "list") == {"folder": str(folder), "calibrations": []}
    made = answer("calibrate", "anna", "--hand", "routine")
    assert (made["name"], made["side"], made["path"], made["made_from"]) == (
        "anna",
        "right",
        str(folder / "anna.toml"),
        "routine",
    )
    assert made["tip_radius_m"]["index"] == pytest.approx(0.007, abs=0.3e-3)
    assert 0.5e-3 < made["tip_radius_sd_m"]["index"] < 1.5e-3
    (row,) = answer("calibration", "list")["calibrations"]
    assert (row["name"], row["side"], row["made_on"], row["fault"]) == ("anna", "right", made["made_on"], None)
    assert answer("calibration", "show", "anna") == made
    code, out, _ = command("calibration", "show", "anna")
    assert code == 0
    assert "mm ± 1.1 mm" in out
    assert str(folder / "anna.toml").replace("\n", "") in out.replace("\n", "")
    assert answer("calibration", "remove", "anna") == {"removed": str(folder / "anna.toml")}
    assert list(folder.iterdir()) == []


def test_one_that_is_there_is_overwritten_only_when_forced(command, refused, folder):
    assert command("calibrate", "anna", "--hand", "routine")[0] == 0
    before = (folder / "anna.toml").read_bytes()
    assert "exists and is not overwritten" in refused("calibrate", "anna", "--hand", "routine")
    assert (folder / "anna.toml").read_bytes() == before
    assert command("calibrate", "anna", "--hand", "routine", "--force")[0] == 0


def test_a_broken_file_hides_no_other(command, answer, folder):
    assert command("calibrate", "anna", "--hand", "routine")[0] == 0
    (folder / "bertha.toml").write_text("side = 3\n")
    anna, bertha = answer("calibration", "list")["calibrations"]
    assert (anna["name"], anna["fault"]) == ("anna", None)
    assert bertha["fault"].startswith(f"{folder / 'bertha.toml'}:1: side = 3 is not allowed")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("calibrate", "../anna", "--hand", "routine"), "NAME = '../anna'; expected 1 to 64 letters"),
        (("calibrate", "anna", "--hand", "synthetic"), "hand synthetic: the pose flat is missing"),
        (("calibrate", "anna", "--hand", "nowhere.h5"), "does not exist"),
        (("calibrate", "anna", "--hand", "routine", "--side", "left"), "no pose of the left hand"),
        (
            ("calibrate", "anna", "--hand", "routine", "--side", "both"),
            "--side = 'both' is not allowed; allowed: auto, left, right",
        ),
        (("calibrate", "anna"), "--hand"),
        (("calibration", "show", "anna"), "calibration 'anna' is not in"),
        (("calibration", "remove", "../anna"), "NAME = '../anna'"),
        (("run", "playground", "--calibration", "anna"), "calibration 'anna' is not in"),
        (("run", "playground", "--calibration", "a/b"), "a/b"),
    ],
)
def test_what_cannot_be_is_refused(refused, folder, arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in " ".join(refused(*arguments).split())
    assert not folder.exists()


def test_a_configuration_names_whose_hand_it_is(command, tmp_path):
    (tmp_path / "glove.toml").write_text('hand_calibration = "anna"\n')
    assert ", calibration anna" in command("config", "check", tmp_path / "glove.toml")[1]
    (tmp_path / "glove.toml").write_text('side = "left"\n')
    assert "calibration" not in command("config", "check", tmp_path / "glove.toml")[1]
