"""``glove.toml``: which glove this is. Checked here, once, at the edge; frozen afterwards.

Limits may be lowered, never raised past what the firmware holds (the upper ends below are the firmware's own). They are kept
twice: by the host, and by the boards, which are configured with them (``board_limits``).
"""

from __future__ import annotations

import math
from contextlib import suppress
from os import PathLike
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from haptics.devices.brake import LONGEST_PIEZO_S
from haptics.errors import InputError, nearest
from haptics.link.limits import Wanted
from haptics.link.messages import BRAKE_CHANNELS, DEFAULT_BAUD, DURATION_UNIT_US
from haptics.link.ports import check_board_port
from haptics.physics.brake.force_laws import ForceLaw, ThresholdLaw, default_law
from haptics.physics.brake.parameters import BRAKE, MAX_VOLTS
from haptics.physics.latch.pulse import PULSE_BACK_S, PULSE_TOWARD_S, TRAIN_BACK_S, TRAIN_TOWARD_S
from haptics.physics.thermal.one_node import THERMAL, WORST_PULSE_POWER_W, bounding
from haptics.scene.sites import SITES
from haptics.scheduling.coil_heat import BUILT_ON_TIME_S, CoilHeat
from haptics.table_faults import faults_in_words, read_toml, unit_of
from haptics.units import brief, file_path, one_of


class _Part(BaseModel):
    """A table of the file. Whoever makes one by hand gets the errors of a file, without its lines."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __init__(self, **keys: Any):
        self._fill(keys, type(self).__name__)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # tables within a table are made without it

    @classmethod
    def model_validate(cls, obj: Any, **how: Any) -> Self:
        """A table from plain data.

        :param obj: its keys, or one that is made already.
        :param how: as pydantic has it.
        :return: checked and frozen.
        :raises InputError: every key at fault, with its value and what is allowed.
        """
        try:
            return super().model_validate(obj, **how)
        except ValidationError as error:
            raise InputError(faults_in_words(error, cls.model_json_schema(), obj, cls.__name__)) from error

    def _fill(self, keys: dict, source: str, text: str | None = None) -> None:
        try:
            super().__init__(**keys)
        except ValidationError as error:
            raise InputError(faults_in_words(error, type(self).model_json_schema(), keys, source, text)) from error


CALIBRATION_SDS = 3.0
"""A calibrated value counts with so many of its standard deviations, on the side that is warmer."""
COUNTED_COIL_A = 3.907
"""What a board counts for each coil that is on, whatever it draws: 5 V at the lowest resistance (thesis 3.4.3), rounded up."""


class ActuatorCalibration(_Part):
    """What a bench measured of one tactor, each with its standard deviation (0 if not given: taken as exact).

    A value that is absent is taken at its worst within the published tolerance (thesis 3.4.3, 3.5.2), as all of them are for a
    tactor without calibration.

    :param tau_s: thermal time constant, 20 to 500 s.
    :param tau_sd_s: its standard deviation, 0 to 5 s.
    :param c_k_per_w: rise per power of steady heating, 10 to 300 K/W.
    :param c_sd_k_per_w: its standard deviation, 0 to 100 K/W.
    :param power_w: electric power of the coil while it is on, 1 to 40 W.
    :param power_sd_w: its standard deviation, 0 to 10 W.
    """

    tau_s: Annotated[float, Field(ge=20, le=500)] | None = None
    tau_sd_s: Annotated[float, Field(ge=0, le=5)] = 0.0
    c_k_per_w: Annotated[float, Field(ge=10, le=300)] | None = None
    c_sd_k_per_w: Annotated[float, Field(ge=0, le=100)] = 0.0
    power_w: Annotated[float, Field(ge=1, le=40)] | None = None
    power_sd_w: Annotated[float, Field(ge=0, le=10)] = 0.0

    @model_validator(mode="after")
    def _sds_of_values(self) -> ActuatorCalibration:
        for value, sd in (("tau_s", "tau_sd_s"), ("c_k_per_w", "c_sd_k_per_w"), ("power_w", "power_sd_w")):
            if getattr(self, value) is None and getattr(self, sd):
                raise ValueError(f"{sd} = {getattr(self, sd):g}{unit_of(sd)} without {value}; expected both, or {value} alone")
        return self

    def coil_heat(self) -> CoilHeat:
        """What the heat account of this tactor goes by: never cooler than it is, as far as the calibration knows it.

        Errors of ``c`` and power are independent, and only their product heats: their shares add in squares.

        :return: bounding parameters and power.
        """
        tau_s, tau_off_s = (
            (THERMAL.tau_s, THERMAL.tau_sd_s) if self.tau_s is None else (self.tau_s, CALIBRATION_SDS * self.tau_sd_s)
        )
        c_k_per_w = THERMAL.c_k_per_w + THERMAL.c_sd_k_per_w if self.c_k_per_w is None else self.c_k_per_w
        power_w = WORST_PULSE_POWER_W if self.power_w is None else self.power_w
        share = CALIBRATION_SDS * math.hypot(self.c_sd_k_per_w / c_k_per_w, self.power_sd_w / power_w)
        return CoilHeat(bounding(c_k_per_w * (1.0 + share), tau_s - tau_off_s, tau_s + tau_off_s), power_w)


class TactilesConfiguration(_Part):
    """The array of tactors.

    :param port: URL of the board's port.
    :param baud: of its line, 9600 to 2,000,000.
    :param sites: ``sites[i]`` is where channel ``i`` sits on the hand; at most 15 different ones.
    :param calibration: by site; sites without one are taken at their worst within tolerance.
    """

    port: str = "sim://tactiles"
    baud: int = Field(default=DEFAULT_BAUD, ge=9600, le=2_000_000)
    sites: tuple[str, ...] = tuple(SITES)
    rise_limit_k: Annotated[float, Field(ge=1, le=30)] = Field(default=25.0, description="temperature rise limit, K (assumed)")
    current_limit_a: Annotated[float, Field(ge=COUNTED_COIL_A, le=12.0)] = Field(
        default=12.0, description="all coils together, A"
    )
    coil_current_a: Annotated[float, Field(ge=1, le=5)] = Field(
        default=COUNTED_COIL_A, description="one coil at its lowest resistance, A; boards count 3.907 A at least"
    )
    contact_pulse_s: Annotated[float, Field(ge=0.001, le=0.010)] = Field(default=0.010, description="coil time, s (3.4.3)")
    calibration: dict[str, ActuatorCalibration] = Field(default_factory=dict)

    def coil_heat(self, site: str) -> CoilHeat:
        """What the heat account of a site goes by.

        :param site: of the array.
        :return: from its calibration, or the worst within tolerance.
        """
        return self.calibration.get(site, ActuatorCalibration()).coil_heat()

    def board_limits(self, *, of_pulses: bool = True) -> Wanted:
        """What the board is configured with, in the order of ``identity.limits``: no more than this host will ever need.

        :param of_pulses: with the limits on what a pulse lasts and warms, which a bench leaves as the board has them.
        :return: five integers in the wire's units; None leaves the board's own.
        """
        current_ma = math.floor(1000 * self.current_limit_a + 1e-6)
        if not of_pulses:
            return (None, current_ma, None, None, None)
        longest_s = max(self.contact_pulse_s, PULSE_TOWARD_S, PULSE_BACK_S, TRAIN_TOWARD_S, TRAIN_BACK_S)
        on_time_s = max(self.coil_heat(site).on_time_s(self.rise_limit_k) for site in self.sites)
        longest = round(1e6 * longest_s / DURATION_UNIT_US)
        return (longest, current_ma, None, None, math.ceil(1000 * min(on_time_s, BUILT_ON_TIME_S)))

    @field_validator("port")
    @classmethod
    def _of_an_array(cls, port: str) -> str:
        return check_board_port(port, "tactiles")

    @field_validator("contact_pulse_s")
    @classmethod
    def _in_units(cls, contact_pulse_s: float) -> float:
        """What is booked is what plays: the wire counts in 50 us."""
        return round(1e6 * contact_pulse_s / DURATION_UNIT_US) * DURATION_UNIT_US / 1e6

    @field_validator("calibration")
    @classmethod
    def _of_known_sites(cls, calibration: dict[str, ActuatorCalibration]) -> dict[str, ActuatorCalibration]:
        for site in calibration:
            if site not in SITES:
                raise ValueError(f"calibration.{site} is of no site; known sites: {', '.join(SITES)}{nearest(site, SITES)}")
        return calibration

    @field_validator("sites")
    @classmethod
    def _known_sites(cls, sites: tuple[str, ...]) -> tuple[str, ...]:
        if not sites:
            raise ValueError(f"no site is named; expected 1 to {len(SITES)} of {', '.join(SITES)}")
        for site in sites:
            one_of("site", site, SITES)
        _each_once("site", sites)
        return sites


class BrakeCalibration(_Part):
    """What a pull tester measured of one brake: ``F = k (V^2 - V0^2)`` at its own overlap, dielectric and volts.

    :param k_n_v2: k, 1e-8 to 1e-3 N/V².
    :param threshold_v: V0, 0 to 1500 V.
    """

    k_n_v2: Annotated[float, Field(ge=1e-8, le=1e-3)]
    threshold_v: Annotated[float, Field(ge=0, le=1500)]


_UNDER = {
    "amplitude_v": "max_amplitude_v",
    "clutch_amplitude_v": "max_amplitude_v",
    "frequency_hz": "max_frequency_hz",
}
"""What a brake is driven with, and the limit it must keep to."""


class BrakeConfiguration(_Part):
    """Brakes or clutches on one high-voltage supply.

    :param port: URL of the controller's port.
    :param baud: of its line, 9600 to 2,000,000.
    :param channels: ``channels[i]`` names what output ``i`` drives; 1 to 5 different names.
    :param calibration: by name; brakes without one have the published fit of thumb or index.
    """

    port: str = "sim://brake"
    baud: int = Field(default=DEFAULT_BAUD, ge=9600, le=2_000_000)
    channels: tuple[str, ...] = ("index", "thumb")
    amplitude_v: Annotated[float, Field(ge=0, le=1500)] = Field(default=1000.0, description="on a grasp, V (4.5.2)")
    clutch_amplitude_v: Annotated[float, Field(ge=0, le=1500)] = Field(default=350.0, description="garment clutch, V (6.3.3)")
    frequency_hz: Annotated[float, Field(ge=1, le=1000)] = Field(default=20.0, description="bipolar square wave, Hz (4.5.2)")
    ttl_s: Annotated[float, Field(ge=0.02, le=1.0)] = Field(default=0.2, description="volts fall by themselves after this, s")
    max_amplitude_v: Annotated[float, Field(ge=1, le=MAX_VOLTS)] = Field(default=MAX_VOLTS, description="limit whoever asks, V")
    max_frequency_hz: Annotated[float, Field(ge=1, le=1000)] = Field(default=1000.0, description="limit whoever asks, Hz")
    max_charge_c: Annotated[float, Field(ge=1e-7, le=45e-6)] = Field(default=45e-6, description="limit of the stored charge, C")
    overlap_m2: Annotated[float, Field(ge=1e-6, le=0.1)] = Field(default=11e-4, description="strip overlap, m² (4.7.1)")
    calibration: dict[str, BrakeCalibration] = Field(default_factory=dict)

    def board_limits(self) -> Wanted:
        """What the controller is configured with, in the order of ``identity.limits``.

        :return: five integers in the wire's units; None leaves the board's own.
        """
        return (
            math.floor(self.max_amplitude_v),
            None,
            math.floor(10 * self.max_frequency_hz + 1e-6),
            math.ceil(1000 * max(self.ttl_s, LONGEST_PIEZO_S)),
            math.floor(1e9 * self.max_charge_c + 1e-6),
        )

    @model_validator(mode="before")
    @classmethod
    def _defaults_below_limits(cls, table: Any) -> Any:
        """What is not given follows a limit that is; what is given must keep to it."""
        if not isinstance(table, dict):
            return table
        table = dict(table)
        for name, limit in _UNDER.items():
            with suppress(TypeError, ValueError):  # what is no number is refused as such, under its own name
                if name not in table and limit in table:
                    table[name] = min(cls.model_fields[name].default, float(table[limit]))
        return table

    @model_validator(mode="after")
    def _below_limits(self) -> BrakeConfiguration:
        for name, limit in _UNDER.items():
            if getattr(self, name) > getattr(self, limit):
                unit = unit_of(name)
                raise ValueError(f"{name} = {getattr(self, name):g}{unit} is above {limit} = {getattr(self, limit):g}{unit}")
        return self

    @model_validator(mode="after")
    def _of_known_brakes(self) -> BrakeConfiguration:
        for name in self.calibration:
            if name not in self.channels:
                known = f"{', '.join(self.channels)}{nearest(name, self.channels)}"
                raise ValueError(f"calibration.{name} is of no brake of this glove; its brakes (channels): {known}")
        return self

    def law(self, name: str) -> tuple[ForceLaw, float]:
        """Force law of one output: what a bench measured of it, or the published fit (thesis 4.7.1).

        :param name: of the output; any but ``thumb`` has the fit of the index brake.
        :return: the law, and the overlap that it counts with, m².
        """
        own = self.calibration.get(name)
        if own is not None:
            return ThresholdLaw(own.k_n_v2, own.threshold_v), BRAKE.overlap_m2
        return default_law("thumb" if name == "thumb" else "index"), self.overlap_m2

    @field_validator("port")
    @classmethod
    def _of_a_controller(cls, port: str) -> str:
        return check_board_port(port, "brake")

    @field_validator("channels")
    @classmethod
    def _distinct(cls, channels: tuple[str, ...]) -> tuple[str, ...]:
        if not 1 <= len(channels) <= BRAKE_CHANNELS:
            raise ValueError(f"{len(channels)} names; expected 1 to {BRAKE_CHANNELS}, one for each output that drives something")
        _each_once("channel", channels)
        return channels


def _each_once(what: str, names: tuple[str, ...]) -> None:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"{what} = {twice!r} is given twice; expected each once")


class Configuration(_Part):
    """One glove: its devices, the hand it is on, and the tracker that sees the hand.

    :param tick_hz: rate of the render loop, 250 to 2000 Hz.
    :param tactiles: the array of tactors.
    :param brake: the brake controller.
    :raises InputError: every key at fault, with its value and what is allowed.
    """

    side: Literal["auto", "left", "right"] = Field(default="auto", description="hand the glove is on; auto: the one seen most")
    tracker_latency_s: Annotated[float, Field(ge=0, le=0.1)] = Field(default=0.010, description="a pose's age when it arrives, s")
    tick_hz: Annotated[int, Field(ge=250, le=2000)] = 1000
    hand_calibration: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")] | None = Field(
        default=None,
        description="name of the calibration of the hand that wears the glove: 1 to 64 letters, digits, - and _",
        exclude_if=lambda name: name is None,
    )
    tactiles: TactilesConfiguration = TactilesConfiguration()
    brake: BrakeConfiguration = BrakeConfiguration()


def load_configuration(path: str | PathLike[str] | None) -> Configuration:
    """A glove's configuration.

    :param path: a TOML file; None for the defaults, on simulated boards.
    :return: checked and frozen.
    :raises InputError: no such file, not TOML (with line and column), or a key or value that is not allowed.
    """
    if path is None:
        return Configuration()
    if isinstance(path, str) and "://" in path:
        raise InputError(f"config = {brief(path)} is a port; expected a file name; ports have options of their own")
    path = file_path("config", path)
    try:
        text = path.read_text("utf-8")
    except OSError as error:
        raise InputError(f"config = {str(path)!r} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not TOML: it is no text in UTF-8 ({error.reason} at byte {error.start})") from error
    return check_configuration(read_toml(text, str(path)), str(path), text)


def check_configuration(table: dict, source: str, text: str | None = None) -> Configuration:
    """A configuration from plain data.

    :param table: as read from TOML or JSON.
    :param source: where it comes from, for messages.
    :param text: of the TOML file, which messages point into; None for plain data.
    :return: checked and frozen.
    :raises InputError: every key at fault, with its value and what is allowed.
    """
    configuration = Configuration.__new__(Configuration)
    configuration._fill(table, source, text)
    return configuration
