"""Calibrations by name: one TOML file each, for people to read and change, in ``calibrations`` of the configuration folder."""

from __future__ import annotations

import re
from pathlib import Path

from haptics.errors import HapticsError, InputError, nearest
from haptics.folders import config_folder
from haptics.recording.output import replacing
from haptics.scene.calibration.hand_calibration import HandCalibration, check_name
from haptics.table_faults import line_of, read_toml
from haptics.units import an_instance, brief, known_arguments, truth

LARGEST_BYTES = 64 * 1024
"""A calibration takes three thousand; what is far larger is something else, and is not read."""
_SUFFIX = ".toml"
_HEADING = "How one hand differs from the nominal one (docs/how-to/calibration.md). Lengths are in metres."


def calibrations_folder() -> Path:
    """Where the calibrations are kept.

    :return: the folder; it need not exist yet.
    """
    return config_folder() / "calibrations"


def saved_calibrations() -> tuple[str, ...]:
    """The calibrations that there are.

    :return: their names, in order.
    :raises InputError: the folder cannot be read.
    """
    folder = calibrations_folder()
    try:
        found = [path.stem for path in folder.iterdir() if path.suffix == _SUFFIX] if folder.exists() else []
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror or error}") from error
    return tuple(sorted(name for name in found if _may_be_called(name)))


@known_arguments
def load_calibration(name: str) -> HandCalibration:
    """A person's calibration by its name.

    :param name: as it was saved.
    :return: checked.
    :raises InputError: none of that name (the message lists those there are), or a file that cannot be used; with line and key.
    """
    path = _existing(name)
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    if len(content) > LARGEST_BYTES:
        raise InputError(f"{path} is no calibration: it has more than {LARGEST_BYTES // 1024} kB")
    try:
        text = content.decode()
        table = read_toml(text, str(path))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not TOML: it is no text in UTF-8 ({error.reason} at byte {error.start})") from error
    except InputError:
        raise
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, tables a thousand deep
        raise InputError(f"{path} is no calibration: {brief(str(error))}") from error
    try:
        return HandCalibration.of_table(name, table)
    except InputError as error:
        keys = re.match(r"\w+(?:\.\w+)*", str(error))
        place = line_of(text, tuple(keys[0].split("."))) if keys else 1
        raise InputError(f"{path}:{place}: {error}") from error


@known_arguments
def save_calibration(calibration: HandCalibration, force: bool = False) -> Path:
    """Keep a calibration under its name; the file is whole or not there.

    :param calibration: of one hand.
    :param force: overwrite one of that name.
    :return: the file.
    :raises InputError: there is one of that name and ``force`` is not given, or nothing can be written there.
    :raises HapticsError: the disk is full or gone.
    """
    import tomlkit  # here, as only who saves needs it

    an_instance("calibration", calibration, HandCalibration, "from CalibrationRoutine.result")
    truth("force", force)
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEADING))
    for key, value in calibration.table().items():
        document.add(key, tomlkit.item(value))
    path = calibrations_folder() / f"{calibration.name}{_SUFFIX}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path.parent}: no folder can be made there ({error.strerror or error})") from error
    with replacing(path, force) as partial:
        partial.write_text(tomlkit.dumps(document), "utf-8")
    return path


def remove_calibration(name: str) -> Path:
    """Remove a calibration.

    :param name: as it was saved.
    :return: the file that was removed.
    :raises InputError: none of that name.
    :raises HapticsError: the system does not let it be removed.
    """
    path = _existing(name)
    try:
        path.unlink()
    except OSError as error:
        raise HapticsError(f"{path} cannot be removed: {error.strerror or error}") from error
    return path


def _existing(name: str) -> Path:
    path = calibrations_folder() / f"{check_name(name)}{_SUFFIX}"
    try:
        there = path.is_file()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    if not there:
        names = saved_calibrations()
        known = (
            f"there are: {', '.join(names)}{nearest(name, names)}" if names else "there is none yet; haptics calibrate makes one"
        )
        raise InputError(f"calibration {name!r} is not in {path.parent}; {known}")
    return path


def _may_be_called(name: str) -> bool:
    try:
        check_name(name)
    except InputError:
        return False
    return True
