"""What a run records: its streams, and one method for each kind of row.

The journal does the writing; this file defines what a row means. Host times are the run's clock.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haptics.devices import Refusal, Result
from haptics.link.clock import ClockFit
from haptics.link.events import Disarmed, Event, FaultReported, Identified, Lost, Rebooted, Telemetry
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS
from haptics.recording import Journal, StreamSpec
from haptics.scene.geometry.pose import Pose
from haptics.scene.hands.frame import HandFrame
from haptics.scene.sites import SITES, SiteMap
from haptics.time import NS_PER_MS, NS_PER_S
from haptics.version import __version__

COMMIT_NS = 50 * NS_PER_MS
WIRE_BYTES = 96
PORTS = {"tactiles": 1, "brake": 2}


def _spec(name: str, fields: Sequence[tuple], units: Mapping[str, str], description: str) -> StreamSpec:
    return StreamSpec(name, np.dtype([("time_ns", "i8"), *fields]), units, description)


RUN_STREAMS = (
    _spec(
        "poses",
        [
            ("sampled_ns", "i8"),
            ("side", "i1"),
            ("track", "i4"),
            ("accepted", "u1"),
            ("position_m", "f8", (26, 3)),
            ("orientation_xyzw", "f8", (26, 4)),
        ],
        {"sampled_ns": "ns", "position_m": "m"},
        "Poses as they arrived; side 0 is left, 1 right; accepted 0 was refused.",
    ),
    _spec(
        "ticks",
        [
            ("rise_k", "f4", (COIL_CHANNELS,)),
            ("pin_out", "u1", (COIL_CHANNELS,)),
            ("volts", "f4", (BRAKE_CHANNELS,)),
            ("force_n", "f4", (BRAKE_CHANNELS,)),
            ("piezo", "u1", (BRAKE_CHANNELS,)),
        ],
        {"rise_k": "K", "volts": "V", "force_n": "N"},
        "The devices every 10 ms: the simulated plant where there is one, what the driver believes on hardware.",
    ),
    _spec(
        "requests",
        [("site", "S16"), ("kind", "S10"), ("played", "u1"), ("reason", "S16"), ("start_ns", "i8")],
        {"start_ns": "ns"},
        "Every pulse asked for, when its outcome was known; start_ns is 0 for one that was denied.",
    ),
)
"""What a run has beside the streams of its links."""
LINK_STREAMS = (
    _spec(
        "events",
        [("kind", "S20"), ("subject", "S32"), ("object", "S32"), ("detail", "S96")],
        {},
        "Touches, grasps, faults, refusals, arming: what happened, in words.",
    ),
    _spec(
        "wire",
        [("port", "u1"), ("to_board", "u1"), ("length", "u2"), ("data", f"V{WIRE_BYTES}")],
        {"length": "byte"},
        "Bytes on the links in order; port 1 is the tactor array, 2 the brake controller.",
    ),
    _spec(
        "tactiles_telemetry",
        [
            ("device_tick", "u4"),
            ("state", "u1"),
            ("faults", "u2"),
            ("played", "u2", (COIL_CHANNELS,)),
            ("heat_20ms", "u1", (COIL_CHANNELS,)),
            ("supply_mv", "u2"),
            ("current_ma", "u2"),
            ("queued", "u2"),
            ("late", "u2"),
            ("bad_frames", "u2"),
        ],
        {"device_tick": "0.5 us", "heat_20ms": "20 ms", "supply_mv": "mV", "current_ma": "mA"},
        "Telemetry of the tactor array; heat_20ms is each coil's account of on-time, rounded up.",
    ),
    _spec(
        "brake_telemetry",
        [
            ("device_tick", "u4"),
            ("state", "u1"),
            ("faults", "u2"),
            ("output_v", "u2", (BRAKE_CHANNELS,)),
            ("capacitance_pf", "u2", (BRAKE_CHANNELS,)),
            ("leakage_01ua", "u2", (BRAKE_CHANNELS,)),
            ("bus_v", "u2"),
            ("supply_ua", "u2"),
            ("queued", "u2"),
            ("late", "u2"),
            ("bad_frames", "u2"),
        ],
        {
            "device_tick": "0.5 us",
            "output_v": "V",
            "capacitance_pf": "pF",
            "leakage_01ua": "0.1 uA",
            "bus_v": "V",
            "supply_ua": "uA",
        },
        "Telemetry of the brake controller.",
    ),
    _spec(
        "clock_fits",
        [("board", "u1"), ("offset_ns", "i8"), ("bound_ns", "i8")],
        {"offset_ns": "ns", "bound_ns": "ns"},
        "Each estimate of a board's clock: host minus board, and how wrong it can be.",
    ),
)
"""What happened, and what went over the links."""
HAND_STREAMS = (
    _spec(
        "brake_requests",
        [("brake", "S32"), ("kind", "S10"), ("played", "u1"), ("reason", "S16"), ("start_ns", "i8")],
        {"start_ns": "ns"},
        "Every brake and piezo asked for, when its outcome was known; start_ns is 0 for one that was denied.",
    ),
)
"""What a glove driven by hand has besides: what became of its calls for brakes."""
LONGEST_NAME = 400
"""Bytes of the name that a recorded call is about."""
LIVE_STREAMS = (
    _spec("loop", [], {}, "When the loop was ticked; with poses and calls, all that its decisions follow from."),
    _spec(
        "calls",
        [("call", "S16"), ("name", f"S{LONGEST_NAME}"), ("position_m", "f8", (3,)), ("orientation_xyzw", "f8", (4,))],
        {"position_m": "m"},
        "Calls of a session that change what it renders, with the object, side or scene that they name.",
    ),
)
"""What a session in real time has besides, so that it can be had again in virtual time."""
SESSION_BLOB = "session"
"""The attachment of a session begins with this: what it was begun with."""


def provenance() -> dict[str, Any]:
    """What made a recording; no time, no user, no host name.

    :return: program, version, commit if it runs from a checkout (else None), interpreter, numpy, machine.
    """
    return {
        "program": "haptics",
        "version": __version__,
        "git_commit": _git_commit(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
    }


def sites_of_joints(sites: SiteMap) -> dict[str, Any]:
    """Where the tactors sit on the joints, so that a recording can be drawn without this program.

    :param sites: of the hand that wears the glove.
    :return: ``names`` of the sites, and ``weights``, ``offset_joint`` and ``offset_m`` of ``haptics.scene.sites.SiteMap``.
    """
    parts = (sites.weights, sites.offset_joint, sites.offset_m)
    return {"names": list(SITES), **{k: v.tolist() for k, v in zip(("weights", "offset_joint", "offset_m"), parts, strict=True)}}


def _git_commit() -> str | None:
    folder = Path(__file__).resolve().parents[2]
    if not (folder / ".git").exists():
        return None
    try:
        found = subprocess.run(["git", "-C", str(folder), "rev-parse", "HEAD"], capture_output=True, text=True, timeout=5)
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip() or None


class LinkRecorder:
    """Rows of events and links, and of any further streams, on their way into a journal.

    :param path: of the journal.
    :param header: written first: what made the recording, and what it is of.
    :param force: a journal that holds nothing may be replaced.
    :param streams: declared besides.
    :raises InputError: the journal's path is taken or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], header: Mapping[str, Any], force: bool, streams: Sequence[StreamSpec] = ()):
        self.path = Path(path)
        self.journal = Journal.create(self.path, header, force=force)
        self.streams = {spec.name: self.journal.declare(spec) for spec in (*streams, *LINK_STREAMS)}
        self._commit_ns = 0

    def event(self, now_ns: int, kind: str, subject: str = "", object_name: str = "", detail: str = "") -> None:
        """Something happened.

        :param now_ns: when, ns.
        :param kind: what, at most 20 bytes, such as ``touch``.
        :param subject: to what, such as a site or a board.
        :param object_name: of the scene.
        :param detail: in words, at most 96 bytes.
        """
        self.streams["events"].append((now_ns, kind, subject, object_name, detail))

    def wire(self, now_ns: int, port: str, to_board: bool, data: bytes) -> None:
        """Bytes went over a link.

        :param now_ns: when, ns.
        :param port: ``tactiles`` or ``brake``.
        :param to_board: their direction.
        :param data: any number of bytes.
        """
        stream = self.streams["wire"]
        for at in range(0, len(data), WIRE_BYTES):
            piece = data[at : at + WIRE_BYTES]
            stream.append((now_ns, PORTS[port], to_board, len(piece), piece.ljust(WIRE_BYTES, b"\0")))

    def link_event(self, board: str, event: Event) -> None:
        """A link reported something; what has no row is passed over.

        :param board: ``tactiles`` or ``brake``.
        :param event: what.
        """
        if isinstance(event, Telemetry):
            self.streams[type(event.message).__name__].append((event.time_ns, *event.message))
        elif isinstance(event, ClockFit):
            bound_ns = round(event.error_s * NS_PER_S)
            offset_ns = round(event.offset_s * NS_PER_S)
            self.streams["clock_fits"].append((event.reference_ns, PORTS[board], offset_ns, bound_ns))
        elif isinstance(event, Identified):
            self.event(event.time_ns, "identified", board, "", f"boot {event.identity.boot_id:08x}")
        elif isinstance(event, (Disarmed, FaultReported, Lost, Rebooted)):
            self.event(event.time_ns, "fault", board, "", str(event))

    def acknowledge(self, now_ns: int) -> None:
        """Commit what is buffered if the last commit is 50 ms old; a kill loses at most what came since.

        :param now_ns: ns.
        """
        if now_ns >= self._commit_ns:
            self._commit_ns = now_ns + COMMIT_NS
            self.journal.commit()


class Recorder(LinkRecorder):
    """Rows of a run, or of a glove driven by hand, on their way into a journal.

    :param path: of the journal.
    :param header: see ``LinkRecorder``.
    :param force: see ``LinkRecorder``.
    :param by_hand: with a stream of what became of calls for brakes.
    :param live: with what a session in real time needs to be replayed.
    :raises InputError: the journal's path is taken or cannot be written.
    """

    def __init__(
        self, path: str | os.PathLike[str], header: Mapping[str, Any], force: bool, *, by_hand: bool = False, live: bool = False
    ):
        more = (*(HAND_STREAMS if by_hand else ()), *(LIVE_STREAMS if live else ()))
        super().__init__(path, header, force, (*RUN_STREAMS, *more))
        self.live, self._sessions = live, 0

    def session(self, begun: Mapping[str, Any]) -> None:
        """A session begins.

        :param begun: with what; plain data.
        """
        if self.live:
            self._sessions += 1
            self.journal.blob(f"{SESSION_BLOB}-{self._sessions}.json", json.dumps(begun).encode())

    def looped(self, now_ns: int) -> None:
        """The loop was ticked.

        :param now_ns: when, ns.
        """
        if self.live:
            self.streams["loop"].append((now_ns,))

    def call(self, now_ns: int, call: str, name: str = "", pose: Pose | None = None) -> None:
        """A call changed what a session renders.

        :param now_ns: when, ns.
        :param call: its name.
        :param name: of the object, side or scene that it is about.
        :param pose: in the world, of ``move_object``.
        """
        if self.live:
            pose = pose or Pose()
            name = name if len(name.encode()) <= LONGEST_NAME else ""  # a part of a path would name another file
            self.streams["calls"].append((now_ns, call, name, pose.position_m, pose.orientation_xyzw))

    def pose(self, now_ns: int, frame: HandFrame, accepted: bool) -> None:
        """A pose arrived.

        :param now_ns: when, ns.
        :param frame: well formed.
        :param accepted: False for one that was refused.
        """
        self.streams["poses"].append(
            (
                now_ns,
                frame.time_ns,
                frame.side == "right",
                frame.track_id,
                accepted,
                frame.position_m,
                frame.orientation_xyzw,
            )
        )

    def tick(self, now_ns: int, rise_k: Any, pin_out: Any, volts: Any, force_n: Any, piezo: Any) -> None:
        """The devices now.

        :param now_ns: ns.
        :param rise_k: (15,), temperature rise of each coil, K.
        :param pin_out: (15,), 1 where the pin is out.
        :param volts: (5,), at each output, V.
        :param force_n: (5,), what each brake holds, N.
        :param piezo: (5,), 1 where it vibrates.
        """
        self.streams["ticks"].append((now_ns, rise_k, pin_out, volts, force_n, piezo))

    def result(self, now_ns: int, one: Result | Refusal) -> None:
        """What became of what was asked of a driver. A run's recording has no row for a brake or piezo.

        :param now_ns: when that was known, ns.
        :param one: from ``Devices.on_result``; a refusal has no row of its own.
        """
        if isinstance(one, Refusal):
            return
        stream = "brake_requests" if one.kind in ("brake", "piezo") else "requests"
        if stream in self.streams:
            self.streams[stream].append((now_ns, one.site, one.kind, one.played, one.reason or "", one.start_ns or 0))
