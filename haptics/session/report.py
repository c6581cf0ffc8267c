"""What a person wants to know after a run: what was felt, when, at what cost; against the plant's truth where there is one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haptics.fidelity import Plan
from haptics.rendering.felt import TrackTruth, track_truths
from haptics.rendering.onset import Onsets, Touched, held_actions, onset_statistics, touches_on
from haptics.scene.effects import ContactEffect
from haptics.scene.hand import HandFrame, HandRecording
from haptics.scene.placement import closing_strokes
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES, nominal_sites
from haptics.session.session import Session
from haptics.time import NS_PER_S


def build_report(
    *,
    session: Session,
    plan: Plan,
    recording: HandRecording,
    frames: Sequence[HandFrame],
    side: str,
    latency_ns: int,
    start_ns: int,
    ticks: int,
    ticks_missed: int | None,
    tick_ns: int,
    out: Path | None,
) -> dict[str, Any]:
    """The object that ``haptics run --json`` prints."""
    events = Counter(event.kind for event in session.events)
    faults = [*session.glove.faults, *(f"watchdog: {e.detail}" for e in session.events if e.kind == "watchdog")]
    denied = Counter(result.reason for result in session.results if not result.played)
    return {
        "scene": session.scene.name,
        "hand": {
            "source": recording.source,
            "frames": recording.frame_count,
            "duration_s": recording.duration_s,
            "side": side,
            "poses": len(frames),
            "refused": events["pose_refused"],
        },
        "contacts": events["touch"],
        "grasps": events["grasp_begin"],
        "pulses": {
            "requested": len(session.results),
            "played": sum(result.played for result in session.results),
            "denied": {str(reason): count for reason, count in sorted(denied.items(), key=lambda item: str(item[0]))},
        },
        "onset_error_ms": _onset(session, frames, latency_ns, start_ns, tick_ns),
        "actuators": _actuators(session),
        "brakes": _brakes(session),
        "ticks": {"count": ticks, "missed": ticks_missed},
        "plan": [asdict(row) for row in plan.rows],
        "absent": [asdict(absence) for absence in plan.absent],
        "derated": Counter(event.detail for event in session.events if event.kind == "derated"),
        "faults": faults,
        "notes": _notes(session.scene, recording, side, session),
        "recording": None if out is None else str(out),
    }


def _onset(session: Session, frames: Sequence[HandFrame], latency_ns: int, start_ns: int, tick_ns: int) -> dict[str, Any]:
    """Onset error of touches in contact mode and of grasps, all times from the start of the hand's motion."""
    scene, sites = session.scene, nominal_sites()
    objects = _contact_objects(scene)
    truths = track_truths(scene, sites, frames, tuple(objects))
    touched: list[Touched] = []
    for truth in truths:
        for name, allowed in objects.items():
            touched += touches_on(truth.time_ns, truth.sites_m, truth.distance_m[name], allowed, name)
    measured = Onsets()
    pin_lead_ns = round(session.leads.pin_s * NS_PER_S)
    held = held_actions(scene, sites, frames, objects, latency_ns, tick_ns, pin_lead_ns)
    for site in range(len(SITES)):
        on_site = [touch for touch in touched if touch.site == site]
        measured.add(on_site, _pin_arrivals(session, site, start_ns))
        measured.hold.add(on_site, held.get(site, []))
    if session.glove.brakes is not None and session.scene.needs.brakes:
        _add_grasps(measured, session, truths, latency_ns, start_ns, tick_ns)
    return {**onset_statistics(measured), "estimated": session.glove.plant("tactiles") is None and session.glove.tactiles is not None}
