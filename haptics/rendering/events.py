"""What the loop reports for people to read later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

EventKind = Literal[
    "touch",
    "release",
    "grasp_begin",
    "grasp_end",
    "grasp_ahead",  # brakes closed before the grasp, so that they hold when it comes
    "grasp_withdrawn",  # and opened again, as it did not come
    "clutch_on",
    "clutch_off",
    "pose_refused",
    "handedness",  # a hand's label contradicts its shape
    "clock_jump",  # the clock of the poses was set
    "watchdog",  # poses stopped: everything off
    "resumed",  # poses came again
    "overrun",  # ticked too rarely
    "derated",  # the brake controller refused a command
]
"""What a loop reports."""


@dataclass(frozen=True, slots=True)
class LoopEvent:
    """Something that a person may want to read later.

    :param time_ns: when the loop did or noticed it.
    :param kind: what happened.
    :param subject: the site, side or clutch; empty where there is none.
    :param object: the object's name; empty where there is none.
    :param detail: numbers and reasons, in words.
    :param aimed_ns: the touch or grasp that the loop acted for, where there is one.
    """

    time_ns: int
    kind: EventKind
    subject: str = ""
    object: str = ""
    detail: str = ""
    aimed_ns: int | None = None
