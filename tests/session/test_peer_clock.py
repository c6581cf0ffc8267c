"""Times of an engine on the glove's clock: within the bound that is told, bent and never torn, unless the engine's clock was."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings, strategies as st
from peer import Peer

import haptics
from haptics.errors import InputError
from haptics.session.peer_clock import SLEW, PeerClock
from haptics.time import NS_PER_MS, NS_PER_S


@settings(max_examples=40, deadline=None)
@given(st.floats(-1e9, 1e9), st.floats(-500, 500), st.integers(0, 1000))
def test_times_are_within_the_bound_that_is_told_and_the_bound_is_that_of_the_line(offset_s, ppm, seed):
    peer = Peer(offset_s, ppm, seed)
    for now_ns in range(0, 20 * NS_PER_S, NS_PER_S // 2):
        peer.ask(now_ns)
        for then_ns in range(now_ns + 20 * NS_PER_MS, now_ns + NS_PER_S // 2, 100 * NS_PER_MS):
            there_ns = peer.at(then_ns)
            mapped_ns, bound_s = peer.clock.to_host_ns(there_ns), peer.clock.bound_s(there_ns)
            assert abs(mapped_ns - then_ns) <= bound_s * NS_PER_S + 2
            assert bound_s < 0.006
    assert peer.clock.jumps == 0


def test_better_fits_bend_time_at_a_limited_rate_and_never_turn_it_back():
    peer = Peer(-10.0, 200.0, line_ms=(0.1, 30.0))
    peer.ask(0)
    last_peer_ns = last_host_ns = None
    for number, now_ns in enumerate(range(100 * NS_PER_MS, 10 * NS_PER_S, 9 * NS_PER_MS)):
        if number % 10 == 0:
            peer.ask(now_ns - 95 * NS_PER_MS)
        peer_ns = peer.at(now_ns)
        host_ns = peer.clock.to_host_ns(peer_ns)
        if last_peer_ns is not None:
            ran = (host_ns - last_host_ns) / (peer_ns - last_peer_ns)
            assert abs(ran - 1) <= SLEW + 1e-6
        last_peer_ns, last_host_ns = peer_ns, host_ns
    assert abs(host_ns - now_ns) <= peer.clock.bound_s(peer_ns) * NS_PER_S


@pytest.mark.parametrize("by_s", [10.0, -10.0, 0.2, 5000.0, -1e7])
def test_a_clock_that_jumps_is_found_out_by_the_next_exchange_and_followed(by_s):
    peer = Peer(3.0, 50.0)
    for now_ns in range(0, 3 * NS_PER_S, NS_PER_S // 2):
        assert peer.ask(now_ns)
    peer.offset_ns += round(by_s * NS_PER_S)
    assert not peer.ask(3 * NS_PER_S)
    assert peer.clock.jumps == 1
    assert peer.ask(3 * NS_PER_S + NS_PER_S // 2)
    then_ns = 4 * NS_PER_S
    assert abs(peer.clock.to_host_ns(peer.at(then_ns)) - then_ns) < 5 * NS_PER_MS


def test_an_exchange_that_contradicts_itself_teaches_nothing():
    peer = Peer(1.0, 0.0)
    assert peer.ask(0)
    before = peer.clock.to_host_ns(peer.at(NS_PER_S))
    assert not peer.clock.exchange(NS_PER_S, peer.at(NS_PER_S), peer.at(NS_PER_S) - 5000, NS_PER_S + NS_PER_MS)
    assert not peer.clock.exchange(NS_PER_S, peer.at(NS_PER_S), peer.at(NS_PER_S) + 2 * NS_PER_MS, NS_PER_S + NS_PER_MS)
    assert (peer.clock.to_host_ns(peer.at(NS_PER_S)), peer.clock.jumps) == (before, 0)


def test_older_times_are_mapped_as_the_newest_was_and_change_nothing():
    peer = Peer(5.0, 0.0, line_ms=(1.0, 1.0))
    peer.ask(0)
    newest = peer.clock.to_host_ns(peer.at(NS_PER_S))
    older = peer.clock.to_host_ns(peer.at(NS_PER_S - 30 * NS_PER_MS))
    assert newest - older == 30 * NS_PER_MS
    assert peer.clock.to_host_ns(peer.at(NS_PER_S)) == newest


def test_without_an_exchange_nothing_is_known_and_that_is_said():
    clock = PeerClock()
    assert not clock.known
    for ask in (clock.to_host_ns, clock.bound_s):
        with pytest.raises(InputError, match="no exchange"):
            ask(0)
    with pytest.raises(InputError, match=r"sent_ns = 1\.0 is not a whole number"):
        clock.exchange(1.0, 2, 3, 4)
    with pytest.raises(InputError, match="slew = 1"):
        PeerClock(1.0)


@pytest.mark.parametrize(("offset_s", "ppm"), [(10.0, 200.0), (-10.0, -200.0), (1.7e9, 0.0)])
def test_a_hand_on_an_engines_clock_is_felt_as_on_ours(offset_s, ppm):
    """The shipped hand, once with our times and once with the engine's: the same touches within the bound, and a grasp."""
    events = {}
    for mine in (True, False):
        peer = Peer(offset_s, ppm, line_ms=(0.2, 1.5))
        recording = haptics.load_hand("synthetic")
        with haptics.open(clock="virtual") as glove:
            glove.arm()
            scene = haptics.load_scene("playground").placed_for(recording)
            session = haptics.Session(scene, glove, peer=None if mine else peer.clock)
            start_ns = glove.now_ns() + NS_PER_MS
            session.begin(start_ns)
            frames = list(recording.frames("right"))[:220]
            if not mine:
                assert "no exchange" in session.submit(frames[0], start_ns)
                assert session.events.pop().kind == "pose_refused"
            peer.ask(start_ns)
            for frame in frames:
                sampled_ns = start_ns + frame.time_ns
                while glove.now_ns() < sampled_ns + 10 * NS_PER_MS:
                    if glove.now_ns() // NS_PER_MS % 250 == 0:
                        peer.ask(glove.now_ns())
                    session.tick(glove.now_ns() + NS_PER_MS)
                there_ns = sampled_ns if mine else peer.at(sampled_ns)
                assert session.submit(replace(frame, time_ns=there_ns)) is None
            session.end()
            events[mine] = [(e.kind, e.subject, e.object, e.time_ns - start_ns) for e in session.events]
    assert [event[:3] for event in events[True]] == [event[:3] for event in events[False]]
    late_ms = [abs(a[3] - b[3]) / NS_PER_MS for a, b in zip(events[True], events[False], strict=True)]
    assert max(late_ms) <= 2  # the bound, and a tick
    assert "grasp_begin" in [event[0] for event in events[True]]


def test_a_jump_of_the_engines_clock_lets_go_and_is_told_and_the_hand_is_felt_again():
    peer = Peer(2.0, 0.0, line_ms=(0.5, 0.5))
    recording = haptics.load_hand("synthetic")
    with haptics.open(clock="virtual") as glove:
        glove.arm()
        scene = haptics.load_scene("playground").placed_for(recording)
        session = haptics.Session(scene, glove, peer=peer.clock)
        start_ns = glove.now_ns() + NS_PER_MS
        session.begin(start_ns)
        peer.ask(start_ns)
        for number, frame in enumerate(list(recording.frames("right"))[:220]):
            sampled_ns = start_ns + frame.time_ns
            while glove.now_ns() < sampled_ns + 10 * NS_PER_MS:
                session.tick(glove.now_ns() + NS_PER_MS)
            if number == 100:
                peer.offset_ns -= 7 * NS_PER_S
                assert not peer.ask(glove.now_ns())
            assert session.submit(replace(frame, time_ns=peer.at(sampled_ns))) is None
        kinds = [event.kind for event in session.events]
        assert kinds.count("clock_jump") == 1
        assert "grasp_begin" in kinds[kinds.index("clock_jump") :]


def test_stamps_in_the_wrong_order_are_refused_or_dropped_and_teach_nothing():
    peer = haptics.PeerClock()
    with pytest.raises(haptics.InputError, match="arrived_ns = 50 lies before sent_ns = 100; both are on the glove's clock"):
        peer.exchange(100, 5, 5, 50)
    assert not peer.exchange(100, 5, 4, 150)  # answered before it was asked
    assert not peer.exchange(0, 5, 10 * NS_PER_MS, 5 * NS_PER_MS)  # took longer to answer than the round trip lasted
    assert not peer.known
    assert peer.jumps == 0
    assert peer.exchange(100, 5, 55, 150)
