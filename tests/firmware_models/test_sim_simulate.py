"""A board in its own process behind a pseudo-terminal: it outlives its host and makes itself safe."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.pty,
    pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals exist on POSIX systems only"),
    pytest.mark.timeout(90),
]

SERVE = "import typer; from firmware_models.simulate import simulate; typer.run(simulate)"
HOST = """
    import sys, time, serial
    from haptics.link.framing import Deframer, encode_frame
    from haptics.link.messages import BY_NAME, decode, encode

    port = serial.Serial(sys.argv[1], 500000, timeout=0.002)
    deframer = Deframer()
    seq = 0

    def ask(name, *values):
        global seq
        seq += 1
        while True:
            port.write(encode_frame(BY_NAME[name].type, seq, encode(name, *values)))
            end = time.monotonic() + 0.05
            while time.monotonic() < end:
                for frame in deframer.feed(port.read(64)):
                    if frame.seq == seq and frame.type < 0xA0:
                        return frame

    boot_id = decode("identity", ask("identify").payload).boot_id
    ask("arm", boot_id)
    energise = sys.argv[2]
    while True:
        now = decode("sync_reply", ask("sync", 1).payload).sent
        if energise == "tactiles":
            reply = ask("pulse", (now + 60000) % 2**32, 1, 1, [200] * 15)
        else:
            reply = ask("drive", (now + 60000) % 2**32, 1, 1000, 100, 2000)
        status = decode("reply", reply.payload).status
        if status == 0:
            time.sleep(0.04)
            print("driving", flush=True)
        elif status == 6:  # this machine was busy for longer than the dead-man
            ask("disarm")
            ask("arm", boot_id)
"""


def serve(board: str, trace: Path, *more: str) -> tuple[subprocess.Popen, str]:
    command = [sys.executable, "-c", SERVE, board, "--trace", str(trace), "--for-s", "60", *more]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


@pytest.mark.parametrize("board", ["tactiles", "brake"])
def test_a_killed_host_leaves_nothing_energised_beyond_the_dead_man(tmp_path, board) -> None:
    trace = tmp_path / "trace.jsonl"
    link = tmp_path / "port"
    server, path = serve(board, trace, "--link", str(link), "--query", "level=event" if board == "tactiles" else "")
    host = None
    try:
        assert os.readlink(link) == path
        host = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(HOST), str(link), board], stdout=subprocess.PIPE, text=True
        )
        assert host.stdout is not None
        for _ in range(12):
            assert host.stdout.readline() == "driving\n"
        host.kill()
        host.wait(10)
        lines: list[dict] = []
        while not lines or lines[-1]["state"] != "FAULT" or lines[-1]["energised"]:
            assert server.poll() is None
            lines = [json.loads(line) for line in trace.read_text().splitlines(keepends=True) if line.endswith("\n")]
    finally:
        for process in (host, server):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGTERM)
        server.wait(10)
    assert any(line["energised"] for line in lines)
    live = max(k for k, line in enumerate(lines) if line["state"] != "FAULT")
    fault, off = lines[live + 1], next(line for line in lines[live + 1 :] if not line["energised"])
    # The board's own time: what is energised after its dead-man fired is off within the stated discharge of 5 ms.
    assert off["time_ns"] - fault["time_ns"] <= 5_000_000
    assert fault["faults"] == 1
    assert not link.exists()
    assert server.returncode == 0


def test_bad_arguments_are_refused(tmp_path) -> None:
    from firmware_models.simulate import simulate
    from haptics.errors import InputError

    with pytest.raises(InputError, match="board"):
        simulate("glove")
    with pytest.raises(InputError, match=r"^colour=red: unknown key 'colour' in the port's URL; known keys: .*baud, .*seed"):
        simulate("tactiles", query="colour=red")
    with pytest.raises(InputError, match=r"sede=2: unknown key 'sede' in the port's URL; known keys: .*did you mean seed"):
        simulate("tactiles", query="sede=2")
    with pytest.raises(InputError, match=r"clock = virtual: .* runs on the real clock"):
        simulate("tactiles", query="clock=virtual")
    with pytest.raises(InputError, match="--for-s = -1 s"):
        simulate("tactiles", for_s=-1.0)
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for name in ("link", "trace"):
        with pytest.raises(InputError, match=f"--{name} = {taken} exists; choose another"):
            simulate("tactiles", for_s=0, **{name: taken})
    assert taken.read_text() == "mine"
    with pytest.raises(InputError, match=f"--link = {taken} exists; choose another path, as it is no symbolic link"):
        simulate("tactiles", for_s=0, link=taken, force=True)
    assert taken.read_text() == "mine"


def test_a_link_that_a_killed_board_left_is_overwritten_by_force_only(tmp_path, capsys) -> None:
    from firmware_models.simulate import simulate
    from haptics.errors import InputError

    link, elsewhere = tmp_path / "port", tmp_path / "elsewhere"
    elsewhere.write_text("mine")
    for target in (tmp_path / "gone", elsewhere):
        link.symlink_to(target)
        with pytest.raises(InputError, match=rf"--link = {link} exists; .*\(--force\)"):
            simulate("tactiles", for_s=0, link=link)
        assert os.readlink(link) == str(target)
        simulate("tactiles", for_s=0, link=link, force=True)
        assert not link.is_symlink()
    assert elsewhere.read_text() == "mine"
    assert capsys.readouterr().out.count("/dev/") == 2
