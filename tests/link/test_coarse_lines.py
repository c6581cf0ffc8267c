"""A line that is too coarse to schedule is called so where one looks at it, before anything is played over it."""

from __future__ import annotations

import pytest

from haptics.link.commands import CommandWindow, Pending
from haptics.link.messages import Status
from haptics.link.runner import connect, finish
from haptics.link_trial.monitor import identify, open_link

MS = 1_000_000


@pytest.mark.parametrize(
    ("delay_ms", "said"),
    [
        (0, "good: clock known within 0."),
        (2, "coarse: clock known within 2"),
        (10, "coarse: clock known within 1"),
        (45, "too coarse to schedule: clock known within 4"),
    ],
)
def test_identify_says_whether_a_line_can_be_scheduled_over(delay_ms, said):
    line = identify(f"sim://tactiles?clock=virtual&faults=delay=1,delay_ms={delay_ms}").line
    assert line.startswith(said)
    assert ("latency timer to 1 ms" in line) == (delay_ms > 0)
    assert ("25 ms needed" in line) == (delay_ms == 45)
    assert ("to measure by" in line) == (delay_ms == 10)


def test_a_command_that_waited_until_it_can_only_be_late_is_not_sent():
    window, sent = CommandWindow("port", 1, timeout_ns=50 * MS, tries=4), []
    first, stale, fresh, forever = (Pending("pulse", bytes(23)) for _ in range(4))
    window.submit(first, 5 * MS)
    window.submit(stale, 10 * MS)
    window.submit(fresh, 40 * MS)
    window.submit(forever)
    window.pump(0, sent.append)
    assert len(sent) == 1
    window.resolve(1, 0, 0, 0)
    window.pump(20 * MS, sent.append)
    assert (stale.status, stale.sent, stale.error) == (Status.LATE, False, None)
    assert (fresh.sent, fresh.done, len(sent)) == (True, False, 2)
    window.resolve(2, 0, 0, 0)
    window.pump(1000 * MS, sent.append)
    assert forever.sent


@pytest.mark.parametrize(("delay_ms", "timeout_ms"), [(0, (15, 15)), (20, (40, 60))])
def test_answers_are_awaited_longer_where_they_take_longer(delay_ms, timeout_ms):
    runner, link = open_link(f"sim://tactiles?clock=virtual&faults=delay=1,delay_ms={delay_ms}")
    connect(runner)
    low, high = timeout_ms
    assert low * MS <= link.session._exchanges.reply_timeout_ns <= high * MS
    sent = link.session.counters.retries
    assert finish(runner, link.stop(runner.now_ns())).ok
    assert link.session.counters.retries == sent
    link.close()
