"""One break of safety code on purpose, and how it is tried: in a copy of the tree, against the tests that must turn red."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
COPIED = ("haptics", "firmware_models", "rigs", "tests", "docs", "pyproject.toml")
KILLED, SURVIVED, INVALID = "killed", "SURVIVED", "INVALID"
_FAILED, _PASSED = 1, 0  # pytest's exit codes; any other says that the tests did not run
_TEST_TIMEOUT_S, _RUN_TIMEOUT_S = 60, 600
_CORE = "firmware_models/firmware"


@dataclass(frozen=True)
class Break:
    """A few characters of one file replaced.

    :param name: what the broken code does.
    :param path: the file, from the root of the tree.
    :param old: what stands there; exactly once, or the break does not apply and the run fails.
    :param harm: what a person would feel, or lose.
    :param tests: arguments of pytest that select the tests which must find it.
    """

    name: str
    path: str
    old: str
    new: str
    harm: str
    tests: str

    def broken(self, root: Path = ROOT) -> str:
        """The file's text with the break in it.

        :raises LookupError: the break no longer applies.
        """
        text = (root / self.path).read_text(encoding="utf-8")
        found = text.count(self.old)
        if found != 1:
            raise LookupError(f"{self.path} has {found} places that read {self.old!r}; it must be exactly one")
        return text.replace(self.old, self.new)


class Result(NamedTuple):
    """What came of one break; ``seen``: the test that found it, or why it could not be tried."""

    outcome: str
    seen: str
    seconds: float


def in_file(path: str, tests: str, *rows: tuple[str, str, str, str] | tuple[str, str, str, str, str]) -> list[Break]:
    """Breaks of one file: name, harm, old, new and, where others than ``tests`` must find it, these."""
    return [Break(name, path, old, new, harm, *(own or [tests])) for name, harm, old, new, *own in rows]


@contextmanager
def copied_tree() -> Iterator[Path]:
    """A copy of what the tests need; the tree itself is never touched."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree = Path(folder) / "tree"
        tree.mkdir()
        for name in COPIED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, tree / name)
            else:
                shutil.copy2(source, tree / name)
        yield tree


def try_break(one: Break, tree: Path) -> Result:
    """Break the copy, run the tests, mend the copy."""
    begun = time.perf_counter()
    outcome, seen = _try(one, tree)
    return Result(outcome, seen, time.perf_counter() - begun)


def run_tests(tests: str, tree: Path) -> tuple[int, str]:
    """Exit code of pytest in the copy, and the first test that failed (or the end of what was printed)."""
    options = ["-x", "-q", "-n", "0", "--tb=no", "-rfE", "-p", "no:cacheprovider"]
    options += [f"--timeout={_TEST_TIMEOUT_S}", "--timeout-method=thread"]  # a broken core may hang in C
    environment = {name: value for name, value in os.environ.items() if name != "HAPTICS_FORBID_SKIPS"}
    environment |= {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "HAPTICS_CACHE": str(tree / "cache")}
    environment["CI"] = "1"  # hypothesis: the same examples each time, and as long as they take
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *options, *shlex.split(tests)],
            cwd=tree,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=_RUN_TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        return _FAILED, f"hung for {_RUN_TIMEOUT_S} s"
    lines = done.stdout.strip().splitlines()
    failed = [line for line in lines if line.startswith(("FAILED ", "ERROR "))]
    return done.returncode, failed[0] if failed else " ".join(lines[-1:] + done.stderr.strip().splitlines()[-1:])


def _try(one: Break, tree: Path) -> tuple[str, str]:
    target = tree / one.path
    try:
        text = one.broken(tree)
    except LookupError as error:
        return INVALID, f"does not apply: {error}"
    sound, times = target.read_bytes(), target.stat()
    target.write_text(text, encoding="utf-8")
    try:
        wrong = _unbuildable(one, text, tree)
        if wrong:
            return INVALID, f"does not build: {wrong}"
        code, seen = run_tests(one.tests, tree)
    finally:
        target.write_bytes(sound)
        os.utime(target, ns=(times.st_atime_ns, times.st_mtime_ns))  # what Python compiled of it still counts
    if code == _FAILED:
        return KILLED, seen
    return (SURVIVED, seen) if code == _PASSED else (INVALID, f"pytest ended with {code}: {seen}")


def _unbuildable(one: Break, text: str, tree: Path) -> str:
    """Why the broken code is none; a compiler's complaint must not pass for a test that found something."""
    if one.path.endswith(".py"):
        try:
            compile(text, one.path, "exec")
        except SyntaxError as error:
            return str(error)
        return ""
    with tempfile.TemporaryDirectory() as out:
        command = ["make", "--silent", "-C", str(tree / _CORE), "host", f"OUT={out}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stderr.strip() if done.returncode else ""
