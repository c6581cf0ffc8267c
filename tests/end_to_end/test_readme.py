"""The README keeps its word: every command in it runs, its Python runs, and what it points at is there."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[2]
TEXT = (CHECKOUT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, flags=re.MULTILINE | re.DOTALL)


def commands() -> list[list[str]]:
    lines = [shlex.split(line, comments=True) for block in blocks("sh") for line in block.splitlines()]
    return [words for words in lines if words]


def needs_hardware(words: list[str]) -> bool:
    return words == ["haptics", "off"] or any("/dev/" in word for word in words)


def test_every_command_in_the_readme_runs(haptics, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    known = [words for words in commands() if words[0] == "haptics"]
    assert len(known) >= 10
    for words in known:
        if not needs_hardware(words):
            done = haptics(*words[1:])
            assert done.code == 0, f"{shlex.join(words)}\n{done.err}"
            assert done.out.strip()


def test_the_readme_uses_no_command_that_this_test_does_not_know():
    assert {words[0] for words in commands()} == {"haptics", "make"}


def test_commands_for_hardware_exist_too(haptics):
    for words in commands():
        if words[0] == "haptics" and needs_hardware(words):
            allowed = haptics(*words[1:], "--help")
            assert allowed.code == 0
            for option in (word for word in words if word.startswith("--")):
                assert option in allowed.out, shlex.join(words)


def test_make_firmware_builds_both_images():
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed: no image can be built")
    done = subprocess.run(["make", "-B", "firmware"], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stdout + done.stderr
    for board in ("tactiles", "brake"):
        assert re.search(rf"^{board}: \d+ of 28672 bytes of flash, \d+ of 1638 bytes of RAM", done.stdout, re.MULTILINE)
        assert (CHECKOUT / "build" / "firmware" / f"{board}.hex").read_text().startswith(":")


def test_every_make_target_in_the_readme_exists():
    targets = set(re.findall(r"^([a-z-]+):", (CHECKOUT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    named = {words[1] for words in commands() if words[0] == "make"} | set(re.findall(r"`make ([a-z-]+)`", TEXT))
    assert {"demo", "test"} <= named <= targets


def test_the_python_in_the_readme_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), {})
    out = capsys.readouterr().out
    assert "pins_out=('index_tip',)" in out
    assert "faults=()" in out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)", TEXT))))
def test_what_the_readme_points_at_is_there(target):
    if "://" not in target:
        path = CHECKOUT / target
        assert path.exists()
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
