"""Times and counts a session goes by, and the counters it keeps."""

from __future__ import annotations

from dataclasses import dataclass

from haptics.errors import InputError
from haptics.link.messages import OPEN_COMMANDS
from haptics.time import NS_PER_MS

FINER_LINE = "set the adapter's latency timer to 1 ms, or use a line that hands on bytes at once"
"""What to do about a board's clock that is known coarsely only."""


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Settings of a session. A slower line than 500 kbaud needs a longer ``reply_timeout_ns``.

    :raises InputError: a value is not above 0, or more than eight commands are to be in flight.
    """

    identify_every_ns: int = 100 * NS_PER_MS
    identify_tries: int = 40  # 4 s: a board may be silent for 2 s after opening the port resets it
    sync_exchanges: int = 8
    sync_first_gap_ns: int = 20 * NS_PER_MS  # doubled until it reaches sync_every_ns
    sync_every_ns: int = 500 * NS_PER_MS
    sync_timeout_ns: int = 100 * NS_PER_MS
    sync_misses: int = 4  # in a row: then the board is asked who it is
    reply_timeout_ns: int = 15 * NS_PER_MS
    tries: int = 4
    stop_tries: int = 20
    in_flight: int = OPEN_COMMANDS
    queue_limit: int = 256
    keepalive_every_ns: int = 30 * NS_PER_MS
    fine_error_s: float = 1e-3  # a clock known so well is taken as it is; the lead of commands allows for it
    exact_error_s: float = 5e-3  # what a bench may measure by
    max_error_s: float = 25e-3  # up to this, commands are sent for that much later; beyond, they are refused
    max_age_s: float = 2.0
    clock_jump_s: float = 1.0  # telemetry this far from now makes the board suspect
    rate_tolerance: float = 6e-3
    drift: float = 2e-5
    jitter_s: float = 2e-6

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name)} is not allowed; allowed: above 0")
        if self.in_flight > OPEN_COMMANDS:
            raise InputError(f"in_flight = {self.in_flight} is not allowed; allowed: 1 to {OPEN_COMMANDS}")


@dataclass(slots=True)
class LinkCounters:
    """What came and went since ``start``, for diagnosis."""

    bytes_in: int = 0
    bytes_out: int = 0
    frames_in: int = 0
    bad_frames: int = 0
    strange_frames: int = 0  # whole, but not of this table, board or length
    echoes: int = 0  # frames that only a host sends
    stray_replies: int = 0
    retries: int = 0
    given_up: int = 0
    keepalives: int = 0
    syncs_missed: int = 0
    clock_refusals: int = 0  # commands refused because the clock was not known well enough
    clock_refused_ms: float = 0.0  # the largest error bound at one of these
    clock_contradictions: int = 0
    events_dropped: int = 0
