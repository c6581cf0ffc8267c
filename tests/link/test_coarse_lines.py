"""A line that is too coarse to schedule is called so where one looks at it, before anything is played over it."""

from __future__ import annotations

import pytest

from haptics.link.trial.monitor import identify


@pytest.mark.parametrize(
    ("delay_ms", "said"),
    [
        (0, "good: clock known within 0."),
        (10, "coarse: clock known within 1"),
        (45, "too coarse to schedule: clock known within 4"),
    ],
)
def test_identify_says_whether_a_line_can_be_scheduled_over(delay_ms, said):
    line = identify(f"sim://tactiles?clock=virtual&faults=delay=1,delay_ms={delay_ms}").line
    assert line.startswith(said)
    assert ("latency timer to 1 ms" in line) == (delay_ms > 0)
    assert ("25 ms needed" in line) == (delay_ms == 45)
