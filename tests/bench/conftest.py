"""One ledger for the whole run of benchmarks: printed at its end, and its ratios kept."""

from __future__ import annotations

import pytest
from ledger import Ledger, history, keep, table

_LEDGER = Ledger()


@pytest.fixture(scope="session")
def bench() -> Ledger:
    """Takes figures and ratios."""
    return _LEDGER


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not _LEDGER.entries:
        return
    terminalreporter.section("benchmarks: ratios side by side; indented figures are this machine's")
    for line in table(_LEDGER.entries, history()):
        terminalreporter.write_line(line)
    keep(_LEDGER.entries)
