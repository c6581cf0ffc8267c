"""Two gloves on one scene: each hand has its own boards and its own loop, and both see the same objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from haptics.devices import Result
from haptics.errors import InputError
from haptics.rendering.events import LoopEvent
from haptics.rendering.resuming import Resume
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import SIDES, Side
from haptics.scene.live_placement import LivePlacement
from haptics.scene.objects import SceneObject
from haptics.scene.scene import Scene
from haptics.session.glove import Glove
from haptics.session.session import Session
from haptics.units import a_callable, an_instance, known_arguments, one_of


class BothHands:
    """A scene on a left and a right glove. What a hand carries, the other one meets where it is.

    :param scene: from ``haptics.load_scene``, placed or not; the hand that is still first places it.
    :param left: open glove of the left hand.
    :param right: open glove of the right hand.
    :param resume: see ``Session``.
    :raises InputError: see ``Session``; the same glove twice; one that is configured for the other side.

    :ivar sessions: of each hand, by side; their results and events are there.
    """

    @known_arguments
    def __init__(self, scene: Scene, left: Glove, right: Glove, resume: Resume = "apart"):
        for name, glove in (("left", left), ("right", right)):
            an_instance(name, glove, Glove, "from haptics.open")
        if left is right:
            raise InputError("left and right are the same glove; expected two, each with its own boards")
        for side, glove in zip(SIDES, (left, right), strict=True):
            if glove.configuration.side not in ("auto", side):
                seen = f"is configured with side = {glove.configuration.side!r}"
                raise InputError(f"{side}: this glove {seen}; give it as that hand's, or configure {side!r} or 'auto'")
        self._gloves = (left, right)
        self._asked = scene
        self.sessions: dict[str, Session] = {}
        for side, glove in zip(SIDES, (left, right), strict=True):
            configuration = glove.configuration.model_copy(update={"side": side})
            world = self.sessions["left"].loop.world if self.sessions else None
            self.sessions[side] = Session(scene, glove, configuration, resume=resume, world=world)

    def begin(self) -> None:
        """Start the scene's own clock (motions, signals)."""
        for session in self.sessions.values():
            session.begin()

    def submit(self, frame: HandFrame) -> str | None:
        """Hand in a pose of either hand.

        :param frame: see ``Session.submit``.
        :return: why it was refused, or None.
        :raises InputError: no ``HandFrame``, or one of no known side.
        """
        mine, other = self._of(getattr(frame, "side", None))
        waited = mine.waits_for
        reason = mine.submit(frame)
        if waited and not mine.waits_for and other.waits_for:
            other.change_scene(mine.scene)
        return reason

    def place(self, side: Side) -> None:
        """Place the scene by a hand as it is now, for the first time or anew (recentre); see ``Session.place``.

        :param side: of that hand.
        :raises InputError: no such side; that hand is not there, or closed where an object is to be in it.
        """
        frame = self._of(side)[0].loop.frame
        if frame is None:
            raise InputError(f"there is no {side} hand to place the scene by; submit its poses first")
        placed = LivePlacement(self._asked).place(frame)
        self._each(lambda session: session.change_scene(placed))

    def hand_gone(self, side: Side) -> None:
        """A hand is not there any more.

        :param side: of that hand.
        :raises InputError: no such side.
        """
        self._of(side)[0].hand_gone()

    def tick(self, now_ns: int | None = None) -> None:
        """One period of both loops, in virtual time.

        :param now_ns: see ``Session.tick``.
        """
        for session in self.sessions.values():
            session.tick(now_ns)

    @known_arguments
    def move_object(
        self, name: str, position_m: Sequence[float], orientation_xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0)
    ) -> None:
        """The engine puts an object somewhere.

        :param name: the object's.
        :param position_m: see ``Session.move_object``.
        :param orientation_xyzw: likewise.
        :raises InputError: likewise.
        """
        self._each(lambda session: session.move_object(name, position_m, orientation_xyzw))

    def add_object(self, item: SceneObject) -> None:
        """Put one more object into the scene.

        :param item: see ``Session.add_object``.
        :raises InputError: likewise.
        """
        self._each(lambda session: session.add_object(item))
        self._asked = replace(self._asked, objects=(*self._asked.objects, item))

    def remove_object(self, name: str) -> None:
        """Take an object out of the scene.

        :param name: see ``Session.remove_object``.
        :raises InputError: likewise.
        """
        self._each(lambda session: session.remove_object(name))
        self._asked = replace(self._asked, objects=tuple(item for item in self._asked.objects if item.name != name))

    def change_scene(self, scene: Scene) -> None:
        """Go on with another scene.

        :param scene: see ``Session.change_scene``.
        :raises InputError: likewise.
        """
        self._each(lambda session: session.change_scene(scene))
        self._asked = scene

    def subscribe(self, sink: Callable[[str, Result | LoopEvent], None]) -> None:
        """Hand on every result and event of both hands.

        :param sink: called with the side and what ``Session.subscribe`` hands on; from the thread of that side's glove.
        :raises InputError: it cannot be called.
        """
        a_callable("sink", sink, "a side, and a result or an event")
        for side, session in self.sessions.items():
            session.subscribe(lambda one, side=side: sink(side, one))

    def end(self) -> None:
        """The scene is over: let go of everything. The gloves stay armed."""
        for session in self.sessions.values():
            session.end()

    def _each(self, call: Callable[[Session], Any]) -> None:
        """Change both; neither thread renders meanwhile, as it would meet objects that are only half there."""
        with ExitStack() as turns:
            for glove in self._gloves:
                turns.enter_context(glove.turn())
            for session in self.sessions.values():
                call(session)

    def _of(self, side: object) -> tuple[Session, Session]:
        """The session of a hand, and of the other one."""
        one_of("side", side, SIDES)
        return self.sessions[str(side)], self.sessions["left" if side == "right" else "right"]
