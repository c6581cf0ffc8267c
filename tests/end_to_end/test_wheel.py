"""What is installed from the wheel runs by itself, far from the checkout, with all its data."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


CHECKOUT = Path(__file__).parents[2]
PACKAGES = ("haptics", "firmware_models", "rigs")


def run(*command: object, cwd: Path, **more: str) -> str:
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env={**environment, **more}, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built without a look at any registry where the builder is installed."""
    folder = tmp_path_factory.mktemp("wheel")
    isolation = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", *isolation, "--wheel-dir", folder, CHECKOUT, cwd=folder)
    (built,) = folder.glob("wearable_haptics-*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scripts folder of a new environment with the wheel in it.

    Its dependencies are lent by this environment: a path file adds the folder and, unlike a site folder, none of the path
    files in it, so that an editable install of the checkout stays unseen.
    """
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=os.name != "nt")
    paths = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})
    scripts = Path(paths["scripts"])
    python = scripts / Path(sys.executable).name
    run(sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel, cwd=folder)
    lent = {sysconfig.get_paths()[kind] for kind in ("purelib", "platlib")}
    (Path(paths["purelib"]) / "lent.pth").write_text("".join(f"{path}\n" for path in lent))
    return scripts


def test_every_file_of_the_packages_is_in_the_wheel(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    in_checkout = {
        path.relative_to(CHECKOUT).as_posix()
        for package in PACKAGES
        for path in (CHECKOUT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {"haptics/scene/data/playground.toml", "haptics/py.typed", "firmware_models/protocol_sim.py"} <= names
    assert in_checkout == {name for name in names if ".dist-info/" not in name}
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_nothing_is_imported_from_the_checkout(installed, tmp_path):
    show = f"import {', '.join(PACKAGES)}; print(*({', '.join(f'{name}.__file__' for name in PACKAGES)}), sep=chr(10))"
    files = run(installed / "python", "-c", show, cwd=tmp_path).splitlines()
    for file, package in zip(files, PACKAGES, strict=True):
        assert Path(file).parent.name == package
        assert not Path(file).is_relative_to(CHECKOUT)
        assert Path(file).is_relative_to(installed.parent)


def test_the_main_job_runs_from_the_wheel(installed, tmp_path):
    report = json.loads(run(installed / "haptics", "run", "playground", "--hand", "synthetic", "--json", cwd=tmp_path))
    assert report["contacts"] > 0
    assert report["grasps"] == 1
    assert report["faults"] == []
    (recording,) = tmp_path.iterdir()
    assert recording.name.startswith("playground-")
    assert str(tmp_path / report["recording"]) == str(recording)


def test_the_boards_command_and_the_scenes_came_along(installed, tmp_path):
    assert "trace" in run(installed / "haptics", "link", "simulate", "--help", cwd=tmp_path, COLUMNS="120")
    names = {scene["name"] for scene in json.loads(run(installed / "haptics", "scenes", "--json", cwd=tmp_path))["scenes"]}
    assert names == {path.stem for path in (CHECKOUT / "haptics" / "scene" / "data").glob("*.toml")}


def test_the_firmwares_sources_came_along(installed, tmp_path):
    if shutil.which("cc") is None or shutil.which("make") is None:
        pytest.skip("no cc or make here: the C core cannot be built")
    port = "sim://tactiles?core=c"
    said = json.loads(
        run(installed / "haptics", "link", "identify", "--port", port, "--json", cwd=tmp_path, HAPTICS_CACHE=str(tmp_path))
    )
    assert (said["board"], said["build"]) == ("tactiles", "host-c")
    assert list(tmp_path.rglob("libcore.so"))


def test_a_garment_is_designed_with_the_core_alone(installed, tmp_path):
    asked = ("--garment", "sleeve", "--motion", "elbow_flexion", "--coverage", "0.9", "--level", "coarse")
    said = json.loads(run(installed / "haptics", "garment", "design", *asked, "--out", "sleeve", "--json", cwd=tmp_path))
    assert said["faults"] == []
    assert said["steps"] == said["converged_steps"] > 7
    assert said["density_increase"] > 1
