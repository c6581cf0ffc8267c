"""Shared fixtures. Recorded hands are read where they lie beside the checkout; everything else is made by the project."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PLACES = (CHECKOUT.parent / "shared" / "recordings", CHECKOUT / "shared" / "recordings")

# A shell's background job ignores Ctrl-C, under nohup SIGHUP too, and so would every process that a test starts.
for _signal, _handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    _number = getattr(signal, _signal, None)
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _handler)


@pytest.fixture(scope="session", autouse=True)
def own_configuration_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test reads or writes what the person who runs the tests keeps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HAPTICS_CONFIG_FOLDER", str(tmp_path_factory.mktemp("configuration")))
        yield


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of recorded hands; `HAPTICS_RECORDINGS` names another."""
    named = os.environ.get("HAPTICS_RECORDINGS")
    for folder in (Path(named),) if named else PLACES:
        if (folder / "grab.leap.json.gz").is_file():
            return folder
    pytest.skip("no recorded hands beside the checkout; set HAPTICS_RECORDINGS to a folder that has them")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Where `HAPTICS_FORBID_SKIPS` is set, a skipped test fails the run: nothing may hide behind a missing package."""
    if not os.environ.get("HAPTICS_FORBID_SKIPS") or hasattr(session.config, "workerinput"):
        return
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    skipped = reporter.stats.get("skipped", []) if reporter else []
    if skipped and session.exitstatus == 0:
        reporter.write_line(f"{len(skipped)} tests were skipped and HAPTICS_FORBID_SKIPS is set", red=True)
        session.exitstatus = 1
