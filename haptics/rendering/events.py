"""What the loop reports for people to read later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

EventKind = Literal[
    "touch",  # a site meets an object, by the geometry of hand and object; told ahead of it, when the loop acts for it
    "release",  # it leaves the object
    "grasp_begin",  # thumb and index hold an object
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

    :param time_ns: when the loop did or noticed it, ns on the glove's clock; of ``acted``: when the output begins to act.
    :param kind: what happened.
    :param subject: the site, brake, side or clutch; empty where there is none.
    :param object: the object's name; empty where there is none.
    :param detail: numbers and reasons, in words; of ``wanted``, ``acted`` and ``denied``: the kind, see ``haptics.ResultKind``.
    :param aimed_ns: moment of the touch or grasp that the loop acted for, ns on the glove's clock; None where there is none.
    :param late_ns: of ``acted``: from the wanted moment until the device has moved, by its model, ns; negative if ahead of it.
    :param reason: of ``denied``: see ``haptics.Result``.
    :param retry_ns: of ``denied``: from when on the same can be asked for with hope, ns on the glove's clock; None where no
        waiting helps.
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
