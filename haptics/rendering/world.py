"""Where a scene's objects are now, and who moves each: a path of its own, the hand that holds it, or the engine."""

from __future__ import annotations

from haptics.scene.geometry.pose import Pose
from haptics.scene.geometry.shapes import Placed
from haptics.scene.scene import Scene
from haptics.time import NS_PER_S


class World:
    """The objects of a scene as they are now. Several loops, one a hand, may share it.

    :param scene: placed, so that every object has a place in the world.
    """

    def __init__(self, scene: Scene):
        self._bodies: dict[str, Placed] = {}
        self._start_ns = 0
        self.change(scene)

    def change(self, scene: Scene) -> None:
        """Hold the objects of another scene, where that has them.

        :param scene: placed.
        """
        self.scene = scene
        self._bodies = {item.name: item.body for item in scene.objects}
        self._on_paths = tuple(item for item in scene.objects if item.motion is not None)
        self.engines = frozenset(item.name for item in scene.objects if item.owner == "engine")
        self.moving = frozenset(item.name for item in self._on_paths) | self.engines

    def begin(self, start_ns: int) -> None:
        """Start the clock that paths follow.

        :param start_ns: when that clock reads zero.
        """
        self._start_ns = start_ns

    def advance(self, time_ns: int) -> None:
        """Move what has a path of its own.

        :param time_ns: when the scene is looked at.
        """
        time_s = (time_ns - self._start_ns) / NS_PER_S
        for item in self._on_paths:
            self._bodies[item.name] = item.body_at(time_s)

    def body(self, name: str) -> Placed:
        """An object where it is now.

        :param name: the object's.
        :return: its shape at its present pose.
        :raises KeyError: no such object.
        """
        return self._bodies[name]

    def put(self, name: str, body: Placed) -> None:
        """An object is elsewhere, carried by a hand.

        :param name: the object's.
        :param body: of the same shape.
        """
        self._bodies[name] = body

    def move(self, name: str, pose: Pose) -> None:
        """The engine puts an object somewhere.

        :param name: the object's.
        :param pose: in the world.
        :raises InputError: no such object, or one that follows a path of its own.
        """
        self.scene.object(name).check_movable()
        self._bodies[name] = self._bodies[name].at(pose)

    def now(self, scene: Scene) -> Scene:
        """A scene with every object where it is now; one with a path of its own where that begins.

        :param scene: of one of the loops that share this world, which another one's scene may have left meanwhile.
        :return: another scene; the one given stays as it is.
        """
        for item in scene.objects:
            body = self._bodies.get(item.name, item.body)
            if item.motion is None and body is not item.body:
                scene = scene.moved(item.name, body.pose)
        return scene
