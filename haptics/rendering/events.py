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
    "wanted",  # a pin, brake or piezo was asked to act
    "acted",  # a board took it
    "denied",  # it did not; told once for each reason until it acts again
    "clutch_on",
    "clutch_off",
    "pose_refused",
    "handedness",  # a hand's label contradicts its shape
    "scene",  # other objects from now on
    "placed",  # objects were placed by the hand
    "clock_jump",  # the clock of the poses was set
    "watchdog",  # poses stopped: everything off
    "waiting",  # they come again, but nothing is felt yet
    "resumed",  # it is felt again
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
    :param late_ns: of ``acted``: from the wanted moment until the device has moved, by its model; negative if ahead of it.
    :param reason: of ``denied``: see ``haptics.Result``.
    :param retry_ns: of ``denied``: from when on the same can be asked for with hope; None where no waiting helps.
    """

    time_ns: int
    kind: EventKind
    subject: str = ""
    object: str = ""
    detail: str = ""
    aimed_ns: int | None = None
    late_ns: int | None = None
    reason: str = ""
    retry_ns: int | None = None
