"""Touches of a live hand come when those of an offline run come, whatever clock, rate and line its poses have; then silence.

Each run is of the shipped motion, resampled, and compared with a run of the same arrivals whose times are the glove's own.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from live_hand import Arrival, Line, Motion, shifted
from peer import Peer

import haptics
from haptics.judging.felt import track_truths
from haptics.judging.onset import Onsets, touches_on
from haptics.judging.truth import Truth
from haptics.scene.effects import ContactEffect
from haptics.session.session import Session
from haptics.time import NS_PER_MS, NS_PER_S

ASKED_EACH_NS = 250 * NS_PER_MS
SILENCE_NS = 150 * NS_PER_MS
SAFE_V = 60.0
CLOCKS = {"ahead": (10.0, 200.0), "behind": (-10.0, -200.0), "jumping": (3.0, 50.0)}
RATES_HZ = (30, 60, 110, 240, 1000)
STAMPED = ("sampling", "sending")
SEEDS = (1, 2, 3)
JITTER_MS = 3.0
"""Above 240 Hz poses overtake each other."""


@cache
def motion(hand: str) -> Motion:
    """The longest track of a right hand, shipped or from a file."""
    return Motion(tuple(max(haptics.load_hand(hand).of_side("right"), key=len).frames()))


@cache
def scene(hand: str) -> haptics.Scene:
    return haptics.load_scene("playground").placed_for(haptics.load_hand(hand), "right")


def arrivals_of(rate_hz: float, stamped: str, seed: int, hand: str = "synthetic") -> list[Arrival]:
    return motion(hand).arrivals(Line(rate_hz, JITTER_MS, stamped=stamped), seed)


def left_of(frame: haptics.HandFrame) -> haptics.HandFrame:
    """The other hand: a mirror image beside it, far from every object."""
    position_m = frame.position_m * (-1.0, 1.0, 1.0) - (0.8, -0.5, 0.0)
    return replace(frame, side="left", position_m=position_m, orientation_xyzw=frame.orientation_xyzw * (1.0, -1.0, -1.0, 1.0))


@dataclass
class Played:
    """What came of it, times from the start of the motion."""

    hand: str
    session: Session
    start_ns: int
    silent_ns: int
    """How long after the last pose anything was still on."""

    def onsets_ms(self) -> list[float]:
        """Signed errors of the touches that pins show, on the true path."""
        sites = self.session.loop.sites
        seen, placed = motion(self.hand), scene(self.hand)
        frames = [seen.at(ns) for ns in range(seen.first_ns, seen.last_ns, 8 * NS_PER_MS)]
        names = [item.name for item in placed.objects if any(isinstance(one, ContactEffect) for one in item.effects)]
        measured = Onsets()
        for truth in track_truths(placed, sites, frames, names):
            for site in range(len(haptics.SITES)):
                touched = [t for name in names for t in touches_on(truth.time_ns, truth.distance_m[name], (site,), name)]
                acted = [
                    ns - self.start_ns
                    for ns, channel, kind in self.session.truth.pins
                    if (channel, kind) == (site, "reached_skin")
                ]
                measured.add(touched, acted)
        return measured.error_ms


def play(
    arrivals: Sequence[Arrival],
    peer: Peer | None,
    *,
    hand: str = "synthetic",
    both: bool = False,
    jump_s: float = 0.0,
    until_ns: int | None = None,
) -> Played:
    """Hand in poses as they arrive, then none for 0.4 s."""
    with haptics.open(tactiles="sim://tactiles?spread=0&level=event", brake="sim://brake?spread=0", clock="virtual") as glove:
        glove.arm()
        configuration = glove.configuration.model_copy(update={"side": "right"})
        heard = Truth.keeping(None)
        session = haptics.Session(scene(hand), glove, configuration, peer=None if peer is None else peer.clock, gathered=heard)
        start_ns = glove.now_ns() + 20 * NS_PER_MS
        if peer is not None:
            peer.ask(glove.now_ns())
        session.begin(start_ns)
        asked_ns = glove.now_ns()
        came = [one for one in shifted(arrivals, start_ns) if until_ns is None or one.arrives_ns - start_ns < until_ns]
        jump_ns = start_ns + 2 * NS_PER_S
        for arrives_ns, frame in came:
            while glove.now_ns() < arrives_ns:
                session.tick(glove.now_ns() + NS_PER_MS)
                if peer is not None and glove.now_ns() >= asked_ns + ASKED_EACH_NS:
                    asked_ns = glove.now_ns()
                    peer.ask(asked_ns)
            if peer is not None and jump_s and glove.now_ns() >= jump_ns:
                peer.offset_ns += round(jump_s * NS_PER_S)
                jump_s = 0.0
            theirs = frame if peer is None else replace(frame, time_ns=peer.at(frame.time_ns))
            session.submit(theirs)
            if both:
                session.submit(left_of(theirs))
        last_ns = on_ns = glove.now_ns()
        while glove.now_ns() < last_ns + 400 * NS_PER_MS:
            session.tick(glove.now_ns() + NS_PER_MS)
            array, brake = (glove.devices.plant(name).truth() for name in ("tactiles", "brake"))
            if any(array["coils_on"]) or max(map(abs, brake["volts"])) > SAFE_V or "on" in array["latched"]:
                on_ns = glove.now_ns()
        session.end()
        return Played(hand, session, start_ns, on_ns - last_ns)


@cache
def offline(rate_hz: float, stamped: str, seed: int, hand: str) -> list[float]:
    return play(arrivals_of(rate_hz, stamped, seed, hand), None, hand=hand).onsets_ms()


def beside_offline(rate_hz: float, stamped: str, clock: str, seed: int, hand: str = "synthetic") -> np.ndarray:
    """Onset errors with the clock of a peer and of the offline run, ms, in rows, of touches that came in both."""
    offset_s, ppm = CLOCKS[clock]
    peer, arrivals = Peer(offset_s, ppm, seed, line_ms=(0.2, 1.5)), arrivals_of(rate_hz, stamped, seed, hand)
    played = play(arrivals, peer, hand=hand, both=True, jump_s=-7.0 if clock == "jumping" else 0.0)
    errors = np.array([played.onsets_ms(), offline(rate_hz, stamped, seed, hand)])
    came = np.isfinite(errors)
    assert errors.shape[1] > 3
    assert came[0].mean() >= came[1].mean() - (0.3 if clock == "jumping" else 0.0)
    assert played.silent_ns <= SILENCE_NS
    refused = [event for event in played.session.events if event.kind == "pose_refused" and event.detail.startswith("clock")]
    assert clock == "jumping" or not refused
    return errors[:, came.all(axis=0)]


def comes_as_offline(errors_ms: np.ndarray) -> None:
    """Touch by touch, and in the median of them all."""
    with_peer, without = errors_ms
    assert np.median(np.abs(with_peer - without)) <= 1.0
    assert abs(np.median(with_peer) - np.median(without)) <= 1.0


QUICK = [(60, "sending", "ahead", 1), (110, "sampling", "jumping", 2), (240, "sending", "behind", 3)]


@pytest.mark.parametrize(("rate_hz", "stamped", "clock", "seed"), QUICK)
def test_touches_on_an_engines_clock_come_as_on_ours(rate_hz, stamped, clock, seed):
    comes_as_offline(beside_offline(rate_hz, stamped, clock, seed))


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("stamped", STAMPED)
@pytest.mark.parametrize("clock", CLOCKS)
def test_touches_on_an_engines_clock_come_as_on_ours_at_every_rate(rate_hz, stamped, clock, recordings):
    """Of three seeds and three hands together: of the four touches of the shipped hand, one a pose later moves the median."""
    hands = ("synthetic", *(str(recordings / f"{name}.leap.json.gz") for name in ("grab", "confidence-demo")))
    runs = [beside_offline(rate_hz, stamped, clock, seed, hand) for hand, seed in itertools.product(hands, SEEDS)]
    comes_as_offline(np.concatenate(runs, axis=1))


@pytest.mark.parametrize("ahead_s", [-2.0, 0.0, 0.055, 2.0])
def test_nothing_is_on_150_ms_after_poses_stop_in_a_grasp_whatever_their_times(ahead_s):
    """The last tenth of a second of poses is stamped so far ahead (on the way 6 to 12 ms are lost again, and 50 are allowed)."""
    until_ns = round(1.5 * NS_PER_S)
    poses = [
        one._replace(frame=replace(one.frame, time_ns=one.frame.time_ns + round(ahead_s * NS_PER_S)))
        if one.arrives_ns > until_ns - 100 * NS_PER_MS
        else one
        for one in arrivals_of(110, "sampling", 1)
    ]
    played = play(poses, None, until_ns=until_ns)
    events = played.session.events
    assert any(event.kind == "grasp_begin" for event in events)
    assert 0 < played.silent_ns <= SILENCE_NS
    assert any(event.kind == "watchdog" for event in events)
    clock = [event for event in events if event.kind == "pose_refused" and event.detail.startswith("clock: ")]
    assert bool(clock) == (abs(ahead_s) > 0.25)


def test_a_client_whose_clock_is_far_ahead_is_told_at_each_pose_and_nothing_is_felt():
    poses = [
        one._replace(frame=replace(one.frame, time_ns=one.frame.time_ns + 2_700_000_000))
        for one in arrivals_of(60, "sampling", 1)
    ]
    played = play(poses, None, until_ns=NS_PER_S)
    refused = [event for event in played.session.events if event.kind == "pose_refused"]
    assert len(refused) > 50
    assert all(re.match(r"clock: its time lies 2\.(6|7)\d* s ahead", event.detail) for event in refused)
    assert not played.session.truth.pins
