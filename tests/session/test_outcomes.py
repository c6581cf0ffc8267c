"""What became of what a scene wanted: acted and how late, or denied, told once until it acts again."""

from __future__ import annotations

import pytest

from haptics.devices import Result
from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.rendering.events import LoopEvent
from haptics.rendering.loop import Leads
from haptics.session.outcomes import Outcomes
from haptics.time import NS_PER_MS

LEADS = Leads(pin_s=0.009, pin_back_s=0.011, brake_s=0.02)
WANTED_NS, START_NS = 100 * NS_PER_MS, 104 * NS_PER_MS


@pytest.fixture
def told() -> list[LoopEvent]:
    return []


@pytest.fixture
def outcomes(told):
    return Outcomes(LEADS, told.append)


def played(kind: str) -> Result:
    return Result("index_tip", kind, True, None, WANTED_NS, START_NS, "scene")  # type: ignore[arg-type]


def denied(reason: str) -> Result:
    return Result("index_tip", "contact", False, reason, WANTED_NS, None, "scene")  # type: ignore[arg-type]


@pytest.mark.parametrize(("kind", "moves_ms"), [("contact", 9), ("release", 11), ("brake", 20)])
def test_how_late_an_output_acts_counts_from_the_touch_to_the_moment_it_has_moved(outcomes, told, kind, moves_ms):
    aimed_ns = 110 * NS_PER_MS
    outcomes.want(LoopEvent(WANTED_NS, "wanted", "index_tip", "ball", kind, aimed_ns))
    outcomes.tell(START_NS, played(kind))
    (event,) = told
    assert (event.kind, event.subject, event.object, event.detail) == ("acted", "index_tip", "ball", kind)
    assert event.late_ns == START_NS + moves_ms * NS_PER_MS - COMMAND_LEAD_NS - aimed_ns


def test_what_no_touch_was_foreseen_for_is_as_late_as_it_starts(outcomes, told):
    outcomes.want(LoopEvent(WANTED_NS, "wanted", "index_tip", "ball", "contact"))
    outcomes.tell(START_NS, played("contact"))
    assert told[0].late_ns == START_NS - WANTED_NS


def test_a_denial_is_told_once_a_reason_and_is_news_again_after_it_acted_or_was_armed(outcomes, told):
    for reason in ("heat", "heat", "current", "superseded", "heat"):
        outcomes.tell(START_NS, denied(reason))
    assert [event.reason for event in told] == ["heat", "current", "heat"]
    outcomes.tell(START_NS, played("contact"))  # which nobody wanted, and is not told
    outcomes.tell(START_NS, denied("heat"))
    outcomes.forget()
    outcomes.tell(START_NS, denied("heat"))
    assert [event.reason for event in told] == ["heat", "current", "heat", "heat", "heat"]
