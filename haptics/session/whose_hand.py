"""Whose hand wears the glove: the calibration that a session goes by, and how a recording keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.calibration.store import load_calibration
from haptics.scene.hands.shown import shown
from haptics.scene.sites import SiteMap, nominal_sites
from haptics.session.configuration import Configuration
from haptics.units import an_instance

_ENTRY = "hand_calibration"


def calibration_of(
    configuration: Configuration, given: HandCalibration | None = None, side: str | None = None
) -> HandCalibration | None:
    """The calibration of the hand that wears a glove.

    :param configuration: of the glove; may name one.
    :param given: goes first.
    :param side: of the hand, where it is known; None: as configured.
    :return: None where nobody has calibrated the hand.
    :raises InputError: none of the name, a file that cannot be used, or a calibration of the other hand.
    """
    if given is None and configuration.hand_calibration is None:
        return None
    calibration = load_calibration(str(configuration.hand_calibration)) if given is None else given
    an_instance("calibration", calibration, HandCalibration, "from haptics.load_calibration")
    side = configuration.side if side is None else side
    if side not in ("auto", calibration.side):
        raise InputError(
            f"calibration {calibration.name!r} is of the {calibration.side} hand, and the {side} one wears the glove; "
            "choose that hand (`side`), or a calibration of this one"
        )
    return calibration


def sites_of(calibration: HandCalibration | None) -> SiteMap:
    """Where the tactors sit.

    :param calibration: of a hand, or None.
    :return: on that hand; on a nominal one if None.
    """
    return nominal_sites() if calibration is None else calibration.sites()


def calibration_header(calibration: HandCalibration | None) -> dict[str, Any]:
    """What a recording's header holds of it: all of it, as the file of its name may change.

    :param calibration: of the hand, or None.
    :return: entries of the header; none where nobody has calibrated the hand.
    """
    return {} if calibration is None else {_ENTRY: {"name": calibration.name, **calibration.table()}}


def recorded_calibration(path: Path, header: Mapping[str, Any]) -> HandCalibration | None:
    """The calibration that a recording was made with.

    :param path: of the recording, for messages.
    :param header: its header.
    :return: the calibration as it was then, or None.
    :raises InputError: the entry is not what ``calibration_header`` made.
    """
    table = header.get(_ENTRY)
    if table is None:
        return None
    if not isinstance(table, dict):
        raise InputError(f"{path}: {_ENTRY} = {shown(table)} in its header is no calibration; expected a table")
    try:
        return HandCalibration.of_table(table.get("name", ""), {key: value for key, value in table.items() if key != "name"})
    except InputError as error:
        raise InputError(f"{path}: {_ENTRY} in its header is no calibration: {error}") from error
