"""What boards report, in SI units and with names: identity, limits, telemetry.

Inside the package messages stay as they are on the wire (integers in the units of ``messages``); these are for whoever reads them
outside: programs on a glove, and ``haptics link``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar, cast

from haptics.errors import InputError
from haptics.link.messages import DURATION_UNIT_US, HEAT_UNIT_MS, Board, Fault, State

BoardName = Literal["tactiles", "brake"]
BoardState = Literal["disarmed", "self_test", "armed", "driving", "discharging", "fault", "unknown"]
"""Only an armed or driving board may energise anything; ``unknown`` is a state that this version has no name for."""


@dataclass(frozen=True, slots=True)
class TactilesLimits:
    """What the board of the tactor array enforces, whoever asks.

    :param max_pulse_s: longest time that one coil pulse may last, s.
    :param max_coil_current_a: current of all coils that are on together, A; the board counts 3.907 A a coil.
    :param max_queued_pulses: coil pulses that the board holds for later.
    :param min_supply_v: supply voltage below which it stops, V.
    :param max_on_time_s: on-time that one coil's account may hold, s; it drains as the coil cools.
    """

    max_pulse_s: float
    max_coil_current_a: float
    max_queued_pulses: int
    min_supply_v: float
    max_on_time_s: float


@dataclass(frozen=True, slots=True)
class BrakeLimits:
    """What the brake controller enforces, whoever asks.

    :param max_amplitude_v: volts on any output, V.
    :param max_supply_current_a: current that its high-voltage supply may give, A.
    :param max_frequency_hz: frequency of the square wave, Hz.
    :param max_ttl_s: longest time that volts may stay without another command, s.
    :param max_charge_c: charge stored in all outputs that are on together, C.
    """

    max_amplitude_v: float
    max_supply_current_a: float
    max_frequency_hz: float
    max_ttl_s: float
    max_charge_c: float


Limits = TypeVar("Limits", bound=TactilesLimits | BrakeLimits)


@dataclass(frozen=True, slots=True)
class Identity(Generic[Limits]):
    """Who a board is.

    :param board: ``tactiles`` or ``brake``.
    :param build: the firmware's own name for itself.
    :param protocol: version of the protocol.
    :param boot_id: a number drawn at each boot; it does not change until the board reboots.
    :param channels: how many outputs it has.
    :param dead_man_s: time without a valid frame from the host after which an armed board makes itself safe, s.
    :param limits: what it enforces.
    """

    board: BoardName
    build: str
    protocol: int
    boot_id: int
    channels: int
    dead_man_s: float
    limits: Limits


@dataclass(frozen=True, slots=True)
class TactilesTelemetry:
    """What the board of the tactor array reported last. Tuples are by channel; counters are since the board's boot and wrap.

    :param time_ns: when, on the glove's clock, ns.
    :param state: the board's state.
    :param faults: latched faults by name, such as ``dead_man``.
    :param pulses_begun: coil pulses begun, modulo 65,536.
    :param on_time_s: on-time on each coil's account, rounded up to 20 ms, s.
    :param supply_v: of the coils, V.
    :param current_a: through all coils, A.
    :param queued_pulses: coil pulses that wait for their time.
    :param late_commands: commands that came after their time and were dropped.
    :param bad_frames: frames that the board could not read.
    """

    time_ns: int
    state: BoardState
    faults: tuple[str, ...]
    pulses_begun: tuple[int, ...]
    on_time_s: tuple[float, ...]
    supply_v: float
    current_a: float
    queued_pulses: int
    late_commands: int
    bad_frames: int


@dataclass(frozen=True, slots=True)
class BrakeTelemetry:
    """What the brake controller reported last. Tuples are by output; counters are since the board's boot and wrap.

    :param time_ns: when, on the glove's clock, ns.
    :param state: the board's state.
    :param faults: latched faults by name, such as ``short``.
    :param output_v: measured at each output, V: the amplitude, or less for the moment in which the square wave turns over.
    :param capacitance_f: measured, F; 0 where nothing is driven.
    :param leakage_a: measured, A.
    :param bus_v: of the supply that all outputs share, V.
    :param supply_current_a: out of that supply, A.
    :param queued_commands: commands that wait for their time.
    :param late_commands: commands that came after their time and were dropped.
    :param bad_frames: frames that the board could not read.
    """

    time_ns: int
    state: BoardState
    faults: tuple[str, ...]
    output_v: tuple[float, ...]
    capacitance_f: tuple[float, ...]
    leakage_a: tuple[float, ...]
    bus_v: float
    supply_current_a: float
    queued_commands: int
    late_commands: int
    bad_frames: int


def limits_of(board: Board, limits: tuple[int, ...]) -> TactilesLimits | BrakeLimits:
    """Limits by name.

    :param board: whose.
    :param limits: five integers as in ``identity.limits``, in the wire's units.
    :return: the same in SI units.
    """
    if board is Board.TACTILES:
        pulse, current_ma, queue, supply_mv, on_time_ms = limits
        return TactilesLimits(pulse * DURATION_UNIT_US / 1e6, current_ma / 1e3, queue, supply_mv / 1e3, on_time_ms / 1e3)
    amplitude_v, supply_ua, frequency_dhz, ttl_ms, charge_nc = limits
    return BrakeLimits(float(amplitude_v), supply_ua / 1e6, frequency_dhz / 10, ttl_ms / 1e3, charge_nc / 1e9)


def identity_of(message: Any) -> Identity[Any]:
    """An identity in words and SI units.

    :param message: the decoded ``identity``.
    :return: the same by name.
    """
    board = Board(message.board)
    return Identity(
        board=_name(board),
        build=build_name(message),
        protocol=message.protocol,
        boot_id=message.boot_id,
        channels=message.channels,
        dead_man_s=message.dead_man / 1e3,
        limits=limits_of(board, message.limits),
    )


def build_name(message: Any) -> str:
    """The firmware's own name for itself.

    :param message: the decoded ``identity``.
    :return: up to eight characters.
    """
    return message.build.rstrip(b"\0").decode("ascii", "replace")


def telemetry_of(message: Any, time_ns: int) -> TactilesTelemetry | BrakeTelemetry:
    """Telemetry in SI units.

    :param message: the decoded ``tactiles_telemetry`` or ``brake_telemetry``.
    :param time_ns: its time on the host's clock, ns.
    :return: the same by name.
    :raises InputError: another message.
    """
    kind = type(message).__name__
    state, faults = state_name(message.state), fault_names(message.faults)
    if kind == "tactiles_telemetry":
        return TactilesTelemetry(
            time_ns=time_ns,
            state=state,
            faults=faults,
            pulses_begun=tuple(message.played),
            on_time_s=tuple(count * HEAT_UNIT_MS / 1e3 for count in message.heat),
            supply_v=message.supply / 1e3,
            current_a=message.current / 1e3,
            queued_pulses=message.queued,
            late_commands=message.late,
            bad_frames=message.bad_frames,
        )
    if kind == "brake_telemetry":
        return BrakeTelemetry(
            time_ns=time_ns,
            state=state,
            faults=faults,
            output_v=tuple(float(volts) for volts in message.output),
            capacitance_f=tuple(picofarad / 1e12 for picofarad in message.capacitance),
            leakage_a=tuple(count / 1e7 for count in message.leakage),
            bus_v=float(message.bus),
            supply_current_a=message.supply_current / 1e6,
            queued_commands=message.queued,
            late_commands=message.late,
            bad_frames=message.bad_frames,
        )
    raise InputError(f"message = {kind} is no telemetry; expected tactiles_telemetry or brake_telemetry")


def state_name(state: int) -> BoardState:
    """A board's state by name.

    :param state: as in telemetry.
    :return: the name in lower case, ``unknown`` for a number without one.
    """
    known = state in State.__members__.values()
    return cast(BoardState, State(state).name.lower()) if known else "unknown"


def fault_names(mask: int) -> tuple[str, ...]:
    """Latched faults by name.

    :param mask: of 16 bits, as in telemetry.
    :return: names in lower case, in the order of the bits; ``fault 14`` for one without a name.
    """
    return tuple(fault_name(bit) for bit in range(16) if mask >> bit & 1)


def fault_name(fault: int) -> str:
    """One fault by name.

    :param fault: its number.
    :return: the name in lower case, or ``fault 14`` for one without a name.
    """
    return Fault(fault).name.lower() if fault in Fault.__members__.values() else f"fault {fault}"


def _name(board: Board) -> BoardName:
    return "tactiles" if board is Board.TACTILES else "brake"
