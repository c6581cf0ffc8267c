"""What a simulated board's options mean to the C core, and which of them it cannot honour."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from firmware_models.boards.brake_board import BrakeBoard
from firmware_models.boards.tactiles_board import TactilesBoard
from haptics.errors import InputError
from haptics.link.messages import Board
from haptics.physics.brake.parameters import capacitance_f

_MAX_PF = 0xFFFF


class CoreSettings(NamedTuple):
    """``struct settings`` of the core.

    :param limits: in the order and the units of ``identity.limits``.
    :param nominal_pf: capacitance of a sound brake, 1 to 65535 pF; 0 for the coil board.
    """

    limits: tuple[int, ...]
    nominal_pf: int


def core_settings(kind: Board, options: Mapping[str, Any]) -> CoreSettings:
    """The settings that make the core what the Python board is with these options.

    :param kind: which board.
    :param options: values of the board's options, and ``core``.
    :return: the settings.
    :raises InputError: an option that the core, as it is built, cannot follow.
    """
    if kind == Board.BRAKE:
        return CoreSettings(BrakeBoard.built_limits(options), _nominal_pf(options))
    max_a = TactilesBoard.options()["current_limit_a"].default
    if options["current_limit_a"] > max_a:
        raise InputError(
            f"current_limit_a = {options['current_limit_a']:g} A is not allowed with core = {options['core']}: the firmware is "
            f"built for {max_a:g} A and takes stricter limits only; must be 0 to {max_a:g} A, or core=py"
        )
    return CoreSettings(TactilesBoard.built_limits(options), 0)


def _nominal_pf(options: Mapping[str, Any]) -> int:
    nominal_pf = round(1e12 * capacitance_f(options["overlap_m2"], options["thickness_m"], options["permittivity"]))
    if not 1 <= nominal_pf <= _MAX_PF:
        raise InputError(
            f"overlap_m2 = {options['overlap_m2']:g} m2 is not allowed with core = {options['core']}: with this thickness and "
            f"permittivity a brake has {nominal_pf} pF, and the firmware's setting goes from 1 to {_MAX_PF} pF; "
            "choose another geometry, or core=py"
        )
    return nominal_pf
