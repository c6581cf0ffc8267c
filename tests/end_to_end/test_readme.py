"""README, tutorial and the page of commands keep their word: what they show runs as pasted, in order, in one folder."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from pages import CHECKOUT, blocks, commands, needs_hardware

README, TUTORIAL = CHECKOUT / "README.md", CHECKOUT / "docs" / "tutorial.md"
COMMANDS = CHECKOUT / "docs" / "reference" / "commands.md"
SETUP = (["make", "demo"], ["make", "test"], [".", ".venv/bin/activate"])
CHEAP = {
    "run desk": "run tennis",
    "--frames 100": "--frames 20",
    "--for-s 1": "--for-s 0.05",
}
"""The same in less time."""
ELSEWHERE = ("characterize", "validate", "tolerance", "garment", "fidelity prove", "fidelity stress", "link conformance")
"""Commands that take seconds to minutes; ``tests/rigs``, ``tests/cli`` and ``tests/fidelity`` run them at their own sizes."""


def run_page(page: Path, haptics, monkeypatch, folder: Path) -> list[str]:
    """Run a page's commands, but for set-up, hardware and what runs elsewhere; returns those that ran."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HAPTICS_CONFIG_FOLDER", str(folder))
    done = []
    for words in commands(page):
        line = shlex.join(words[1:])
        if words in SETUP or needs_hardware(words) or line.startswith(ELSEWHERE):
            continue
        assert words[0] == "haptics", words
        for slow, fast in CHEAP.items():
            line = line.replace(slow, fast)
        finished = haptics(*shlex.split(line))
        assert finished.code == 0, f"{shlex.join(words)}\n{finished.err}"
        assert finished.out.strip() or "--out" in words
        done.append(line)
    return done


def run_python(page: Path) -> None:
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), {})


def test_the_readme_runs_as_pasted(haptics, capsys, tmp_path, monkeypatch):
    ran = run_page(README, haptics, monkeypatch, tmp_path)
    assert ran == ["scenes", "run playground --hand synthetic --out playground.h5 --force"]
    run_python(README)
    out = capsys.readouterr().out
    left_k = 25 - (0.010 + 10 * 0.006) * (25 / 1.28) * (79 / 97)  # a stroke of arming, ten pulses of 6 ms
    (printed,) = re.findall(r"\('index_tip',\) 4\.0 (\S+)", out)
    assert float(printed) == pytest.approx(left_k, abs=0.01)


def test_the_readme_is_read_in_minutes():
    assert len(README.read_text(encoding="utf-8").split()) < 700


@pytest.mark.slow
def test_the_tutorial_runs_as_pasted_and_ends_in_a_felt_grasp(haptics, capsys, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="extra `report`")
    (ball,) = blocks(TUTORIAL, "toml")
    (tmp_path / "ball.toml").write_text(ball, encoding="utf-8")
    ran = run_page(TUTORIAL, haptics, monkeypatch, tmp_path)
    assert [line.split()[0] for line in ran] == ["run", "recording", "replay"]
    assert (tmp_path / "ball.png").read_bytes().startswith(b"\x89PNG")
    run_python(TUTORIAL)
    out = capsys.readouterr().out
    assert re.search(r"^\d\.\d{3} s  grasp_begin", out, re.MULTILINE)
    assert "pins out: thumb_tip, index_tip, middle_tip; " in out


@pytest.mark.slow
def test_what_the_tutorial_says_of_its_grasp_is_so(haptics, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    report = haptics("run", CHECKOUT / "examples" / "ball.toml", "--out", "ball.h5", "--json").json
    index = report["brakes"][0]
    assert (report["contacts"], report["grasps"], list(report["pulses"]["denied"])) == (4, 1, ["contact"])
    assert 8.5 < index["peak_force_n"] < 10.0
    assert round(index["peak_volts"], -2) == 1000.0
    assert index["energy_j"] == pytest.approx(0.051, abs=0.002)
    (ball,) = blocks(TUTORIAL, "toml")
    assert ball.partition("\n")[2] == (CHECKOUT / "examples" / "ball.toml").read_text(encoding="utf-8").partition("\n")[2]


@pytest.mark.slow
def test_the_page_of_commands_runs_as_pasted(haptics, tmp_path, monkeypatch):
    (tmp_path / "glove.toml").write_text('side = "left"\n', encoding="utf-8")
    from haptics.recording import Journal

    with Journal.create(tmp_path / "crashed.journal", {"seed": 1}) as journal:
        journal.blob("glove.toml", b"x")
        journal.commit()
    assert len(run_page(COMMANDS, haptics, monkeypatch, tmp_path)) > 20


@pytest.mark.slow
def test_make_firmware_builds_both_images():
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed: no image can be built")
    done = subprocess.run(["make", "-B", "firmware"], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stdout + done.stderr
    for board in ("tactiles", "brake"):
        assert re.search(rf"^{board}: \d+ of 28672 bytes of flash, \d+ of 1638 bytes of RAM", done.stdout, re.MULTILINE)
        assert (CHECKOUT / "build" / "firmware" / f"{board}.hex").read_text().startswith(":")


def test_make_demo_says_what_it_does_before_it_takes_long():
    done = subprocess.run(["make", "-n", "-B", "demo"], cwd=CHECKOUT, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    install = next(place for place, line in enumerate(lines) if "pip install -c" in line)
    play = next(place for place, line in enumerate(lines) if "haptics run examples/ball.toml" in line)
    assert "--quiet" not in lines[install]
    assert any("installing" in line for line in lines[:install])
    assert "compiled" in lines[play - 1]


def test_pictures_on_the_readme_are_there():
    for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README.read_text(encoding="utf-8")):
        assert (CHECKOUT / target).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
