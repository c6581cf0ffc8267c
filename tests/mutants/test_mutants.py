"""The breaks themselves, and a sample of them tried: the rest is for ``make mutants``."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from breaks import BREAKS
from mutant import INVALID, KILLED, ROOT, SURVIVED, Break, copied_tree, run_tests, try_break

pytestmark = pytest.mark.slow


SAMPLE = (
    "a lid that opens while nothing is driven leaves it armed",
    "has no limit of its charge",
    "C: arms over a latched fault",
    "disarming leaves what waits",
    "believes in a pin that never moved",
    "the host goes on scheduling after the board disarmed",
    "the rise limit of the file does not reach the accounts",
    "a torn write stays in the file",
)


def named(name: str) -> Break:
    (one,) = (one for one in BREAKS if one.name == name)
    return one


def test_every_break_still_applies_and_says_what_it_would_do() -> None:
    """A break whose place has gone must be written anew, where the code now keeps that promise."""
    for one in BREAKS:
        assert one.broken() != (ROOT / one.path).read_text(encoding="utf-8"), one.name
        assert one.harm
        assert one.tests.startswith("tests/")


def test_there_are_as_many_breaks_as_safety_asks_for_each_of_its_own_name() -> None:
    assert len({(one.path, one.name) for one in BREAKS}) == len(BREAKS) >= 60
    rooms = {one.path.rsplit("/", 1)[0] for one in BREAKS}
    assert rooms >= {
        "firmware_models/boards",
        "firmware_models/firmware/core",
        *(f"haptics/{room}" for room in ("link", "scheduling", "devices", "session", "rendering", "recording")),
    }


@pytest.mark.parametrize("name", SAMPLE)
def test_a_break_is_found(name: str) -> None:
    one = named(name)
    if one.path.endswith(".c") and not (shutil.which("cc") and shutil.which("make")):
        pytest.skip("cc and make are needed to break the C core")
    with copied_tree() as tree:
        assert run_tests(one.tests, tree)[0] == 0, "red already on the unbroken code"
        result = try_break(one, tree)
        assert result.outcome == KILLED, result.seen
        assert (tree / one.path).read_bytes() == (ROOT / one.path).read_bytes()


def test_what_no_test_finds_survives_and_what_cannot_be_tried_passes_for_nothing(tmp_path: Path) -> None:
    """On tests of one line, in a tree of one file."""
    (tmp_path / "sum.py").write_text("TOTAL = 1 + 2\n")
    (tmp_path / "test_sum.py").write_text("from sum import TOTAL\n\n\ndef test_total():\n    assert TOTAL > 0\n")
    sound = Break("", "sum.py", "1 + 2", "2 + 2", "", "test_sum.py")
    outcomes = [
        try_break(one, tmp_path).outcome
        for one in (
            sound,
            replace(sound, new="0"),
            replace(sound, new="("),
            replace(sound, old="3"),
            replace(sound, tests="test_sum.py -k nothing"),
            replace(sound, tests="test_other.py"),
        )
    ]
    assert outcomes == [SURVIVED, KILLED, INVALID, INVALID, INVALID, INVALID]
