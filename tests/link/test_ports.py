from __future__ import annotations

import errno
import os
import sys
import types

import pytest
import serial

from haptics.errors import InputError, LinkLost, PortBusy, PortMissing
from haptics.link import list_ports, open_port
from haptics.link.ports import PortErrors


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


@pytest.mark.parametrize("url", ["", "   ", "carrier-pigeon://loft", "loop://?nonsense=1"])
def test_what_is_no_port_is_refused_with_what_is_allowed(url):
    with pytest.raises((InputError, PortMissing)) as caught:
        open_port(url)
    if not url.startswith("loop"):
        assert "sim://tactiles" in str(caught.value)
        assert "/dev/ttyACM0" in str(caught.value)


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
            assert "this very program" in str(caught.value)
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
