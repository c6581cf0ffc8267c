"""A recording as a file for the rerun viewer (extra ``view``): a derived view, never the archive.

The layout of its windows is in the file. Nothing but the file is touched: no viewer is started, no port opened.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.recording.recording import Recording
from haptics.recording.views import view_data
from haptics.recording.views.rerun_library import open_rerun, viewer_file

TIMELINE = "session"
"""Time since the session's start."""

_ROWS_PER_CHUNK = 2048  # the viewer loads chunk by chunk
_PIN_IN_M, _PIN_OUT_M = 0.004, 0.006
_BONE_COLOUR, _JOINT_COLOUR = (150, 150, 160), (200, 200, 208)


def write_rrd(recording: Recording, path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Write ``recording`` for the rerun viewer: hands, actuators coloured by temperature rise, pins, brakes, events.

    :param recording: what to show.
    :param path: the file to write (``.rrd``).
    :param force: overwrite it if it exists.
    :return: the file.
    :raises InputError: rerun is not installed, or ``path`` exists and ``force`` is not given.
    :raises HapticsError: rerun cannot write the file.
    """
    rr = open_rerun()
    out = Path(path)
    identity = json.dumps([recording.header, recording.footer], sort_keys=True)
    number = hashlib.sha256(identity.encode()).hexdigest()[:32]
    with viewer_file(rr, out, force, "haptics", number, _blueprint) as stream:
        _Writer(rr, stream, recording).write()
    return out


class _Writer:
    def __init__(self, rr: Any, stream: Any, recording: Recording):
        self._rr, self._stream, self._recording = rr, stream, recording
        self._origin_ns = view_data.start_ns(recording)

    def write(self) -> None:
        self._stream.log("hand", self._rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        for side in view_data.SIDES:
            self._hand(side)
        ticks = view_data.rows(self._recording, "ticks", ())
        sites = view_data.sites_of(self._recording)
        self._actuators(sites, ticks)
        self._series("actuators/rise_k", ticks, "rise_k", sites.names, "site")
        self._series("brake/volts", ticks, "volts", view_data.brakes_of(self._recording), "brake")
        self._series("brake/force_n", ticks, "force_n", view_data.brakes_of(self._recording), "brake")
        self._states("pins", ticks, "pin_out", sites.names, "site", "out")
        self._states("piezo", ticks, "piezo", view_data.FINGERS, "piezo", "on")
        self._events()

    def _hand(self, side: str) -> None:
        rr, poses = self._rr, view_data.poses_of(self._recording, side)
        if not len(poses):
            return
        joints, bones = f"hand/{side}/joints", f"hand/{side}/bones"
        position_m = poses["position_m"].astype(np.float32)
        self._stream.log(joints, rr.Points3D.from_fields(radii=0.003, colors=_JOINT_COLOUR), static=True)
        self._stream.log(bones, rr.LineStrips3D.from_fields(radii=0.0025, colors=_BONE_COLOUR), static=True)
        self._send(joints, poses["time_ns"], position_m, lambda values: rr.Points3D.columns(positions=values))
        chains = position_m[:, view_data.CHAINS]
        self._send(bones, poses["time_ns"], chains, lambda values: rr.LineStrips3D.columns(strips=values))

    def _actuators(self, sites: view_data.Sites, ticks: NDArray[np.void]) -> None:
        rr, side = self._rr, view_data.glove_side(self._recording)
        poses = view_data.poses_of(self._recording, side)
        if not len(poses):
            return
        path, count = f"hand/{side}/actuators", len(sites.names)
        self._stream.log(path, rr.Points3D.from_fields(labels=list(sites.names), show_labels=False), static=True)
        self._send(path, poses["time_ns"], sites.positions(poses), lambda values: rr.Points3D.columns(positions=values))
        # the viewer joins the latest position, colour and radius, so each is sent at its own times
        rise_k, out = view_data.field(ticks, "rise_k"), view_data.field(ticks, "pin_out")
        if rise_k.shape[1] == count:
            colours = view_data.rise_colours(rise_k)
            self._send(path, ticks["time_ns"], colours, lambda values: rr.Points3D.columns(colors=values))
        if out.shape[1] == count:
            radii = np.where(out != 0, _PIN_OUT_M, _PIN_IN_M)
            self._send(path, ticks["time_ns"], radii, lambda values: rr.Points3D.columns(radii=values))
        else:
            self._stream.log(path, rr.Points3D.from_fields(radii=_PIN_IN_M), static=True)

    def _series(self, path: str, ticks: NDArray[np.void], field: str, names: Sequence[str], what: str) -> None:
        rr, values = self._rr, view_data.field(ticks, field)
        if values.size:
            self._stream.log(path, rr.SeriesLines(names=view_data.labels(names, values.shape[1], what)), static=True)
            self._send(path, ticks["time_ns"], values, lambda values: rr.Scalars.columns(scalars=values))

    def _states(self, path: str, ticks: NDArray[np.void], field: str, names: Sequence[str], what: str, on: str) -> None:
        rr, states = self._rr, view_data.field(ticks, field) != 0
        if not states.size:
            return
        style = rr.StateConfiguration(values=[on, "off"], colors=[0x4575B4FF, 0x00000000], visible=[True, False])
        for state, name in zip(states.T, view_data.labels(names, states.shape[1], what), strict=True):
            lane = f"{path}/{name.replace(' ', '_')}"
            self._stream.log(lane, style, static=True)
            change = np.concatenate([[True], state[1:] != state[:-1]])
            words = np.where(state[change], on, "off")[:, None]
            self._send(lane, ticks["time_ns"][change], words, lambda values: rr.StateChange.columns(state=values.tolist()))

    def _events(self) -> None:
        lines = view_data.events_of(self._recording)
        times = np.array([time_ns for time_ns, *_ in lines], np.int64)
        words = np.array([[line[1:]] for line in lines], object)
        self._send(
            "events", times, words, lambda values: self._rr.TextLog.columns(level=list(values[:, 0]), text=list(values[:, 1]))
        )

    def _send(self, path: str, time_ns: NDArray[np.int64], values: NDArray[Any], columns: Callable[[NDArray[Any]], Any]) -> None:
        """``values`` (time, n, ...) as rows of n, made into ``columns`` from an array (time * n, ...)."""
        for first in range(0, len(time_ns), _ROWS_PER_CHUNK):
            part = values[first : first + _ROWS_PER_CHUNK]
            since = (time_ns[first : first + _ROWS_PER_CHUNK] - self._origin_ns).astype("timedelta64[ns]")
            flat = columns(part.reshape(-1, *part.shape[2:]))
            self._stream.send_columns(
                path, [self._rr.TimeColumn(TIMELINE, duration=since)], flat.partition(np.full(len(part), part.shape[1]))
            )


def _blueprint() -> Any:
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(origin="/hand", name="Hand, actuators by temperature"),
                rrb.TextLogView(origin="/events", name="Events"),
                row_shares=[3, 1],
            ),
            rrb.Vertical(
                rrb.StateTimelineView(origin="/", contents=["/pins/**", "/piezo/**"], name="Pins out, piezos on"),
                rrb.TimeSeriesView(origin="/actuators/rise_k", name="Temperature rise (K)"),
                rrb.TimeSeriesView(origin="/brake/volts", name="Brake (V)"),
                rrb.TimeSeriesView(origin="/brake/force_n", name="Brake (N)"),
            ),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
