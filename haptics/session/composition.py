"""What a glove is composed of: from a configuration alone, or of it only what the plan of a scene needs."""

from __future__ import annotations

from haptics.errors import InputError
from haptics.fidelity import DEFAULT_BUDGET, DEFAULT_TOLERANCE_JND, Plan, plan_scene
from haptics.link.ports import check_board_port
from haptics.scene.scene import Scene
from haptics.session.configuration import BrakeConfiguration, Configuration, TactilesConfiguration
from haptics.session.devices import Devices, WireTap
from haptics.session.recorder import Recorder


def with_ports(configuration: Configuration, tactiles: str | None, brake: str | None) -> Configuration:
    """A configuration on other ports.

    :param configuration: as loaded.
    :param tactiles: port URL of the array's board; the configuration's if None.
    :param brake: port URL of the brake controller, likewise.
    :return: the same with these ports.
    :raises InputError: no port for such a board.
    """
    parts = {"tactiles": tactiles, "brake": brake}
    for name, url in parts.items():
        if url is not None:
            check_board_port(url, name, f"port_{name}")
    changed = {
        name: getattr(configuration, name).model_copy(update={"port": url}) for name, url in parts.items() if url is not None
    }
    return configuration.model_copy(update=changed)


def plan_for(
    scene: Scene,
    configuration: Configuration,
    tolerance_jnd: float = DEFAULT_TOLERANCE_JND,
    budget_s_per_s: float = DEFAULT_BUDGET,
    levels: dict[str, str] | None = None,
) -> Plan:
    """The plan of a scene on a glove.

    :param scene: placed or not.
    :param configuration: of the glove: brakes have its volts.
    :param tolerance_jnd: see ``plan_scene``.
    :param budget_s_per_s: likewise.
    :param levels: likewise.
    :return: which model each device has.
    :raises InputError: see ``plan_scene``.
    """
    volts = configuration.brake.amplitude_v if scene.needs.brakes else None
    return plan_scene(scene, tolerance_jnd, budget_s_per_s, levels, volts)


def open_planned(
    scene: Scene,
    plan: Plan,
    configuration: Configuration,
    *,
    realtime: bool = False,
    seed: int = 1,
    wire_tap: WireTap | None = None,
    every_board: bool = False,
) -> Devices:
    """The devices that a plan builds, and no others.

    :param scene: placed; names what the brake's outputs drive.
    :param plan: which devices there are, and the level of each simulated one.
    :param configuration: ports and limits.
    :param realtime: on the machine's clock rather than in virtual time.
    :param seed: of the simulated boards, 0 to 2**32 - 1.
    :param wire_tap: see ``Devices``.
    :param every_board: both boards all the same, whole: another scene may come.
    :return: open and not armed.
    :raises InputError: more outputs asked for than a board has.
    :raises LinkError: a port or board that cannot be used.
    """
    if every_board:
        levels: dict[str, dict[str, object]] = {name: {"level": level} for name, level in plan.levels.items()}
        outputs = with_outputs(configuration.brake, scene)
        return Devices(configuration.tactiles, outputs, realtime=realtime, seed=seed, simulate=levels, wire_tap=wire_tap)
    tactiles = configuration.tactiles if plan.builds("tactiles") else None
    brake = with_outputs(configuration.brake, scene) if plan.builds("brake") or plan.builds("piezo") else None
    simulate = _simulated(plan, tactiles, brake)
    return Devices(tactiles, brake, realtime=realtime, seed=seed, simulate=simulate, wire_tap=wire_tap)


def with_outputs(brake: BrakeConfiguration, scene: Scene) -> BrakeConfiguration:
    """A brake controller's outputs, named as a scene names what it drives unless the configuration covers all of them.

    :param brake: as configured.
    :param scene: what is to be driven.
    :return: the configuration, with the scene's names where it has to be.
    :raises InputError: more outputs than one board has.
    """
    needed = tuple(dict.fromkeys((*scene.needs.brakes, *scene.needs.piezos, *scene.needs.clutches)))
    if set(needed) <= set(brake.channels):
        return brake
    try:
        return BrakeConfiguration.model_validate({**brake.model_dump(), "channels": needed})
    except ValueError as error:
        raise InputError(f"scene {scene.name!r} drives {', '.join(needed)}, more than one board's outputs: {error}") from error


def _simulated(
    plan: Plan, tactiles: TactilesConfiguration | None, brake: BrakeConfiguration | None
) -> dict[str, dict[str, object]]:
    """What simulated boards are given of the plan: the level, and which channels there are."""
    keys: dict[str, dict[str, object]] = {name: {"level": level} for name, level in plan.levels.items()}
    if "tactiles" in keys and tactiles is not None:
        keys["tactiles"]["fitted"] = sum(1 << channel for channel, site in enumerate(tactiles.sites) if site in plan.sites)
    if brake is not None:
        keys.setdefault("brake", {})["fitted"] = len(brake.channels)
    return keys


class EarlyWire:
    """Wire bytes on their way to a recorder that is made later: those of the handshake are kept until then. A ``WireTap``."""

    def __init__(self) -> None:
        self._early: list[tuple[int, str, bool, bytes]] = []
        self._recorder: Recorder | None = None

    def __call__(self, name: str, time_ns: int, to_board: bool, data: bytes) -> None:
        if self._recorder is None:
            self._early.append((time_ns, name, to_board, data))
        else:
            self._recorder.wire(time_ns, name, to_board, data)

    def attach(self, recorder: Recorder) -> None:
        """From now on into a recording; what was kept first.

        :param recorder: on an open journal.
        """
        self._recorder = recorder
        for time_ns, name, to_board, data in self._early:
            recorder.wire(time_ns, name, to_board, data)
        self._early.clear()
