from __future__ import annotations

import errno
import os
import re
import sys
import types
from pathlib import Path

import pytest
import serial

from haptics.errors import InputError, LinkLost, PortBusy, PortMissing
from haptics.link import list_ports, open_port, ports
from haptics.link.ports import SCHEMES, PortErrors, PortInfo


def test_simulated_boards_and_instruments_are_listed():
    assert {port.url for port in list_ports() if port.simulated} == {
        f"sim://{name}" for name in ("tactiles", "brake", "thermocouple", "accelerometer", "loadcell", "stage", "probe")
    }


def test_handlers_are_found_by_name_and_nothing_is_imported():
    assert "firmware_models" in serial.protocol_handler_packages
    code = "import sys, haptics.link; assert not any(name.startswith('firmware_models') for name in sys.modules)"
    assert os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", code]) == 0


def test_a_port_that_is_not_there():
    with pytest.raises(PortMissing, match="no such port") as caught:
        open_port("/dev/does_not_exist")
    assert caught.value.port == "/dev/does_not_exist"
    assert "sim://tactiles" in str(caught.value)


def test_a_port_that_is_not_there_names_the_nearest_that_is(monkeypatch):
    monkeypatch.setattr(ports, "list_ports", lambda: [PortInfo(url, "") for url in ("/dev/ttyUSB7", "/dev/ttyACM7")])
    with pytest.raises(PortMissing) as caught:
        open_port("/dev/ttyAMC7")
    expected = "no such port; ports found: /dev/ttyUSB7, /dev/ttyACM7; did you mean /dev/ttyACM7?"
    assert str(caught.value) == f"/dev/ttyAMC7: open: {expected}"


@pytest.mark.parametrize("url", ["", "   ", "carrier-pigeon://loft", "loop://?nonsense=1"])
def test_what_is_no_port_is_refused_with_what_is_allowed(url):
    with pytest.raises((InputError, PortMissing)) as caught:
        open_port(url)
    if not url.startswith("loop"):
        assert "sim://tactiles" in str(caught.value)
        assert "/dev/ttyACM0" in str(caught.value)


@pytest.mark.parametrize("scheme", ["spy", "SPY", "alt", "cp2110", "http", "file", "sim:spy", " sim", "SOCKET"])
def test_kinds_that_are_not_documented_are_refused_before_anything_is_opened(scheme, monkeypatch):
    monkeypatch.setattr(serial, "serial_for_url", lambda *_, **__: pytest.fail("it was opened"))
    with pytest.raises(InputError, match="expected sim://tactiles") as caught:
        open_port(f"{scheme}:///dev/ttyACM0?file=victim")
    assert f"{scheme}://" in str(caught.value)


def test_every_kind_that_is_allowed_is_documented_and_the_other_way_round():
    page = (Path(__file__).parents[2] / "docs" / "reference" / "lines.md").read_text()
    table = page.split("Nothing else is opened")[0]
    assert set(re.findall(r"`(\w+)://", table)) == set(SCHEMES)


@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
@pytest.mark.parametrize("rest", ["", ":", "127.0.0.1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:0", "127.0.0.1:99999", "[::1:7"])
def test_a_host_without_a_port_is_refused_by_form(scheme, rest):
    with pytest.raises(InputError, match=rf"expected {scheme}://HOST:PORT"):
        open_port(f"{scheme}://{rest}")


@pytest.mark.parametrize("url", ["hwgrep://", "hwgrep://(", "hwgrep://x&n=y", "rfc2217://127.0.0.1:1?colour=red", "loop://?x=1"])
def test_what_a_kind_of_port_cannot_use_is_an_input_error(url):
    with pytest.raises(InputError, match=re.escape(url)):
        open_port(url)


@pytest.mark.parametrize("url", [None, 5, b"/dev/ttyACM0", ["sim://tactiles"], "a\0b", "/dev/tty\n"])
def test_what_is_no_text_that_can_be_read_is_no_port(url):
    with pytest.raises(InputError, match="port = "):
        open_port(url)


@pytest.mark.pty
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX words")
def test_what_is_there_and_no_serial_port_is_called_so(tmp_path):
    file = tmp_path / "recording.h5"
    file.write_bytes(b"content")
    with pytest.raises(PortMissing, match="not a serial port"):
        open_port(str(file))
    assert file.read_bytes() == b"content"
    with pytest.raises(PortMissing, match="is a folder"):
        open_port(str(tmp_path))


def test_unknown_scheme_is_an_input_error():
    with pytest.raises(InputError, match="carrier-pigeon"):
        open_port("carrier-pigeon://loft")


def test_missing_boards_package_is_named(monkeypatch):
    monkeypatch.setattr(serial, "protocol_handler_packages", ["serial.urlhandler"])
    with pytest.raises(InputError, match="firmware_models"):
        open_port("sim://tactiles")


@pytest.mark.parametrize("baud", [0, -5])
def test_a_baud_rate_nobody_has_is_refused(baud):
    with pytest.raises(InputError, match="baud"):
        open_port("loop://", baud)


@pytest.mark.pty
@pytest.mark.skipif(sys.platform == "win32", reason="needs pseudo-terminals")
def test_a_port_open_elsewhere_names_who_has_it():
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    os.close(theirs)
    first = open_port(path)
    try:
        with pytest.raises(PortBusy, match="already open") as caught:
            open_port(path)
        if os.path.isdir("/proc/self/fd"):
            assert f"pid {os.getpid()}" in str(caught.value)
            assert "this program" in str(caught.value)
    finally:
        first.close()
        os.close(ours)
    with pytest.raises((PortMissing, LinkLost)):
        open_port(path)


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (errno.EBUSY, PortBusy),
        (errno.EAGAIN, PortBusy),
        (errno.EACCES, LinkLost),
        (errno.ENOENT, PortMissing),
        (errno.EIO, LinkLost),
    ],
)
def test_every_failure_to_open_has_its_error(monkeypatch, number, kind):
    def refuse(*args, **kwargs):
        raise serial.SerialException(number, os.strerror(number))

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(kind) as caught:
        open_port("/dev/ttyACM0")
    assert type(caught.value) is kind


def test_busy_on_windows_is_told_by_its_words(monkeypatch):
    def refuse(*args, **kwargs):
        raise serial.SerialException("could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortBusy):
        open_port("COM3")


@pytest.mark.parametrize(
    "error",
    [serial.SerialException("gone"), OSError(errno.EIO, "I/O error"), serial.SerialTimeoutException("stalled"), TypeError()],
)
def test_whatever_an_open_port_raises_becomes_link_lost(error):
    with pytest.raises(LinkLost), PortErrors("/dev/ttyACM0", "write"):
        raise error


def test_settings_given_to_a_device_are_exclusive_and_bounded(monkeypatch):
    seen = {}
    monkeypatch.setattr(serial, "serial_for_url", lambda url, **settings: seen.update(settings) or types.SimpleNamespace())
    open_port("/dev/ttyACM0")
    assert seen["exclusive"] is True
    assert 0 < seen["timeout"] < 0.02
    assert 0 < seen["write_timeout"] < 1
    assert seen["baudrate"] == 500_000
    seen.clear()
    open_port("socket://localhost:1")
    assert "exclusive" not in seen


@pytest.mark.parametrize("number", [errno.EACCES, errno.EPERM])
def test_a_port_that_may_not_be_opened_says_how_to_be_let_in(monkeypatch, number):
    def refuse(*_, **__):
        raise serial.SerialException(number, "no")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(LinkLost, match=r"permission denied.*dialout"):
        open_port("/dev/ttyACM0")
