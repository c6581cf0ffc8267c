"""Hosts on simulated boards, closed when a test ends; the C core, built once."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator

import pytest
from core_bench import build_library
from sim_host import Host


@pytest.fixture
def host() -> Iterator[Callable[..., Host]]:
    """Opens hosts, on the virtual clock by default, and closes them."""
    opened: list[Host] = []

    def open_host(board: str = "tactiles", baudrate: int = 500_000, **query: object) -> Host:
        keys = "&".join(f"{key}={value}" for key, value in {"clock": "virtual", **query}.items())
        opened.append(Host(f"sim://{board}?{keys}", baudrate))
        return opened[-1]

    yield open_host
    for one in opened:
        one.port.close()


@pytest.fixture(scope="session")
def library() -> ctypes.CDLL:
    """The C core as a library."""
    return build_library()
