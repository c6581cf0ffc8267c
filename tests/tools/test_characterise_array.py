"""A glove is characterised, and what drivers then believe of it is what it does."""

from __future__ import annotations

import contextlib
import importlib.util
import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import haptics
from haptics.errors import InputError
from haptics.session.configuration import Configuration, load_configuration
from rigs.bench import BenchOptions

pytestmark = pytest.mark.slow
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
    """One actuator, in this process: how places go to channels is looked at below without a bench."""
    folder, out = tmp_path_factory.mktemp("array"), io.StringIO()
    (folder / "glove.toml").write_text(BASE, encoding="utf-8")
    words = [
        "characterise_array.py",
        folder / "out.toml",
        "--config",
        folder / "glove.toml",
        "--sites",
        "index_tip",
        "--seed",
        "6",
    ]
    with pytest.MonkeyPatch.context() as patched, contextlib.redirect_stdout(out):
        patched.setattr("sys.argv", [str(word) for word in words])
        patched.setattr("rigs.thermal.rig.HEAT_S", 180.0)
        patched.setattr("rigs.thermal.rig.COOL_S", 120.0)
        patched.setattr("rigs.characterize.ProcessPoolExecutor", lambda mp_context: ThreadPoolExecutor(1))
        with pytest.raises(SystemExit) as stop:
            tool().main()
    assert stop.value.code == 0
    assert "index_tip: tau_s" in out.getvalue()
    return folder / "out.toml"


def test_each_place_is_measured_on_its_channel(monkeypatch):
    array = tool()
    ran = []
    monkeypatch.setattr(array, "run_jobs", lambda jobs, executor, progress: ran.extend(jobs) or tuple(range(len(jobs))))
    options = BenchOptions(seed=6, configuration=Configuration())
    assert array.measure("thermal", {"index_tip": 1, "palm_outer": 7}, options, input) == {"index_tip": 0, "palm_outer": 1}
    assert array.measure("pull", {"thumb": 2}, options, input) == {"thumb": 0}
    assert [(rig, job.channel, job.seed) for rig, job in ran] == [("thermal", 1, 6), ("thermal", 7, 6), ("pull", 2, 6)]


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
        plant = glove.devices.plant("tactiles")
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
    assert set(found.tactiles.calibration) == {"thumb_tip", "index_tip"}
    assert found.tactiles.calibration["thumb_tip"].tau_s == 99.0
    own = found.tactiles.calibration["index_tip"]
    assert 0 < own.tau_sd_s < 1
    assert 0.004 < own.c_sd_k_per_w / own.c_k_per_w < 0.01  # at least the thermocouple's gain
    assert own.power_sd_w == pytest.approx(0.003 * own.power_w, abs=1e-3)


def test_a_site_without_an_actuator_is_refused(script, tmp_path):
    code, _, err = script("characterise_array", tmp_path / "out.toml", "--sites", "elbow")
    assert code != 0
    assert "elbow" in err
    assert not (tmp_path / "out.toml").exists()


def test_a_calibration_that_no_driver_would_take_is_not_written():
    with pytest.raises(InputError, match="tau_s"):
        tool().written("", {"index_tip": {"tau_s": -3.0}}, {})
