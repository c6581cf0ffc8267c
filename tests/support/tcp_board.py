"""A simulated board behind a real TCP socket on this machine, moved by a thread."""

from __future__ import annotations

import socket
import threading
import uuid

import serial

import haptics.link.ports  # noqa: F401  # lets pyserial find the simulated boards
from haptics.link.messages import DEFAULT_BAUD


class TcpBoard:
    """Serves one connection after another; use as a context manager. ``url`` is where."""

    def __init__(self, board: str = "tactiles", query: str = ""):
        self._board = serial.serial_for_url(f"sim://{board}?world={uuid.uuid4().hex}{query}", baudrate=DEFAULT_BAUD, timeout=0)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> TcpBoard:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._server.close()
        self._thread.join(30)
        self._board.close()

    def _serve(self) -> None:
        self._server.settimeout(0.05)
        while not self._ends.is_set():
            try:
                peer, _ = self._server.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer.settimeout(0.0005)
            with peer:
                self._carry(peer)

    def _carry(self, peer: socket.socket) -> None:
        while not self._ends.is_set():
            try:
                data = peer.recv(4096)
                if not data:
                    return
                self._board.write(data)
            except TimeoutError:
                pass
            except OSError:
                return
            waiting = self._board.in_waiting
            if waiting:
                peer.sendall(self._board.read(waiting))
