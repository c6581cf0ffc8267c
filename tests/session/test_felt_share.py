"""A run in which hardly anything was felt is no success, and says why and what to do; denials by design are no fault."""

from __future__ import annotations

import pytest

from haptics.session.configuration import Configuration
from haptics.session.felt_share import BY_DESIGN, LARGEST_FAILED_SHARE, fault_of, felt_share
from haptics.session.run import RunOptions, run_scene


@pytest.mark.parametrize("reason", sorted(BY_DESIGN))
def test_what_was_denied_by_design_is_no_failure(reason):
    felt = felt_share("tactiles", 1, {reason: 1000})
    assert felt.share == 0.0
    assert fault_of(felt, None) is None


def test_the_share_is_of_what_was_not_denied_by_design_and_its_limit_is_allowed():
    felt = felt_share("tactiles", 80, {"heat": 1000, "late": 15, "unknown": 5})
    assert felt.share == pytest.approx(0.2) == pytest.approx(LARGEST_FAILED_SHARE)
    assert fault_of(felt, None) is None
    assert fault_of(felt_share("tactiles", 80, {"heat": 1000, "late": 16, "unknown": 5}), None) is not None


@pytest.mark.parametrize(
    ("reason", "cure"),
    [
        ("clock", "latency timer"),
        ("late", "too busy"),
        ("full", "queue was full"),
        ("unknown", "cable"),
        ("unarmed", "not armed"),
        ("far", "refused"),
    ],
)
def test_the_dominant_cause_is_named_with_its_cure(reason, cure):
    failed = {reason: 7, "stalled": 2}
    said = fault_of(felt_share("brake", 1, failed), None)
    assert said is not None
    assert said.startswith(f"brake: 9 of 10 requests failed (limit 20%), {failed[reason]} of them {reason}; ")
    assert cure in said


def test_nothing_asked_for_is_no_failure():
    assert fault_of(felt_share("tactiles", 0, {}), None) is None


def run(delay_ms):
    port = f"sim://tactiles?faults=delay=1,delay_ms={delay_ms}" if delay_ms else None
    options = RunOptions(port_tactiles=port, record=False)
    return run_scene("playground", "synthetic", Configuration(), options)


@pytest.fixture(scope="module")
def good():
    return run(0)


@pytest.mark.slow
def test_a_good_line_has_no_fault_and_no_note(good):
    assert (good["faults"], good["failed_share"]["tactiles"], good["shift_ms"]["tactiles"]) == ([], 0.0, 0.0)
    assert good["largest_failed_share"] == LARGEST_FAILED_SHARE
    assert not any("clock" in note for note in good["notes"])


@pytest.mark.slow
def test_a_coarse_line_is_played_over_later_and_says_by_how_much(good):
    report = run(6)
    assert report["faults"] == []
    assert report["pulses"]["played"] > 0.8 * good["pulses"]["played"] > 0
    shift_ms = report["shift_ms"]["tactiles"]
    assert 5 <= shift_ms <= 10
    assert any(f"known within {shift_ms:g} ms only" in note and "latency timer" in note for note in report["notes"])


@pytest.mark.slow
def test_a_line_too_coarse_to_schedule_over_fails_the_run_and_names_the_cure():
    report = run(45)
    assert report["pulses"]["played"] == 0
    (fault,) = report["faults"]
    assert "clock known within 4" in fault
    assert "25 needed; set the adapter's latency timer to 1 ms" in fault
