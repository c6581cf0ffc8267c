"""A scene in real time, in one call: glove opened, scene rendered by a thread of its own; an engine only hands in poses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import Literal

from haptics.rendering.resuming import Resume
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.library import load_scene
from haptics.scene.scene import Scene
from haptics.session.composition import open_planned, plan_for, with_ports
from haptics.session.configuration import Configuration, load_configuration
from haptics.session.glove import Glove
from haptics.session.glove_recording import GloveRecording
from haptics.session.peer_clock import PeerClock
from haptics.session.session import Session
from haptics.units import file_path, known_arguments, one_of, truth, whole_number

Boards = Literal["planned", "all"]


@contextmanager
@known_arguments
def live(
    scene: str | PathLike[str] | Scene,
    config: str | PathLike[str] | Configuration | None = None,
    *,
    tactiles: str | None = None,
    brake: str | None = None,
    boards: Boards = "planned",
    armed: bool = True,
    calibration: HandCalibration | None = None,
    peer: PeerClock | None = None,
    resume: Resume = "apart",
    record: str | PathLike[str] | None = None,
    force: bool = False,
    seed: int = 1,
) -> Iterator[Session]:
    """Render a scene in real time for as long as a ``with`` lasts.

    A thread ticks the session each millisecond: submit poses whenever they come, read its ``events`` or subscribe, change the
    scene. Its ``glove`` arms, goes off, and tells the state. Leaving the ``with``, however that happens, goes off. A complete
    engine: ``docs/how-to/live.md``.

    :param scene: a shipped name, a file, or what ``load_scene`` gave; placed or not (see ``Session``).
    :param config: see ``haptics.open``.
    :param tactiles: port URL of the tactor array, instead of the configuration's.
    :param brake: port URL of the brake controller, likewise.
    :param boards: ``planned``: only those that the scene has a use for are opened. ``all``: both, for scenes to come; of
        these only what the present scene has a use for is armed, and a scene that needs more has to be armed again.
    :param armed: arm it at once; else nothing is felt until ``session.glove.arm()``.
    :param calibration: see ``Session``.
    :param peer: see ``Session``.
    :param resume: see ``Session``.
    :param record: HDF5 file (``*.h5``) to record all of it in; ``haptics replay`` plays it again in virtual time. None records
        nothing.
    :param force: overwrite a recording that exists.
    :param seed: of simulated boards, 0 to 2**32 - 1.
    :return: a context that gives the session, begun.
    :raises HapticsError: a scene, file, port or board that cannot be used; a board that would not arm.
    """
    one_of("boards", boards, ("planned", "all"))
    truth("armed", armed)
    seed = whole_number("seed", seed, 0, 2**32 - 1)
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    recording = None if record is None else GloveRecording(file_path("record", record), truth("force", force))
    configuration = config if isinstance(config, Configuration) else load_configuration(config)
    configuration = with_ports(configuration, tactiles, brake)
    plan = plan_for(scene, configuration)
    devices = open_planned(
        scene,
        plan,
        configuration,
        realtime=True,
        seed=seed,
        wire_tap=None if recording is None else recording.wire,
        every_board=boards == "all",
    )
    with Glove(devices, configuration, recording, seed) as glove:
        session = Session(scene, glove, peer=peer, resume=resume, calibration=calibration, follows_needs=True)
        session.begin()
        if armed:
            glove.arm()
        yield session
        session.end()
