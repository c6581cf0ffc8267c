"""What a simulated brake of a seed really is, and what noise-free forces its plant gives: for tests alone."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from firmware_models.boards.brake_board import BrakeBoard
from firmware_models.line.uart import Line
from firmware_models.options import parse_options
from firmware_models.protocol_sim import board_options
from haptics.link.ports import open_port
from haptics.physics.brake.finger import series_stiffness_n_m
from haptics.physics.brake.levels import brake_plant
from haptics.physics.brake.plant import BrakePlant
from haptics.physics.brake.system import BrakeSystem

TOP_V = 1500.0
_worlds = itertools.count(1)
_STEP_S = 0.1e-3


@dataclass(frozen=True)
class TrueBrake:
    """Output 0 of a board, with the volts that it makes for one volt asked for."""

    system: BrakeSystem
    volts_gain: float
    level: str

    def capacity_n(self, volts: float) -> float:
        """Steady, of the whole overlap, for volts asked for."""
        return self.system.full_force_n(0, volts * self.volts_gain)

    def quantities(self) -> dict[str, float]:
        """What the pull rig should find, but for the plateau: the law's constants as the host's volts see them."""
        top_n, off_n = self.capacity_n(TOP_V), self.capacity_n(0.0)
        k = (top_n - self.capacity_n(1000.0)) / (TOP_V**2 - 1000.0**2)
        return {
            "k_n_v2": k,
            "threshold_v": (TOP_V**2 - (top_n - off_n) / k) ** 0.5,
            "capacity_1500_n": top_n,
            "off_force_n": off_n,
            "slack_m": self.system.finger.slack_m,
            "stiffness_n_m": series_stiffness_n_m(self.system.finger),
            "overlap_slope_per_m": self.system.brake.width_m / self.system.overlap_m2(0),
        }

    def plateau_n(self, volts: float, frequency_hz: float = 10.0) -> float:
        """Means over whole periods of a pull at 1 mm/s, straight back to no slip."""
        plant = self._plant()
        plant.drive(0.0, 1, volts * self.volts_gain, frequency_hz)
        plant.move(0, 0.3, 0.0, 1e-3)
        slides_s = 0.5
        while plant.slip_m[0] < 1e-4:
            slides_s += 0.1
            plant.advance(slides_s)
        mean_n, slip_m = [], []
        per_period = round(1.0 / frequency_hz / _STEP_S)
        for _ in range(15):
            begun_s = plant.now_s
            seen = [self._seen(plant, begun_s + (k + 1) * _STEP_S) for k in range(per_period)]
            mean_n.append(np.mean([tension for tension, _ in seen]))
            slip_m.append(np.mean([slip for _, slip in seen]))
        return float(np.polyfit(slip_m, mean_n, 1)[1])

    def step(self, before_s: float, held_s: float, speed_m_s: float, accel_m_s2: float) -> dict[str, float]:
        """Times of one step under a hand that pulls along, as the response rig makes it, in steps of 20 us."""
        plant = self._plant(step_s=20e-6)
        speeding_s = speed_m_s / accel_m_s2
        for k in range(100):
            plant.move(0, k * speeding_s / 100, 0.5 * accel_m_s2 * (k * speeding_s / 100) ** 2, speed_m_s * (k + 0.5) / 100)
        plant.move(0, speeding_s, 0.5 * speed_m_s * speeding_s, speed_m_s)
        plant.drive(before_s, 1, TOP_V * self.volts_gain, 1.0)
        fine_s = 50e-6
        rise_n = np.array([self._seen(plant, before_s + fine_s * k)[0] for k in range(1, round(held_s / fine_s))])
        off_s = before_s + held_s
        plant.drive(off_s, 0, 0.0, 0.0)
        fall_n = np.array([self._seen(plant, off_s + fine_s * k)[0] for k in range(1, round(0.15 / fine_s))])
        max_n, last_n = float(rise_n.max()), float(rise_n[-200:].mean())
        begun_s, response_s = (fine_s * (1 + int(np.argmax(rise_n >= share * max_n))) for share in (0.1, 0.9))
        return {
            "response_s": response_s,
            "release_s": fine_s * (1 + int(np.argmax(fall_n <= 0.1 * last_n))),
            "rise_s": response_s - begun_s,
            "slew_n_s": 0.8 * max_n / (response_s - begun_s),
        }

    def _plant(self, step_s: float | None = None) -> BrakePlant:
        return brake_plant(self.level, self.system, step_s=step_s)

    @staticmethod
    def _seen(plant: BrakePlant, at_s: float) -> tuple[float, float]:
        plant.advance(at_s)
        return plant.tension_n[0], plant.slip_m[0]


def true_brake(seed: int, keys: dict[str, Any]) -> TrueBrake:
    """The brake on output 0 of ``sim://brake`` with this seed and these keys."""
    options = parse_options({"seed": str(seed), **{key: str(one) for key, one in keys.items()}}, board_options("brake"))
    plant = BrakeBoard(options, Line(500_000), 0).plant
    system: BrakeSystem = plant._plant.system
    return TrueBrake(replace(system), plant._volts_gain, options["level"])


class Bystander:
    """Holds on to a world in which a rig runs on ``sim://brake``, and looks at what is there. Use as a context manager."""

    def __init__(self, **keys: Any):
        self._world = f"bystander-{next(_worlds)}"
        self.url = url({"world": self._world, **keys})
        self._port: Any = open_port(f"sim://probe?world={self._world}&clock=virtual&rate_hz=1")

    def __enter__(self) -> Bystander:
        return self

    def __exit__(self, *_: object) -> None:
        self._port.close()

    def device(self, name: str) -> Any:
        """The board or instrument itself."""
        return self._port._world.members[name].board


def url(keys: dict[str, Any]) -> str:
    """A port for the same keys."""
    return "sim://brake" + ("?" + "&".join(f"{key}={one}" for key, one in keys.items()) if keys else "")
