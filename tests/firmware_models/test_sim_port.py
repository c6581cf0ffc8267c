"""``sim://`` as a serial port: found by pyserial by name, refused by name when misused, shared by world, in either clock."""

from __future__ import annotations

import errno
import subprocess
import sys
import textwrap

import pytest
import serial

from haptics.errors import InputError
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, Fault, State, Status
from haptics.link.ports import open_port
from haptics.link.simulated import simulated

MS = 1_000_000


@pytest.mark.slow
def test_pyserial_finds_the_board_unpatched_and_without_importing_it_first() -> None:
    """In a fresh interpreter: only the package's name is handed to pyserial; the default clock is the real one."""
    script = """
        import serial
        serial.protocol_handler_packages.append("firmware_models")
        port = serial.serial_for_url("sim://tactiles", baudrate=500000, timeout=5)
        from haptics.link.framing import encode_frame
        port.write(encode_frame(1, 7))
        print(len(port.read_until(b"\\x00")))
        port.close()
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["41"], done.stderr


def test_it_is_a_simulated_port(host) -> None:
    assert simulated(host().port) is not None


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("sim://glove", ["glove", "sim://tactiles, sim://brake"]),
        ("sim://tactiles?colour=red", ["unknown key 'colour'", "known keys: ", "seed", "tau_s"]),
        ("sim://tactiles?seed=first", ["seed", "first", "0 to"]),
        ("sim://tactiles?seed=1.5", ["seed", "1.5", "whole"]),
        ("sim://tactiles?seed=1&seed=2", ["seed", "twice"]),
        ("sim://tactiles?spread=-1", ["spread", "-1", "0 to 3"]),
        ("sim://tactiles?spread=nan", ["spread", "nan", "0 to 3"]),
        ("sim://tactiles?level=exact", ["level", "exact", "event", "dynamic"]),
        ("sim://tactiles?clock=solar", ["clock", "solar", "real, virtual"]),
        ("sim://tactiles?core=rust", ["core", "'rust'", "py, c, avr"]),
        ("sim://loadcell?core=c", ["core = c", "loadcell", "leave core out"]),
        ("sim://brake?fitted=6", ["fitted", "6", "0 to 5"]),
        ("sim://brake/left", ["sim://brake/left"]),
    ],
)
def test_a_bad_url_is_refused_with_what_is_allowed(host, url, words) -> None:
    host()  # registers the package
    with pytest.raises(InputError) as caught:
        serial.serial_for_url(url)
    assert all(word in str(caught.value) for word in words)


def test_ports_of_their_own_do_not_share_time(host) -> None:
    a, b = host(), host()
    a.run(10)
    assert (a.now_ns, b.now_ns) == (10 * MS, 0)


def test_ports_of_one_world_share_time_and_events(host) -> None:
    glove, brake = host("tactiles", world="shared"), host("brake", world="shared")
    glove.arm()
    assert brake.now_ns == glove.now_ns
    brake.send("identify")
    glove.live(50)
    brake.run(0)
    assert brake.all("brake_telemetry")
    assert brake.now_ns == glove.now_ns


def test_a_board_is_open_once_and_can_be_opened_again_in_its_world(host) -> None:
    first = host("tactiles", world="busy")
    other = host("brake", world="busy")
    first.arm()
    with pytest.raises(serial.SerialException) as caught:
        host("tactiles", world="busy")
    assert caught.value.errno == errno.EBUSY
    with pytest.raises(InputError, match="clock"):
        host("tactiles", world="busy", clock="real")
    boot_id = first.ask("identify").boot_id
    first.port.close()
    with pytest.raises(InputError, match="settings"):
        host("tactiles", world="busy", seed=2)
    other.run(150)
    again = host("tactiles", world="busy")
    assert again.ask("identify").boot_id == boot_id
    assert again.port.truth()["state"] == State.FAULT  # it lived on, and its dead-man fired


def test_the_last_port_takes_its_world_away(host) -> None:
    one = host("tactiles", world="gone")
    one.arm()
    one.port.close()
    two = host("tactiles", world="gone")
    assert two.now_ns == 0
    assert two.port.truth()["state"] == State.DISARMED


def test_a_blocking_read_lets_virtual_time_pass_and_no_more_than_its_timeout(host) -> None:
    h = host()
    h.port.timeout = 0.25
    assert h.port.read(10) == b""
    assert h.now_ns == 250 * MS
    h.port.write(encode_frame(BY_NAME["identify"].type, 1))
    assert len(h.port.read(41)) == 41
    assert h.now_ns < 252 * MS
    first = h.now_ns
    assert len(h.port.read(1)) == 1  # telemetry begins 20 ms later; its first byte is there after ten bits
    assert h.now_ns > first
    assert h.port.in_waiting == 0


def test_a_read_that_nothing_could_end_is_refused(host) -> None:
    h = host()
    h.port.timeout = None
    with pytest.raises(serial.SerialException, match="timeout"):
        h.port.read(1)


def test_bytes_arrive_one_by_one_at_the_baud_rate(host) -> None:
    h = host()
    h.port.write(encode_frame(BY_NAME["identify"].type, 1))
    assert h.port.out_waiting == 6
    h.port.flush()
    assert h.port.out_waiting == 0
    assert h.now_ns == 6 * 20_000
    h.port.timeout = 1
    h.port.read(1)
    start = h.now_ns
    for k in range(1, 10):
        h.port.advance(start + k * 20_000)
        assert h.port.in_waiting == k


def test_what_was_not_sent_can_be_dropped(host) -> None:
    h = host()
    h.port.write(encode_frame(BY_NAME["identify"].type, 1))
    h.port.reset_output_buffer()
    h.run(20)
    assert not h.heard
    h.ask("identify")
    h.run(100)
    h.port.write(encode_frame(BY_NAME["identify"].type, 1))
    h.port.advance(h.now_ns + 5 * MS)
    h.port.reset_input_buffer()
    assert h.port.in_waiting == 0


def test_time_does_not_go_back(host) -> None:
    h = host()
    h.run(10)
    with pytest.raises(InputError, match="forward"):
        h.port.advance(5 * MS)


def test_nobody_moves_the_real_clock(host) -> None:
    h = host(clock="real")
    with pytest.raises(InputError, match="virtual"):
        h.port.advance(h.now_ns + 10**12)


def test_on_the_real_clock_the_board_catches_up_when_looked_at(host) -> None:
    h = host(clock="real")
    h.port.timeout = 5
    h.port.write(encode_frame(BY_NAME["identify"].type, 1))
    assert len(h.port.read_until(b"\x00")) == 41
    assert len(h.port.read_until(b"\x00")) == 68  # telemetry


def test_a_closed_port_says_so(host) -> None:
    h = host()
    h.port.close()
    h.port.close()
    for use in (h.port.read, lambda: h.port.write(b"a"), lambda: h.port.in_waiting, h.port.truth, h.port.next_event):
        with pytest.raises(serial.SerialException):
            use()


@pytest.mark.parametrize(("board", "load"), [("tactiles", {"weight": 1}), ("brake", {"stiffness_n_m": 1})])
def test_an_unknown_load_is_refused(host, board, load) -> None:
    with pytest.raises(InputError, match=next(iter(load))):
        host(board).port.set_load(0, **load)
    with pytest.raises(InputError, match="channel"):
        host(board).port.set_load(99)


def test_next_event_is_none_when_nothing_will_happen(host) -> None:
    h = host()
    assert h.port.next_event() is None
    h.send("keepalive")
    assert h.port.next_event() == len(encode_frame(7, 0)) * 20_000


def test_a_fault_is_told_only_to_a_host_that_has_introduced_itself(host) -> None:
    h = host()
    probe = host()
    boot_id = probe.ask("identify").boot_id  # the same seed boots with the same id
    assert h.status("arm", boot_id) == Status.OK
    h.run(200)
    assert h.port.truth()["state"] == State.FAULT
    assert not h.all("fault")
    h.ask("identify")
    h.run(50)
    assert h.last("tactiles_telemetry").faults == 1 << Fault.DEAD_MAN


def test_others_in_a_world_go_on_until_the_own_board_acts_or_bytes_wait() -> None:
    """A load cell of 500 Hz beside a brake board, which is asked who it is at other phases of the cell's 2 ms."""
    with (
        open_port("sim://brake?world=passed-by&clock=virtual", 500_000) as board,
        open_port("sim://loadcell?world=passed-by&clock=virtual", 500_000) as cell,
    ):
        assert board.pass_by(MS) is None
        assert board.now_ns == 0  # nothing happens as early
        assert board.pass_by(100 * MS) is None
        assert 98 * MS <= board.now_ns <= 100 * MS
        assert cell.in_waiting > 40 * len("0 0\n")
        met = 0
        for seq in range(1, 9):
            board.write(encode_frame(BY_NAME["identify"].type, seq))
            fed_ns = board.now_ns + 20_000 * len(encode_frame(BY_NAME["identify"].type, seq))
            assert board.pass_by(board.now_ns + 10 * MS) is None
            assert board.now_ns < fed_ns  # the board has yet to hear it
            board.advance(fed_ns)
            waits_ns = board.pass_by(fed_ns + MS)
            if waits_ns is not None:  # a sample while the answer comes in
                met += 1
                assert waits_ns == board.now_ns
                assert 0 < board.in_waiting < 41
            board.advance(fed_ns + 2 * MS + 300_000)
            assert len(board.read(board.in_waiting)) >= 41
        assert met
