"""Settings of a session: times and counts; and the counters it keeps."""

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

    :param identify_every_ns: time between two ``identify`` (ns).
    :param identify_tries: times ``identify`` is sent before it is given up; 40 take 4 s: a board may be silent for 2 s after
        opening the port resets it.
    :param sync_exchanges: clock exchanges in a row before commands are taken.
    :param sync_first_gap_ns: time between exchanges after those (ns); doubled until it reaches ``sync_every_ns``.
    :param sync_every_ns: time between exchanges in the long run (ns).
    :param sync_timeout_ns: time after which an exchange counts as missed (ns).
    :param sync_misses: exchanges missed in a row after which the board is asked for its identity again.
    :param reply_timeout_ns: time after which a command is repeated (ns).
    :param tries: times a command is sent before it is given up.
    :param stop_tries: the same for ``stop``.
    :param in_flight: commands open at a time, 1 to 8.
    :param queue_limit: commands open or waiting in the host; more are refused.
    :param keepalive_every_ns: time without a frame after which ``keepalive`` is sent (ns).
    :param fine_error_s: error bound of the clock up to which commands go at their time (s); the lead of commands allows for it.
    :param exact_error_s: error bound by which a bench may measure (s).
    :param max_error_s: error bound up to which commands are sent for that much later (s); beyond it they are refused.
    :param max_age_s: age of the newest exchange beyond which commands are refused (s).
    :param clock_jump_s: distance of a telemetry time from now that makes the board suspect (s).
    :param rate_tolerance: largest relative deviation of the board's clock rate from nominal.
    :param drift: largest relative wander of that rate about its mean.
    :param jitter_s: how early or late a time stamp itself may be (s).
    :raises InputError: a value is not above 0, or more than eight commands are to be in flight.
    """

    identify_every_ns: int = 100 * NS_PER_MS
    identify_tries: int = 40
    sync_exchanges: int = 8
    sync_first_gap_ns: int = 20 * NS_PER_MS
    sync_every_ns: int = 500 * NS_PER_MS
    sync_timeout_ns: int = 100 * NS_PER_MS
    sync_misses: int = 4
    reply_timeout_ns: int = 15 * NS_PER_MS
    tries: int = 4
    stop_tries: int = 20
    in_flight: int = OPEN_COMMANDS
    queue_limit: int = 256
    keepalive_every_ns: int = 30 * NS_PER_MS
    fine_error_s: float = 1e-3
    exact_error_s: float = 5e-3
    max_error_s: float = 25e-3
    max_age_s: float = 2.0
    clock_jump_s: float = 1.0
    rate_tolerance: float = 6e-3
    drift: float = 2e-5
    jitter_s: float = 2e-6

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not getattr(self, name) > 0:
                raise InputError(f"{name} = {getattr(self, name)}; expected more than 0")
        if self.in_flight > OPEN_COMMANDS:
            raise InputError(f"in_flight = {self.in_flight}; must be 1 to {OPEN_COMMANDS} commands")


@dataclass(slots=True)
class LinkCounters:
    """What came and went since ``start``, for diagnosis.

    :param bytes_in: bytes received.
    :param bytes_out: bytes handed to the port.
    :param frames_in: whole frames received.
    :param bad_frames: pieces that were no frame.
    :param strange_frames: whole frames, but not of this table, board or length.
    :param echoes: frames that only a host sends: the line loops back.
    :param stray_replies: replies that no open command waits for.
    :param retries: commands sent again.
    :param given_up: commands without a reply after all tries.
    :param keepalives: ``keepalive`` frames sent.
    :param syncs_missed: clock exchanges without an answer.
    :param clock_refusals: commands refused because the clock was not known well enough.
    :param clock_refused_ms: the largest error bound at one of these (ms).
    :param clock_contradictions: clock exchanges that contradicted earlier ones.
    :param events_dropped: events lost because the owner did not take them.
    """

    bytes_in: int = 0
    bytes_out: int = 0
    frames_in: int = 0
    bad_frames: int = 0
    strange_frames: int = 0
    echoes: int = 0
    stray_replies: int = 0
    retries: int = 0
    given_up: int = 0
    keepalives: int = 0
    syncs_missed: int = 0
    clock_refusals: int = 0
    clock_refused_ms: float = 0.0
    clock_contradictions: int = 0
    events_dropped: int = 0
