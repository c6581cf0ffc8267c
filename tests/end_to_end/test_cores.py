"""The main job on each firmware: a driver cannot tell them apart, but by what ``identify`` says."""

from __future__ import annotations

import ctypes.util
import json
import shutil

import pytest

MISSING = [tool for tool in ("cc", "make", "avr-gcc") if shutil.which(tool) is None]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(MISSING) or ctypes.util.find_library("simavr") is None,
        reason=f"not all firmwares run here: {MISSING or 'libsimavr'}",
    ),
]
EDGE_MS = 0.01  # an edge is at most 10 us late (docs/reference/boards.md)
CLOCK_MS = 0.01  # how far two boards' clock fits may differ: their sync stamps are that exact
# A volt rounded to what the setpoint's converter has, a wave's edges, and heat by pulses a few us longer.
CLOSE = {"peak_volts": 1e-3, "peak_force_n": 2e-3, "energy_j": 1e-3, "peak_rise_k": 1e-3, "headroom_k": 1e-4}


@pytest.fixture(scope="module")
def reports(tmp_path_factory) -> dict[str, dict]:
    from typer.testing import CliRunner

    from haptics.cli.main import app

    found = {}
    for core in ("py", "c", "avr"):
        ports = [f"--port-{board}=sim://{board}?core={core}" for board in ("tactiles", "brake")]
        out = tmp_path_factory.mktemp(core) / "job.h5"
        done = CliRunner().invoke(app, ["run", "playground", "--hand", "synthetic", "--json", "--out", str(out), *ports])
        assert done.exit_code == 0, done.output
        found[core] = json.loads(done.stdout)
    return found


def differences(a, b, path: str = ""):
    """Where two reports differ: path and both values."""
    if isinstance(a, dict) and isinstance(b, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            yield from differences(a[key], b[key], f"{path}/{key}")
    elif isinstance(a, list) and isinstance(b, list):
        assert len(a) == len(b), path
        for index, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from differences(one, other, f"{path}/{index}")
    elif a != b:
        yield path, a, b


@pytest.mark.parametrize("core", ["c", "avr"])
def test_the_main_job_reports_the_same_on_every_firmware(reports, core) -> None:
    assert reports["py"]["contacts"] > 0
    assert reports["py"]["grasps"] == 1
    assert reports["py"]["faults"] == []
    for path, python, other in differences(reports["py"], reports[core]):
        name = path.rsplit("/", 1)[-1]
        if path == "/recording":
            continue
        if name in CLOSE:
            assert other == pytest.approx(python, rel=CLOSE[name]), path
        elif name == "median_mm":
            assert other == pytest.approx(python, rel=1e-3), path
        else:
            assert path.startswith("/onset_error_ms/"), path
            assert abs(other - python) <= EDGE_MS + CLOCK_MS, path
