"""Looking at a link for a while: who is there, how it is, and how well the line does. Arms nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from haptics.errors import LinkError
from haptics.link.connection import Link
from haptics.link.events import NO_CHANNEL, FaultReported, Rebooted, Telemetry
from haptics.link.framing import BITS_PER_BYTE, FRAMING_BYTES
from haptics.link.messages import DEFAULT_BAUD, Board, payload_size
from haptics.link.ports import open_port
from haptics.link.readings import build_name, fault_name, fault_names, limits_of, state_name
from haptics.link.runner import RealtimeRunner, VirtualRunner, connect
from haptics.link.session import LinkSession
from haptics.link.settings import FINER_LINE, LinkCounters
from haptics.link.simulated import SimulatedPort
from haptics.link_trial.observed import ObservedPort
from haptics.time import NS_PER_MS, NS_PER_S, seconds_to_ns

TELEMETRY_PERIOD_NS = 20 * NS_PER_MS
_LONGEST_COMMAND = payload_size("pulse") + FRAMING_BYTES
_LOOK_S = 0.1
_SKEW_S = 0.7  # a rate takes exchanges that lie apart


@dataclass(frozen=True, slots=True)
class Who:
    """A board that was identified, and how its clock runs.

    :param port: its URL or path.
    :param board: ``tactiles`` or ``brake``.
    :param build: the firmware's name for itself.
    :param protocol: version of the protocol.
    :param boot_id: eight hexadecimal digits; another one after each boot.
    :param channels: outputs it has.
    :param dead_man_ms: silence after which it makes itself safe (ms).
    :param limits: in SI units, by name with the unit in it; which ones depends on the board.
    :param clock_skew_ppm: how much faster than nominal its clock runs (ppm); NaN if not measured.
    :param clock_error_bound_us: how well its clock is known now (µs); NaN if not measured.
    :param line: whether commands can be scheduled over the line, in words.
    """

    port: str
    board: str
    build: str
    protocol: int
    boot_id: str
    channels: int
    dead_man_ms: int
    limits: dict[str, float]
    clock_skew_ppm: float
    clock_error_bound_us: float
    line: str


@dataclass(frozen=True, slots=True)
class Look:
    """How a link is now. Counts are since the watch began, unless they are the board's own.

    :param port: its URL or path.
    :param board: ``tactiles`` or ``brake``.
    :param build: the firmware's name for itself.
    :param boot_id: eight hexadecimal digits.
    :param elapsed_s: time since the watch began (s).
    :param state: the board's state, ``unknown`` before its first telemetry, ``lost`` once the link ended.
    :param faults: names of the faults latched now.
    :param clock_error_bound_us: how well the board's clock is known now (µs); NaN if not measured.
    :param clock_skew_ppm: how much faster than nominal its clock runs (ppm); NaN if not measured.
    :param min_lead_ms: a timed command is sure to be early enough if it is sent this long before its time (ms): twice the clock's
        error bound (no exchange took longer on its way than that) and what the longest command takes on the line. What a program
        plans ahead beyond it is its margin.
    :param telemetry: messages received.
    :param telemetry_missed: messages missing from the 20 ms grid.
    :param telemetry_hz: messages received each second.
    :param telemetry_share: share of the line that telemetry takes, 0 to 1.
    :param uplink_share: share of the line that all bytes from the board take, 0 to 1.
    :param late_commands: commands that came too late, counted by the board since its boot.
    :param board_bad_frames: frames the board could not read, counted since its boot.
    :param line: whether commands can be scheduled over the line, in words.
    :param counters: the session's, since the link was started.
    :param notes: faults and reboots, in words, in their order.
    :param error: why the link ended, or None.
    """

    port: str
    board: str
    build: str
    boot_id: str
    elapsed_s: float
    state: str
    faults: list[str]
    clock_error_bound_us: float
    clock_skew_ppm: float
    min_lead_ms: float
    telemetry: int
    telemetry_missed: int
    telemetry_hz: float
    telemetry_share: float
    uplink_share: float
    late_commands: int
    board_bad_frames: int
    line: str
    counters: LinkCounters
    notes: list[str] = field(default_factory=list[str])
    error: str | None = None


def open_link(url: str, baud: int = DEFAULT_BAUD) -> tuple[RealtimeRunner | VirtualRunner, Link]:
    """A link on a port, and what drives it: virtual time where the URL asks for that.

    :param url: a port.
    :param baud: speed of a serial line.
    :return: the runner and the link, not started yet.
    :raises InputError, LinkError: see ``open_port``.
    """
    port = open_port(url, baud)
    link = Link(port, LinkSession(None, url, baud=baud if isinstance(port, SimulatedPort) else 0))
    if isinstance(port, ObservedPort) and port.virtual:
        return VirtualRunner([link]), link
    return RealtimeRunner([link]), link


def identify(url: str, baud: int = DEFAULT_BAUD) -> Who:
    """Which board is behind a port.

    :param url: a port.
    :param baud: speed of a serial line.
    :return: the board; it takes a second to measure its clock.
    :raises InputError, LinkError: no board answers; the message names what came instead and what to do.
    """
    runner, link = open_link(url, baud)
    try:
        identity = connect(runner)[0]
        runner.wait_for(lambda: link.error is not None, _SKEW_S)
        return _who(runner, link, identity)
    finally:
        close(runner, link)


def close(runner: RealtimeRunner | VirtualRunner, link: Link) -> None:
    """Stop what drives a link, and close its port.

    :param runner: from ``open_link``.
    :param link: from ``open_link``.
    """
    if isinstance(runner, RealtimeRunner):
        runner.close()
    link.close()


def _who(runner: RealtimeRunner | VirtualRunner, link: Link, identity: Any) -> Who:
    fit = link.clock
    return Who(
        port=link.name,
        board=Board(identity.board).name.lower(),
        build=build_name(identity),
        protocol=identity.protocol,
        boot_id=f"{identity.boot_id:08x}",
        channels=identity.channels,
        dead_man_ms=identity.dead_man,
        limits=asdict(limits_of(Board(identity.board), identity.limits)),
        clock_skew_ppm=fit.skew * 1e6 if fit else float("nan"),
        clock_error_bound_us=fit.error_bound_s(runner.now_ns()) * 1e6 if fit else float("nan"),
        line=line_in_words(link, runner.now_ns()),
    )


def line_in_words(link: Link, now_ns: int) -> str:
    """Whether commands can be scheduled over this line: how well the board's clock is known, and how well it must be.

    :param link: a link after its handshake.
    :param now_ns: time of the runner's clock (ns).
    :return: "good", "coarse" or "too coarse", with the numbers and what to do.
    """
    fit, needs = link.clock, link.session.settings
    if fit is None:
        return "too coarse to schedule: the board's clock was not measured"
    known_s = fit.error_bound_s(now_ns)
    known = f"clock known within {known_s * 1e3:.2g} ms"
    if known_s > needs.max_error_s:
        return f"too coarse to schedule: {known}, {needs.max_error_s * 1e3:g} ms needed; {FINER_LINE}"
    if known_s > needs.fine_error_s:
        measure = f" ({needs.exact_error_s * 1e3:g} ms needed to measure by)" if known_s > needs.exact_error_s else ""
        return f"coarse: {known}, so commands play that much later{measure}; {FINER_LINE}"
    return f"good: {known}"


class Monitor:
    """Watches one link that is ready.

    :param runner: what drives it.
    :param link: the link.
    :param baud: of its line, for the shares of the line.
    """

    def __init__(self, runner: RealtimeRunner | VirtualRunner, link: Link, baud: int = DEFAULT_BAUD):
        self._runner, self._link, self._baud = runner, link, baud
        link.events()  # what the handshake took is not part of the watch
        self._begun_ns = runner.now_ns()
        self._bytes_before = link.session.counters.bytes_in
        self._last: Any = None
        self._first_ns: int | None = None
        self._last_ns = 0
        self._telemetry = self._missed = 0
        self._notes: list[str] = []

    @property
    def elapsed_s(self) -> float:
        """Time since the watch began (s)."""
        return (self._runner.now_ns() - self._begun_ns) / NS_PER_S

    def watch(self, for_s: float | None, shown: Callable[[Look], None] = lambda _: None) -> Look:
        """Watch for some time, or until the link is lost.

        :param for_s: how long (s); None: until interrupted.
        :param shown: called ten times a second with the state of the link.
        :return: the last state.
        """
        end_ns = None if for_s is None else self._begun_ns + seconds_to_ns(for_s)
        while self._link.error is None and (end_ns is None or self._runner.now_ns() < end_ns):
            left_s = _LOOK_S if end_ns is None else min((end_ns - self._runner.now_ns()) / NS_PER_S, _LOOK_S)
            self._runner.wait_for(lambda: self._link.error is not None, max(left_s, 0.0))
            shown(self.look())
        return self.look()

    def look(self) -> Look:
        """State of the link now.

        :return: counts and texts so far.
        """
        for event in self._link.events():
            if isinstance(event, Telemetry):
                self._take(event)
            elif isinstance(event, FaultReported):
                channel = "" if event.channel == NO_CHANNEL else f", channel {event.channel}"
                self._notes.append(f"fault {fault_name(event.fault)}{channel}, value {event.value}")
            elif isinstance(event, Rebooted):
                self._last = None
                self._notes.append(f"rebooted: boot id {event.old_boot_id:08x}, now {event.new_boot_id:08x}")
        return self._as_seen(self._link.identity, self._link.error)

    def _take(self, event: Telemetry) -> None:
        """Telemetry comes on a grid of its own; what is not there was missed."""
        if self._last is None:
            self._first_ns = event.time_ns
        else:
            self._missed += max(round((event.time_ns - self._last_ns) / TELEMETRY_PERIOD_NS) - 1, 0)
        self._last, self._last_ns = event.message, event.time_ns
        self._telemetry += 1

    def _as_seen(self, identity: Any, error: LinkError | None) -> Look:
        now_ns, fit, last = self._runner.now_ns(), self._link.clock, self._last
        counters = self._link.session.counters
        elapsed_s = max(self.elapsed_s, 1e-9)
        board = Board(identity.board).name.lower()
        line = self._baud / BITS_PER_BYTE * elapsed_s
        frame_bytes = payload_size(f"{board}_telemetry") + FRAMING_BYTES
        state = state_name(last.state) if last else "unknown"
        return Look(
            port=self._link.name,
            board=board,
            build=build_name(identity),
            boot_id=f"{identity.boot_id:08x}",
            elapsed_s=elapsed_s,
            state=state if error is None else "lost",
            faults=list(fault_names(last.faults)) if last else [],
            clock_error_bound_us=fit.error_bound_s(now_ns) * 1e6 if fit else float("nan"),
            clock_skew_ppm=fit.skew * 1e6 if fit else float("nan"),
            min_lead_ms=1e3 * (2 * fit.error_bound_s(now_ns) + _LONGEST_COMMAND * BITS_PER_BYTE / self._baud)
            if fit
            else float("nan"),
            telemetry=self._telemetry,
            telemetry_missed=self._missed,
            telemetry_hz=self._telemetry / elapsed_s,
            telemetry_share=self._telemetry * frame_bytes / line,
            uplink_share=(counters.bytes_in - self._bytes_before) / line,
            late_commands=last.late if last else 0,
            board_bad_frames=last.bad_frames if last else 0,
            line=line_in_words(self._link, now_ns),
            counters=counters,
            notes=list(self._notes),
            error=str(error) if error is not None else None,
        )
