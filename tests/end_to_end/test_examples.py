"""Each example runs as it stands, from any folder, and says what it is there to show."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene

pytestmark = pytest.mark.slow


EXAMPLES = Path(__file__).parents[2] / "examples"
SHOWN = {
    "engine_loop.py": [
        r"1\.3\d s: 100\d V; the index brake holds 9\.\d N\n",
        r"grasp_begin +ball",
        r"(\d+) of \1 taps played; 0 poses refused",
    ],
    "glove_basics.py": [
        r"pins out: index_tip\n",
        r"pins out: none; brake at 0 V",
        r"(palm_index +pulse +(played|denied).*\n){2}",
    ],
    "many_gloves.py": [r"5\.0 V: 100\.00 % .*in +6\.\d+ ms", r"3\.5 V: +[56]\d\.\d+ %", r"3\.0 V: +0\.00 %"],
    "own_scene.py": [r"touch +index_tip drum", r"release +index_tip drum", r"(\d+) of \1 pulses played"],
    "predict.py": [
        r" 49 switches a minute.*none denied",
        r"120 switches a minute.*first denied after 16[56] s",
        r"in 6\.0 ms",
        r"breakdown",
    ],
    "read_recording.py": [
        r"tennis with synthetic; complete",
        r"peak volts +3\d\d\.\d+ V",
        r"touch +\w+ ball",
        r"bytes on the link",
    ],
}


def test_every_example_is_run():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_runs_and_shows(name, tmp_path):
    arguments = []
    if name == "read_recording.py":
        run_scene("tennis", "synthetic", Configuration(), RunOptions(out=tmp_path / "run.h5"))
        arguments = ["run.h5"]
    command = [sys.executable, "-W", "error", str(EXAMPLES / name), *arguments]
    before = set(tmp_path.iterdir())
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for pattern in SHOWN[name]:
        assert re.search(pattern, done.stdout), done.stdout
    assert set(tmp_path.iterdir()) == before
