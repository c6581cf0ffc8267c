"""A glove is characterised, and what drivers then believe of it is what it does."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

import haptics
from haptics.errors import InputError
from haptics.session.configuration import load_configuration

pytestmark = pytest.mark.xdist_group("array")
TOOLS = Path(__file__).resolve().parents[2] / "tools"
BASE = """# my glove
side = "right"

[tactiles]
port = "sim://tactiles?seed=6"    # the one on the bench
rise_limit_k = 30.0

[tactiles.calibration.thumb_tip]
tau_s = 99.0
"""


def tool():
    spec = importlib.util.spec_from_file_location("characterise_array", TOOLS / "characterise_array.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("array")
    (folder / "glove.toml").write_text(BASE, encoding="utf-8")
    words = [sys.executable, TOOLS / "characterise_array.py", folder / "out.toml", "--config", folder / "glove.toml"]
    done = subprocess.run(
        [*words, "--sites", "index_tip,palm_outer", "--seed", "6"], capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "index_tip: tau_s" in done.stdout
    return folder / "out.toml"


def felt_and_believed(config: Path, site: str, channel: int) -> tuple[float, float]:
    """Rise of a busy actuator: of the plant, and as the driver's budget has it."""
    with haptics.open(str(config), clock="virtual", seed=6) as glove:
        glove.arm()
        for _ in range(150):
            glove.contact(site)
            glove.advance(0.25)
            glove.release(site)
            glove.advance(0.25)
        believed_k = glove.state().rise_k[site]
        plant = glove._glove.plant("tactiles")
        assert plant is not None
        return plant.truth()["rise_k"][channel], believed_k


def test_a_calibrated_budget_is_nearer_to_the_plant_than_one_without_and_not_below_it(calibrated, tmp_path):
    (tmp_path / "published.toml").write_text(BASE, encoding="utf-8")
    felt_k, believed_k = felt_and_believed(calibrated, "index_tip", 1)
    _, before_k = felt_and_believed(tmp_path / "published.toml", "index_tip", 1)
    # Three standard deviations of gain, power and fit above what was measured, which may itself be as much off.
    assert felt_k <= believed_k < 1.03 * felt_k
    assert abs(before_k - felt_k) > 2.0 * abs(believed_k - felt_k)


def test_what_was_not_measured_stays_as_it_was(calibrated):
    text = calibrated.read_text(encoding="utf-8")
    assert "# my glove" in text
    assert "# the one on the bench" in text
    found = load_configuration(calibrated)
    assert (found.side, found.tactiles.rise_limit_k) == ("right", 30.0)
    assert set(found.tactiles.calibration) == {"thumb_tip", "index_tip", "palm_outer"}
    assert found.tactiles.calibration["thumb_tip"].tau_s == 99.0
    own = found.tactiles.calibration["index_tip"]
    assert 0 < own.tau_sd_s < 1
    assert 0.004 < own.c_sd_k_per_w / own.c_k_per_w < 0.01  # at least the thermocouple's gain
    assert own.power_sd_w == pytest.approx(0.003 * own.power_w, abs=1e-3)


def test_a_site_without_an_actuator_is_refused(tmp_path):
    words = [sys.executable, TOOLS / "characterise_array.py", tmp_path / "out.toml", "--sites", "elbow"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode != 0
    assert "elbow" in done.stderr
    assert not (tmp_path / "out.toml").exists()


def test_a_calibration_that_no_driver_would_take_is_not_written():
    with pytest.raises(InputError, match="tau_s"):
        tool().written("", {"index_tip": {"tau_s": -3.0}}, {})
