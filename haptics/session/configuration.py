"""``glove.toml``: which glove this is. Checked here, once, at the edge; frozen afterwards.

Limits may be lowered, never raised past what the firmware holds (the upper ends below are the firmware's own).
"""

from __future__ import annotations

import tomllib
from os import PathLike
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from haptics.errors import InputError
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS, DEFAULT_BAUD
from haptics.link.ports import check_port
from haptics.physics.brake_force import ForceLaw, ThresholdLaw, default_law
from haptics.physics.brake_parameters import BRAKE
from haptics.scene.sites import SITES
from haptics.units import file_path

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
PortUrl = Annotated[str, AfterValidator(check_port)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ActuatorCalibration(_Part):
    """What a bench measured of one actuator; absent values keep the published ones (thesis 3.4.3, 3.5.2)."""

    tau_s: Annotated[float, Field(ge=20, le=500)] = 102.0
    c_k_per_w: Annotated[float, Field(ge=10, le=300)] = 69.0
    power_w: Annotated[float, Field(ge=1, le=40)] = 18.0


class TactilesConfiguration(_Part):
    """The array of tactors. ``sites[i]`` is where channel ``i`` sits on the hand."""

    port: PortUrl = "sim://tactiles"
    baud: int = Field(default=DEFAULT_BAUD, ge=9600, le=2_000_000)
    sites: tuple[str, ...] = tuple(SITES)
    rise_limit_k: Annotated[float, Field(ge=1, le=60)] = Field(default=25.0, description="temperature rise limit, K (assumed)")
    current_limit_a: Annotated[float, Field(ge=3.9, le=12.0)] = Field(default=12.0, description="all coils together, A")
    coil_current_a: Annotated[float, Field(ge=1, le=5)] = Field(default=3.9, description="one coil at its lowest resistance, A")
    contact_pulse_s: Annotated[float, Field(ge=0.001, le=0.010)] = Field(default=0.010, description="coil time, s (3.4.3)")
    calibration: dict[str, ActuatorCalibration] = Field(default_factory=dict)

    @field_validator("calibration")
    @classmethod
    def _of_known_sites(cls, calibration: dict[str, ActuatorCalibration]) -> dict[str, ActuatorCalibration]:
        unknown = [site for site in calibration if site not in SITES]
        if unknown:
            raise ValueError(f"no such site: {', '.join(unknown)}; allowed: {', '.join(SITES)}")
        return calibration

    @field_validator("sites")
    @classmethod
    def _known_sites(cls, sites: tuple[str, ...]) -> tuple[str, ...]:
        unknown = [s for s in sites if s not in SITES]
        if unknown or len(set(sites)) != len(sites) or len(sites) > COIL_CHANNELS:
            raise ValueError(f"at most {COIL_CHANNELS} different sites out of: {', '.join(SITES)}; got {', '.join(sites)}")
        return sites


class BrakeCalibration(_Part):
    """What a pull tester measured of one brake: ``F = k (V^2 - V0^2)`` at its own overlap, dielectric and volts."""

    k_n_v2: Annotated[float, Field(ge=1e-8, le=1e-3)]
    threshold_v: Annotated[float, Field(ge=0, le=1500)]


class BrakeConfiguration(_Part):
    """Brakes or clutches on one high-voltage supply. ``channels[i]`` names what output ``i`` drives."""

    port: PortUrl = "sim://brake"
    baud: int = Field(default=DEFAULT_BAUD, ge=9600, le=2_000_000)
    channels: tuple[str, ...] = ("index", "thumb")
    amplitude_v: Annotated[float, Field(ge=0, le=1500)] = Field(default=1000.0, description="on a grasp, V (4.5.2)")
    clutch_amplitude_v: Annotated[float, Field(ge=0, le=1500)] = Field(default=350.0, description="garment clutch, V (6.3.3)")
    frequency_hz: Annotated[float, Field(ge=1, le=1000)] = Field(default=20.0, description="bipolar square wave, Hz (4.5.2)")
    ttl_s: Annotated[float, Field(ge=0.02, le=1.0)] = Field(default=0.2, description="volts fall by themselves after this, s")
    overlap_m2: Annotated[float, Field(ge=1e-6, le=0.1)] = Field(default=11e-4, description="strip overlap, m² (4.7.1)")
    calibration: dict[str, BrakeCalibration] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _of_known_brakes(self) -> BrakeConfiguration:
        unknown = [name for name in self.calibration if name not in self.channels]
        if unknown:
            raise ValueError(f"calibration of {', '.join(unknown)}, which no output drives; allowed: {', '.join(self.channels)}")
        return self

    def law(self, name: str) -> tuple[ForceLaw, float]:
        """Force law of one output and the overlap (m2) it counts with: what a bench measured of it, or the published fit."""
        own = self.calibration.get(name)
        if own is not None:
            return ThresholdLaw(own.k_n_v2, own.threshold_v), BRAKE.overlap_m2
        return default_law("thumb" if name == "thumb" else "index"), self.overlap_m2

    @field_validator("channels")
    @classmethod
    def _distinct(cls, channels: tuple[str, ...]) -> tuple[str, ...]:
        if not 1 <= len(channels) <= BRAKE_CHANNELS or len(set(channels)) != len(channels):
            raise ValueError(f"1 to {BRAKE_CHANNELS} different names; got {', '.join(channels)}")
        return channels


class Configuration(_Part):
    """One glove: its devices, the hand it is on, and the tracker that sees the hand."""

    side: Literal["auto", "left", "right"] = Field(default="auto", description="hand the glove is on; auto: the one seen most")
    tracker_latency_s: Annotated[float, Field(ge=0, le=0.1)] = Field(default=0.010, description="a pose's age when it arrives, s")
    tick_hz: Annotated[int, Field(ge=250, le=2000)] = 1000
    tactiles: TactilesConfiguration = TactilesConfiguration()
    brake: BrakeConfiguration = BrakeConfiguration()


def load_configuration(path: str | PathLike[str] | None) -> Configuration:
    """The configuration in a TOML file, or the simulated glove for None.

    :raises InputError: no such file, not TOML (with line and column), or a key or value that is not allowed.
    """
    if path is None:
        return Configuration()
    path = file_path("config", path)
    try:
        with open(path, "rb") as file:
            table = tomllib.load(file)
    except OSError as error:
        raise InputError(f"configuration {path}: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"configuration {path} is not TOML: {error}") from error
    return check_configuration(table, str(path))


def check_configuration(table: dict, source: str) -> Configuration:
    """A configuration from plain data.

    :raises InputError: every key at fault, with its value and what is allowed.
    """
    try:
        return Configuration.model_validate(table)
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, e['loc']))} = {_short(e.get('input'))}: {e['msg']}" for e in error.errors(include_url=False)
        )
        raise InputError(f"configuration {source}: {problems}") from error


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
