"""What a session can be asked about its scene while it runs: place it, move, add and remove objects, change it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace

from haptics.errors import InputError
from haptics.fidelity import Plan
from haptics.rendering.events import LoopEvent
from haptics.rendering.loop import RenderLoop
from haptics.scene.geometry.pose import Pose
from haptics.scene.live_placement import LivePlacement
from haptics.scene.objects import SceneObject
from haptics.scene.scene import Scene
from haptics.session.composition import plan_for
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.session.leads import device_leads
from haptics.session.recorder import Recorder
from haptics.time import LATEST_NS, NS_PER_S
from haptics.units import an_instance, in_range, known_arguments, whole_number

FARTHEST_M = 1000.0
"""No object is put farther from the world's origin than this, along an axis."""


class SceneCalls:
    """The part of a session that keeps its scene. See ``Session``."""

    devices: Devices
    configuration: Configuration
    recorder: Recorder | None
    loop: RenderLoop
    _asked: Scene
    _placing: LivePlacement | None
    _follows_needs: bool
    _last_ns: int

    def _turn(self) -> AbstractContextManager[object]:
        raise NotImplementedError

    def _happened(self, event: LoopEvent) -> None:
        raise NotImplementedError

    def _tell_events(self) -> None:
        raise NotImplementedError

    @property
    def scene(self) -> Scene:
        """What is rendered now: the scene, without objects that have no place yet."""
        return self.loop.scene

    def plan(self) -> Plan:
        """Which devices the scene needs, and which model each simulated one would have; made anew with each scene.

        Boards that are open keep the models that they were opened with.

        :return: the plan.
        """
        return plan_for(self._asked, self.configuration)

    @property
    def waits_for(self) -> str:
        """What a person has to do so that all objects are there; empty where they are."""
        return "" if self._placing is None else self._placing.waits_for

    def place(self, now_ns: int | None = None) -> None:
        """Place the scene by the hand as it is now, for the first time or anew (recentre).

        Objects with a place in the world of their own stay; those that were carried or moved are back where the scene has them.

        :param now_ns: ns on the glove's clock; now if None.
        :raises InputError: no hand is there, or it is closed and an object is to be in it.
        """
        with self._turn():
            now_ns = self._came_ns(now_ns)
            if self.loop.frame is None:
                raise InputError("there is no hand to place the scene by; submit its poses first")
            self._put_in_place(LivePlacement(self._asked).place(self.loop.frame), now_ns)
            self._called(now_ns, "place")

    @known_arguments
    def move_object(
        self,
        name: str,
        position_m: Sequence[float],
        orientation_xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
        now_ns: int | None = None,
    ) -> None:
        """The engine puts an object somewhere; as often as it moves. One with ``owner = "engine"`` is foreseen to move so.

        One that waited for a place has it from then on. An object of the scene's own that is in a hand stays there.

        :param name: the object's.
        :param position_m: of its origin in the world, three numbers, -1000 to 1000 m.
        :param orientation_xyzw: of its axes, a unit quaternion.
        :param now_ns: ns on the glove's clock; now if None.
        :raises InputError: no such object, one with a motion of its own, or no pose.
        """
        pose = Pose(position_m, orientation_xyzw)  # type: ignore[arg-type]  # checked and made tuples there
        for axis, part_m in zip("xyz", pose.position_m, strict=True):
            in_range(f"position_m along {axis}", part_m, -FARTHEST_M, FARTHEST_M, "m")
        with self._turn():
            now_ns = self._came_ns(now_ns)
            self._asked.object(name)
            if self._placing is not None and name in self._asked.unresolved:
                self._give_place(name, pose, now_ns)
            else:
                self.loop.world.move(name, pose)
            self._called(now_ns, "move_object", name, pose)

    def add_object(self, item: SceneObject, now_ns: int | None = None) -> None:
        """Put one more object into the scene; what is felt of the others goes on.

        :param item: with a place in the world.
        :param now_ns: ns on the glove's clock; now if None.
        :raises InputError: one of that name is there, or it has no place.
        """
        an_instance("item", item, SceneObject, "of haptics.scene.objects")
        if not item.resolved:
            raise InputError(f"object {item.name!r} has no place in the world; one that is added needs placement = 'world'")
        with self._turn():
            now_ns = self._came_ns(now_ns)
            scene = self.loop.scene_now()
            more = replace(scene, objects=(*scene.objects, item))
            self._check_scene(more)
            self._ask(replace(self._asked, objects=(*self._asked.objects, item)))
            self._change(more, now_ns)
            self._called(now_ns, "add_object", item.name)

    def remove_object(self, name: str, now_ns: int | None = None) -> None:
        """Take an object out of the scene; what was felt of it is let go of.

        :param name: the object's.
        :param now_ns: ns on the glove's clock; now if None.
        :raises InputError: no such object, or a rule of the scene is about it.
        """
        with self._turn():
            now_ns = self._came_ns(now_ns)
            self._asked.object(name)
            scene = self.loop.scene_now()
            left = replace(scene, objects=tuple(item for item in scene.objects if item.name != name))
            self._ask(replace(self._asked, objects=tuple(item for item in self._asked.objects if item.name != name)))
            self._change(left, now_ns)
            self._called(now_ns, "remove_object", name)

    def change_scene(self, scene: Scene, now_ns: int | None = None) -> None:
        """Go on with another scene. Objects that are alike in both go on being felt; all else is let go of, and outputs that the
        new scene has no use for are off.

        :param scene: placed or not.
        :param now_ns: ns on the glove's clock; now if None.
        :raises InputError: no scene, or one with brakes that the glove does not have; the old one goes on.
        """
        an_instance("scene", scene, Scene, "from haptics.load_scene")
        self._check_scene(scene)
        with self._turn():
            now_ns = self._came_ns(now_ns)
            self._ask(scene)
            self._change(scene.without_unresolved(), now_ns)
            self._called(now_ns, "change_scene", scene.origin)

    def _give_place(self, name: str, pose: Pose, now_ns: int) -> None:
        """An object that waited for a hand to place it is where the engine says."""
        self._ask(self._asked.moved(name, pose))
        scene = self.loop.scene_now()
        self._change(replace(scene, objects=(*scene.objects, self._asked.object(name))), now_ns)

    def _ask(self, scene: Scene) -> None:
        """From now on this scene is to be rendered, and what has no place in it waits for the hand."""
        self._asked = scene
        self._placing = LivePlacement(scene) if scene.unresolved else None

    def _called(self, now_ns: int, call: str, name: str = "", pose: Pose | None = None) -> None:
        if self.recorder is not None:
            self.recorder.call(now_ns, call, name, pose)

    def _put_in_place(self, placed: Scene, now_ns: int) -> None:
        self._placing = None
        self._change(placed, now_ns)
        self._happened(LoopEvent(now_ns, "placed", "", "", ", ".join(self._asked.unresolved)))

    def _change(self, scene: Scene, now_ns: int) -> None:
        self.leads = device_leads(self.configuration, scene)
        self.loop.change_scene(scene, self.leads, now_ns)
        if self._follows_needs:
            self.devices.need(self._asked.needs.boards)
        self._tell_events()
        self._happened(LoopEvent(now_ns, "scene", "", "", f"{scene.name}: {', '.join(scene.names) or 'no objects'}"))

    def _check_scene(self, scene: Scene) -> None:
        brakes = self.devices.brakes
        driven = dict.fromkeys((*scene.needs.brakes, *scene.needs.piezos, *scene.needs.clutches))
        if brakes is None and driven:
            note = f"brake: scene {scene.name!r} drives {', '.join(driven)}, which this glove has not; open it with brake=…"
            self.devices.notes += [note] * (note not in self.devices.notes)
        missing = [] if brakes is None else [name for name in driven if name not in brakes.channels]
        if brakes is not None and missing:
            raise InputError(
                f"scene {scene.name!r} drives {', '.join(missing)}, but the glove's outputs are {', '.join(brakes.channels)}; "
                "name them in channels of [brake] in the configuration"
            )

    def _time(self, name: str, value: int | None) -> int:
        return self.devices.now_ns() if value is None else whole_number(name, value, 0, LATEST_NS)

    def _came_ns(self, now_ns: int | None) -> int:
        """When something came in: after the last tick, even where that was at the same moment, so that a replay has the order.

        Not ahead of the machine's own clock, or watchdogs would wait for that moment, too.
        """
        came_ns = self._time("now_ns", now_ns)
        if now_ns is not None and self.devices.realtime and (ahead_ns := came_ns - self.devices.now_ns()) > 0:
            raise InputError(f"now_ns = {came_ns} is {ahead_ns / NS_PER_S:.3g} s ahead of the glove's clock; leave it out")
        return max(came_ns, self._last_ns + 1)
