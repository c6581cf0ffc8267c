"""Opening serial ports, real and simulated, and why one did not open.

``sim://`` works through pyserial: the name of the package that holds the boards is appended to its list of handler packages,
and nothing of it is imported here.

Opening a real port raises DTR, which resets boards of the Arduino kind; the operating system does so before a program can
object. A session therefore asks who is there until a board has booted, and never waits for a banner.
"""

from __future__ import annotations

import errno
import os
import re
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial
from serial.tools import list_ports as _serial_ports

from haptics.errors import InputError, LinkError, LinkLost, PortBusy, PortMissing, nearest
from haptics.link.messages import DEFAULT_BAUD
from haptics.link.port_url import is_simulated
from haptics.units import brief

BOARDS_PACKAGE = "firmware_models"
SIMULATED = {
    "sim://tactiles": "simulated TacTiles board",
    "sim://brake": "simulated brake controller",
    "sim://thermocouple": "simulated thermocouple on one actuator",
    "sim://accelerometer": "simulated accelerometer on a pendulum with one actuator",
    "sim://loadcell": "simulated load cell on one brake",
    "sim://stage": "simulated motion stage that pulls one brake",
    "sim://probe": "simulated high-voltage probe and shunt on one brake output",
}
READ_TIMEOUT_S = 0.005
WRITE_TIMEOUT_S = 0.25  # a peer that takes nothing for this long is gone; boards make themselves safe after 0.1 s
SCHEMES = ("sim", "socket", "rfc2217", "hwgrep", "loop")
"""Kinds of URL that may be opened. pyserial knows more, some of which write files (``spy``) or load any class (``alt``)."""
_EXPECTED = (
    "sim://tactiles, sim://brake and others (haptics ports lists them), a device (/dev/ttyACM0, COM3), socket://HOST:PORT, "
    "rfc2217://HOST:PORT, hwgrep://TEXT, loop://"
)
_MAX_BYTES = 1024
"""Taken from a port at one go where it does not report how much waits: 20 ms of a line at 500 kbaud."""

if BOARDS_PACKAGE not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append(BOARDS_PACKAGE)

_port_errors: tuple[type[Exception], ...] = (OSError,)
try:
    import termios
except ImportError:  # Windows
    pass
else:
    _port_errors += (termios.error,)  # an OSError in all but name


class BytePort(Protocol):
    """What a link needs of an open port; pyserial's are such."""

    @property
    def in_waiting(self) -> int: ...

    @property
    def is_open(self) -> bool: ...

    def read(self, size: int = 1, /) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A port that could be opened.

    :param url: what ``open_port`` takes.
    :param description: what the operating system calls it.
    :param serial_number: identifies a USB device for good, while paths change; None if it has none.
    :param simulated: whether the board behind it is simulated.
    """

    url: str
    description: str
    serial_number: str | None = None
    simulated: bool = False


def list_ports() -> list[PortInfo]:
    """Serial ports of this machine, then the simulated boards.

    :return: real ports sorted by path, simulated ones behind them.
    """
    real = sorted(_serial_ports.comports(), key=lambda port: port.device)
    return [
        *(PortInfo(port.device, port.description or "", port.serial_number) for port in real),
        *(PortInfo(url, description, simulated=True) for url, description in SIMULATED.items()),
    ]


def check_port(url: object, name: str = "port") -> str:
    """``url`` if it names a port of a kind that may be opened. Opens nothing, so that a list can be checked before its first.

    :param url: a path or a URL.
    :param name: what the caller calls it, for the message.
    :return: ``url``, unchanged.
    :raises InputError: no text, empty, or a URL of another kind; the message lists the kinds.
    """
    if not isinstance(url, str) or not url.strip() or not url.isprintable():
        raise InputError(f"{name} = {brief(url)} is not a port; expected {_EXPECTED}")
    scheme, found, rest = url.partition("://")
    if found and scheme not in SCHEMES:
        raise InputError(f"{name} = {brief(url)} has the unknown kind {brief(scheme)[1:-1]}://; expected {_EXPECTED}")
    if scheme in ("socket", "rfc2217") and found and not _names_a_host(url):
        raise InputError(f"{name} = {brief(url)} has no host or port; expected {scheme}://HOST:PORT, with a port from 1 to 65535")
    if scheme == "hwgrep" and found and not rest.strip():
        raise InputError(f"{name} = {url!r} would match any port; expected hwgrep://TEXT, such as a USB serial number")
    return url


_KINDS = {"tactiles": "simulated tactor array", "brake": "simulated brake controller"}


def check_board_port(url: object, board: str, name: str = "port") -> str:
    """``url`` if it may be the port of a board of this kind: a simulated one must be of it, a real one tells when it is opened.

    :param url: a path or a URL.
    :param board: ``tactiles`` or ``brake``.
    :param name: what the caller calls the port, for the message.
    :return: ``url``, unchanged.
    :raises InputError: as ``check_port``; or another simulated board.
    """
    checked = check_port(url, name)
    if is_simulated(checked) and urlsplit(checked).netloc != board:
        raise InputError(f"{name} = {checked!r} is no {_KINDS.get(board, board)}; expected sim://{board}, or a real port")
    return checked


def _names_a_host(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return bool(parts.hostname and parts.port)
    except ValueError:  # no number, or past 65535
        return False


def open_port(url: str, baud: int = DEFAULT_BAUD) -> BytePort:
    """Open a port, exclusively if it is a device, with the short time-outs the runners need.

    :param url: a path or a URL, see ``check_port``.
    :param baud: speed of the line; boards use 500 000.
    :return: the open port.
    :raises InputError: see ``check_port``; or what the kind of port cannot use.
    :raises PortMissing: no such port.
    :raises PortBusy: open elsewhere; the message names the process where that can be found out.
    :raises LinkLost: the operating system would not open it, for instance for lack of permission.
    """
    check_port(url)
    settings: dict[str, Any] = {"baudrate": baud, "timeout": READ_TIMEOUT_S, "write_timeout": WRITE_TIMEOUT_S}
    if "://" not in url:
        settings["exclusive"] = True
    try:
        port: Any = serial.serial_for_url(url, **settings)
        return port
    except InputError:
        raise
    except (ValueError, KeyError, re.error) as error:  # the latter two: pyserial's own slips on loop://?x and hwgrep://(
        if "not known" in str(error):
            missing = f" (is the package {BOARDS_PACKAGE} installed?)" if url.lower().startswith("sim:") else ""
            raise InputError(f"port = {url!r} has a kind that no handler opens{missing}; expected {_EXPECTED}") from error
        raise InputError(f"port = {url!r}, baud = {baud!r}: {error}; expected {_EXPECTED}") from error
    except _port_errors as error:
        raise _why_not_opened(url, error) from error


def read_waiting(port: BytePort) -> bytes:
    """What has come; waits for nothing.

    ``in_waiting`` shows that something is there, not always how much: pyserial's ``socket://`` answers 0 or 1. Where it answers
    1, it is read and asked again until nothing waits, or a kilobyte has come: a peer that never pauses does not keep its reader.

    :param port: an open port.
    :return: the bytes; empty if none wait.
    :raises OSError: as the port does; see ``PortErrors``.
    """
    count = port.in_waiting
    if count != 1:
        return port.read(count) if count else b""
    parts: list[bytes] = []
    while count and len(parts) < _MAX_BYTES:
        parts.append(port.read(count))
        count = port.in_waiting if parts[-1] else 0
    return b"".join(parts)


class PortErrors:
    """A context that turns whatever an open port raises into one ``LinkLost``. Holds no state, so one may be entered again.

    :param url: name of the port, for the message.
    :param doing: what is being done to it: read, write, close.
    """

    def __init__(self, url: str, doing: str):
        self._url, self._doing = url, doing

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if isinstance(error, serial.SerialTimeoutException):
            seen, advice = f"the peer takes no bytes ({error})", "is the board running? unplug it and plug it in again"
            raise LinkLost(self._url, seen, self._doing, advice) from error
        if isinstance(error, (*_port_errors, TypeError)):  # TypeError: pyserial, when a port is closed under a call
            seen, advice = f"the port went away ({error or type(error).__name__})", "check the cable, and plug it in again"
            raise LinkLost(self._url, seen, self._doing, advice) from error


def _why_not_opened(url: str, error: Exception) -> LinkError:
    number = getattr(error, "errno", None)
    if "expected a string in the form" in str(error):  # pyserial, on options of rfc2217:// and hwgrep:// that it does not know
        raise InputError(f"port = {url!r}: {error}; expected {_EXPECTED}") from error
    if "://" not in url and (number == errno.EISDIR or "Could not configure port" in str(error)):
        what = "a folder" if Path(url).is_dir() else "not a serial port"
        return PortMissing(url, f"is {what}", "open", _there_are(url))
    if number in (errno.EBUSY, errno.EAGAIN) or "access is denied" in str(error).lower():
        return PortBusy(url, f"port already open {_holders(url)}", "open", "close it there first")
    if number in (errno.EACCES, errno.EPERM):
        return LinkLost(
            url, "permission denied", "open", "on Linux, add yourself to the group that owns the device (dialout, uucp)"
        )
    if number in (None, errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR, errno.ECONNREFUSED):
        why = "" if number == errno.ENOENT else f" ({error})"
        return PortMissing(url, f"no such port{why}", "open", _there_are(url))
    return LinkLost(url, f"cannot be opened ({error})", "open")


def _there_are(url: str) -> str:
    """What can be opened instead: all ports, then the one of the nearest name."""
    found = [port.url for port in list_ports()]
    return f"ports found: {', '.join(found)}{nearest(url, found)}"


def _holders(url: str) -> str:
    """Who has a device open, as far as /proc shows (Linux; other users' processes stay hidden)."""
    if "://" in url:
        return "in this program"
    target = os.path.realpath(url)
    found: list[str] = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if any(os.path.realpath(link) == target for link in (process / "fd").iterdir()):
                name = (process / "comm").read_text().strip()
                found.append(f"{name}, pid {process.name}" + (", this program" if int(process.name) == os.getpid() else ""))
        except OSError:
            continue
    return f"by {'; '.join(found)}" if found else "elsewhere"
