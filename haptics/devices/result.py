"""What a driver says became of a request."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one request.

    ``site`` is a site of the array or the name of a brake; ``kind``: ``contact``, ``release``, ``pulse``, ``burst``, ``brake``,
    ``piezo``. ``reason`` says why a denied one was. ``start_ns``: when it begins, or was to; None if it came to no such time.
    """

    site: str
    kind: str
    played: bool
    reason: str | None
    requested_ns: int
    start_ns: int | None
