"""``haptics characterize``: the numbers, the files, the page, and what happens when something is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shorter
import typer
from typer.testing import CliRunner

from haptics.errors import InputError
from haptics.recording import load
from rigs.bench import BenchOptions
from rigs.characterize import Characterisation, characterize
from rigs.commands import characterize as characterize_command

pytestmark = pytest.mark.slow


def haptics(*words: object) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "haptics.cli.main", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)


@pytest.fixture(scope="module")
def thermal(tmp_path_factory) -> tuple[dict, Path]:
    """The command in this process, where the rig can be shorter."""
    out = tmp_path_factory.mktemp("thermal") / "bench"
    command = typer.Typer()
    command.command()(characterize_command)
    words = ["thermal", "--port", "sim://tactiles?tau_s=88", "--seed", "5", "--out", str(out), "--json"]
    with pytest.MonkeyPatch.context() as patch:
        shorter.thermal(patch.setattr, heat_s=150.0, cool_s=120.0)
        done = CliRunner().invoke(command, words)
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout), out


def test_the_numbers_are_those_of_the_contract(thermal):
    found, _ = thermal
    assert {"tau_s", "tau_s_sd", "c_k_per_w", "c_sd", "rise_max_k", "chi2_reduced", "files"} <= set(found)
    assert found["tau_s"] == pytest.approx(88.0, abs=4 * found["tau_s_sd"])
    assert 0.9 < found["chi2_reduced"] < 1.1
    assert found["faults"] == []
    assert all(one["within"] for one in found["measured"])


def test_recording_pictures_page_and_numbers_are_written(thermal):
    found, out = thermal
    assert {Path(name).name for name in found["files"]} == {path.name for path in out.iterdir()}
    assert {path.suffix for path in out.iterdir()} == {".h5", ".png", ".html", ".json"}
    assert json.loads((out / "thermal.json").read_text())["tau_s"] == found["tau_s"]
    assert load(out / "thermal.h5").complete
    for picture in out.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_page_shows_published_and_measured_with_units_in_a_browser(thermal, browser):
    _, out = thermal
    page = browser.look(out / "thermal.html", height=2600)
    seen = page.seen
    words = [word for figure in seen["figures"] for word in figure["words"]]
    assert {"time (s)", "temperature (°C)", "residual (K)", "power (W)", "measured", "fit"} <= set(words)
    assert any("published" in word for word in words)
    assert not [figure["outside"] for figure in seen["figures"] if figure["outside"]]
    assert not seen["wide"]
    for colour in ((213, 94, 0), (0, 158, 115)):  # fit, published
        assert page.count(*colour) > 100


def test_what_exists_is_not_overwritten_unless_forced(thermal):
    _, out = thermal
    refused = haptics("characterize", "thermal", "--out", out)
    assert refused.returncode == 2
    assert "exists and is not overwritten" in refused.stderr


def test_a_fault_leaves_no_numbers_and_fails(tmp_path):
    command = typer.Typer()
    command.command()(characterize_command)
    words = ["response", "--loadcell", "sim://loadcell?full_scale_n=5", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(command, words)
    assert done.exit_code == 1
    found = json.loads(done.stdout)
    assert found["faults"][0]["what"] == "load_cell_off_scale"
    assert found["response_s"] is None
    assert found["chi2_reduced"] is None
    assert (tmp_path / "response.html").exists()
    assert load(tmp_path / "response.h5").complete


@pytest.fixture(scope="module")
def alone(tmp_path_factory) -> tuple[Characterisation, Path]:
    """One device in this process."""
    out = tmp_path_factory.mktemp("alone")
    return characterize("response", BenchOptions(seed=20), out=out), out


def test_several_devices_give_mean_scatter_and_each_in_the_same_numbers_as_alone(alone, tmp_path):
    together = characterize("response", BenchOptions(seed=20), devices=2, out=tmp_path)
    values = [one.quantities["response_s"].value for one in (alone[0], characterize("response", BenchOptions(seed=21)))]
    assert [r.quantities["response_s"].value for r in together.results] == values
    assert together.quantities["response_s"].value == pytest.approx(np.mean(values), rel=1e-12)
    assert together.quantities["response_s"].sd == pytest.approx(np.std(values, ddof=1), rel=1e-9)
    assert len(together.to_json()["each"]) == 2
    assert {path.name for path in tmp_path.glob("*.h5")} == {"response-0.h5", "response-1.h5"}
    # Another process, with strings hashed otherwise, records the same bytes.
    assert (tmp_path / "response-0.h5").read_bytes() == (alone[1] / "response.h5").read_bytes()


def test_the_same_seed_gives_the_same_bytes(alone, tmp_path):
    characterize("response", BenchOptions(seed=20, record=None), out=tmp_path)
    for name in ("response.html", "response.h5", "response-grip.png"):
        assert (tmp_path / name).read_bytes() == (alone[1] / name).read_bytes()


def test_what_cannot_be_run_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"rig = 'heat' is not allowed; allowed: thermal, pendulum"):
        characterize("heat", BenchOptions())
    with pytest.raises(InputError, match="devices = 0"):
        characterize("thermal", BenchOptions(), devices=0)
    with pytest.raises(InputError, match="not allowed on hardware"):
        characterize("thermal", BenchOptions(port="/dev/ttyACM9"), devices=3)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="there is no folder"):
        characterize("thermal", BenchOptions(), out=tmp_path / "file" / "x")
