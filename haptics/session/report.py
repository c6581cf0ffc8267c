"""What a person wants to know after a run: what was felt, when, at what cost; against the plant's truth where there is one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.fidelity import Plan
from haptics.judging.felt import track_truths
from haptics.judging.onset import AFTER_START_NS, BEFORE_END_NS, Onsets, Touched, held_acts, onset_statistics, touches_on
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.effects import ContactEffect
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.motion import Motion
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.placement import closing_strokes
from haptics.scene.scene import Scene
from haptics.scene.sites import SITE, SITES
from haptics.session.felt_share import LARGEST_FAILED_SHARE, FeltShare, coarse_note, fault_of, felt_share
from haptics.session.heard import Heard
from haptics.session.session import Session
from haptics.time import NS_PER_MS, NS_PER_S

BRAKE_COMMANDS = ("drive", "piezo")
AFTER_NS = 100 * NS_PER_MS
"""What a device does this long after a track's end still belongs to it."""
TOGETHER_NS = 50 * NS_PER_MS
"""Brakes that close within this of each other close for the same grasp."""


def build_report(
    *,
    session: Session,
    heard: Heard,
    plan: Plan,
    motion: Motion,
    latency_ns: int,
    start_ns: int,
    ticks: int,
    ticks_missed: int | None,
    tick_ns: int,
    out: Path | None,
) -> dict[str, Any]:
    """The object that ``haptics run --json`` prints.

    :param session: ended.
    :param heard: all that it told.
    :param plan: which models the devices had.
    :param motion: what was played, and what of it was refused.
    :param latency_ns: from sampling a pose to its arrival, ns.
    :param start_ns: when the hand's motion began, ns on the glove's clock.
    :param ticks: how many there were.
    :param ticks_missed: how many came over a period late; None in virtual time.
    :param tick_ns: their period, ns.
    :param out: the recording, or None.
    :return: plain data.
    """
    recording, frames, side = motion.recording, motion.frames, motion.side
    events = Counter(event.kind for event in heard.events)
    faults = [*session.devices.faults, *(f"watchdog: {e.detail}" for e in heard.events if e.kind == "watchdog")]
    denied = Counter(str(result.reason) for result in heard.results if not result.played)
    played = sum(result.played for result in heard.results)
    felt = _felt(session, heard, played, denied)
    faults += [fault for one in felt if (fault := fault_of(one, session.devices.links.get(one.board))) is not None]
    return {
        "scene": session.scene.name,
        "hand": {
            "source": recording.source,
            "frames": recording.frame_count,
            "duration_s": recording.duration_s,
            "side": side,
            **({} if session.calibration is None else {"calibration": session.calibration.name}),
            "poses": len(frames) + len(motion.refused),
            "refused": len(motion.refused) + events["pose_refused"],
        },
        "contacts": events["touch"],
        "grasps": events["grasp_begin"],
        "pulses": {
            "requested": len(heard.results),
            "played": played,
            "denied": dict(sorted(denied.items())),
        },
        "failed_share": {one.board: one.share for one in felt},
        "largest_failed_share": LARGEST_FAILED_SHARE,
        "shift_ms": {name: link.shift_ns / NS_PER_MS for name, link in session.devices.links.items()},
        "onset_error_ms": _onset(session, heard, frames, latency_ns, start_ns, tick_ns),
        "actuators": _actuators(session, heard, plan),
        "brakes": _brakes(session),
        "ticks": {"count": ticks, "missed": ticks_missed},
        "plan": [asdict(row) for row in plan.rows],
        "absent": [asdict(absence) for absence in plan.absent],
        "derated": Counter(event.detail for event in heard.events if event.kind == "derated"),
        "faults": faults,
        "notes": [*motion.notes, *_notes(session.scene, recording, side, session, heard)],
        "recording": None if out is None else str(out),
    }


def _felt(session: Session, heard: Heard, played: int, denied: Mapping[str, int]) -> list[FeltShare]:
    """Of each board: what was asked of it, and what of that failed."""
    shares = [] if session.devices.tactiles is None else [felt_share("tactiles", played, denied)]
    if session.devices.brakes is not None:
        refused = Counter(event.detail for event in heard.events if event.kind == "derated" and event.subject in BRAKE_COMMANDS)
        sent = max(session.devices.brakes.commands, refused.total())
        shares.append(felt_share("brake", sent - refused.total(), refused))
    return shares


def _onset(
    session: Session, heard: Heard, frames: Sequence[HandFrame], latency_ns: int, start_ns: int, tick_ns: int
) -> dict[str, Any]:
    """Onset error of touches in contact mode and of grasps; all times from the start of the hand's motion."""
    scene, sites = session.scene, session.loop.sites
    objects = _contact_objects(scene)
    measured = Onsets()
    truths = track_truths(scene, sites, frames, tuple(objects))
    pins = _pin_arrivals(session, heard, start_ns)
    pin_lead_ns = round(session.leads.pin_s * NS_PER_S)
    for truth in truths:
        first_ns, last_ns = int(truth.time_ns[0]), int(truth.time_ns[-1])
        judged_ns = (first_ns + AFTER_START_NS, last_ns - BEFORE_END_NS)
        for site in range(len(SITES)):
            on_site, held = [], []
            for name, allowed in objects.items():
                if site not in allowed:
                    continue
                distance = truth.distance_m[name]
                on_site += touches_on(truth.time_ns, distance, (site,), name)
                at_frames = np.interp(truth.frame_ns, truth.time_ns, distance[:, site])[:, None]
                held += held_acts(truth.frame_ns, at_frames, latency_ns, tick_ns, pin_lead_ns)[0]
            acted = [ns for ns in pins.get(site, ()) if first_ns <= ns <= last_ns + AFTER_NS]
            measured.add(on_site, acted, judged_ns)
            measured.hold.add(on_site, held, judged_ns)
        if session.devices.brakes is not None and scene.needs.brakes:
            begins = [Touched(ns, -1, name, counted=judged_ns[0] <= ns <= judged_ns[1]) for ns, name in truth.grasp_ns]
            brake_ns = [ns for ns in _brake_holds(session, start_ns) if first_ns <= ns <= last_ns + AFTER_NS]
            measured.add(begins, brake_ns, judged_ns)
            shown = np.searchsorted(truth.frame_ns, [ns for ns, _ in truth.grasp_ns]).clip(max=len(truth.frame_ns) - 1)
            seen = truth.frame_ns[shown].tolist()
            lead_ns = round(session.leads.brake_s * NS_PER_S)
            measured.hold.add(begins, [-(-(ns + latency_ns) // tick_ns) * tick_ns + lead_ns for ns in seen], judged_ns)
    on_hardware = session.devices.tactiles is not None and session.devices.plant("tactiles") is None
    return {**onset_statistics(measured), "estimated": on_hardware}


def _contact_objects(scene: Scene) -> dict[str, frozenset[int]]:
    """Objects rendered site by site, with the sites that are: those whose onset a pin shows."""
    found = {}
    for item in scene.objects:
        effects = [effect for effect in item.effects if isinstance(effect, ContactEffect)]
        if effects:
            found[item.name] = frozenset(SITE[site] for effect in effects for site in effect.sites or SITES)
    return found


def _pin_arrivals(session: Session, heard: Heard, start_ns: int) -> dict[int, list[int]]:
    """When pins reached the skin, by site: the plant's truth, or on hardware the sent start and the model's flight."""
    names, found = session.site_names, {}
    if session.devices.plant("tactiles") is not None:
        arrivals = [(channel, ns) for ns, channel, kind in session.truth.pins if kind == "reached_skin"]
    else:
        flight_ns = round((session.leads.pin_s - COMMAND_LEAD_NS / NS_PER_S) * NS_PER_S)
        played = [r for r in heard.results if r.kind == "contact" and r.played]
        arrivals = [(names.index(r.site), r.start_ns + flight_ns) for r in played if r.start_ns is not None]
    for channel, ns in arrivals:
        found.setdefault(SITE[names[channel]], []).append(ns - start_ns)
    return found


def _brake_holds(session: Session, start_ns: int) -> list[int]:
    """When the brakes held half of their steady capacity: the last of those that closed together."""
    assert session.devices.brakes is not None
    channels = {session.devices.brakes.channels.index(name) for name in session.scene.needs.brakes}
    half = [(ns, channel) for ns, channel, kind in session.truth.brakes if kind == "half_capacity"]
    times = sorted(ns - start_ns for ns, channel in half if channel in channels)
    return [ns for ns, following in zip(times, [*times[1:], float("inf")], strict=False) if following - ns > TOGETHER_NS]


def _actuators(session: Session, heard: Heard, plan: Plan) -> list[dict[str, Any]]:
    """Each tactor's warmest, by the plant's truth, or on hardware by the account's upper bound, and the room left then."""
    array = session.devices.tactiles
    if array is None:
        return []
    played = Counter(result.site for result in heard.results if result.played)
    simulated = session.devices.plant("tactiles") is not None
    rows = []
    for channel, (site, budget) in enumerate(zip(array.sites, array.budgets, strict=True)):
        if site not in plan.sites:
            continue
        peak_k = float(session.truth.peak_rise_k[channel])
        switches = int(session.truth.switches[channel]) if simulated else played[site]
        rows.append({"site": site, "switches": switches, "peak_rise_k": peak_k, "headroom_k": budget.limit_k - peak_k})
    return rows


def _brakes(session: Session) -> list[dict[str, Any]]:
    brakes, truth = session.devices.brakes, session.truth
    if brakes is None:
        return []
    return [
        {
            "name": name,
            "peak_volts": float(truth.peak_volts[i]),
            "peak_force_n": float(truth.peak_force_n[i]),
            "energy_j": float(truth.energy_j[i]),
        }
        for i, name in enumerate(brakes.channels)
    ]


def _notes(scene: Scene, recording: HandRecording, side: str, session: Session, heard: Heard) -> list[str]:
    notes = [*scene.notes, *(f"{name} is not there: {why}" for name, why in scene.absent)]
    tracks = recording.of_side(side)
    if scene.needs.brakes and not any(closing_strokes(track) for track in tracks):
        notes.append(f"no grasp to expect: the {side} hand makes no closing stroke of thumb and index")
    if recording.dropped:
        notes.append("left out while reading: " + ", ".join(f"{count} {what}" for what, count in recording.dropped.items()))
    notes += session.devices.notes
    if session.calibration is not None:
        notes += _of_calibration(session.calibration, tracks)
    notes += [note for name, link in session.devices.links.items() if (note := coarse_note(name, link)) is not None]
    withdrawn = sum(event.kind == "grasp_withdrawn" for event in heard.events)
    if withdrawn:
        notes.append(f"brakes closed ahead of {withdrawn} grasps that did not come, and opened again")
    return notes


def _of_calibration(calibration: HandCalibration, tracks: Sequence[HandTrack]) -> list[str]:
    other = calibration.other_hand(np.concatenate([track.position_m for track in tracks])) if tracks else None
    said = [f"calibration {calibration.name!r}: {note}" for note in calibration.notes]
    return said if other is None else [*said, other]
