"""Which pins are out: counted per site and object, with hysteresis where plain distances decide."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from haptics.errors import InputError
from haptics.scene.contact import ContactTracker, PinChange, TouchBand
from haptics.scene.effects import ContactEffect, FixedSetEffect, PatternEffect
from haptics.scene.sites import SITE

EFFECTS = {
    "ball": (ContactEffect(),),
    "wall": (ContactEffect(sites=("index_tip",)),),
    "cup": (FixedSetEffect(sites=("thumb_tip", "index_tip")),),
    "table": (PatternEffect("particle"),),
}
THUMB, INDEX, MIDDLE = SITE["thumb_tip"], SITE["index_tip"], SITE["middle_tip"]


def test_a_pin_comes_out_with_the_first_object_and_goes_back_with_the_last():
    tracker = ContactTracker(EFFECTS)
    assert tracker.touch(INDEX, "ball", 1)[1] == [PinChange(1, INDEX, True)]
    assert tracker.touch(INDEX, "wall", 2)[1] == []
    assert tracker.leave(INDEX, "ball", 3)[1] == []
    assert tracker.leave(INDEX, "wall", 4)[1] == [PinChange(4, INDEX, False)]


def test_a_fixed_set_is_out_while_any_site_touches():
    tracker = ContactTracker(EFFECTS)
    assert {change.site for change in tracker.touch(MIDDLE, "cup", 1)[1]} == {THUMB, INDEX}
    assert tracker.touch(SITE["palm_index"], "cup", 2)[1] == []
    assert tracker.leave(MIDDLE, "cup", 3)[1] == []
    assert [change.out for change in tracker.leave(SITE["palm_index"], "cup", 4)[1]] == [False, False]


def test_a_fixed_set_and_a_contact_share_a_pin():
    tracker = ContactTracker(EFFECTS)
    tracker.touch(MIDDLE, "cup", 1)
    assert tracker.touch(INDEX, "ball", 2)[1] == []
    assert tracker.leave(MIDDLE, "cup", 3)[1] == [PinChange(3, THUMB, False)]
    assert tracker.pins_out == (INDEX,)


def test_a_site_outside_the_effects_sites_touches_without_a_pin():
    tracker = ContactTracker(EFFECTS)
    touches, pins = tracker.touch(THUMB, "wall", 1)
    assert pins == []
    assert touches[0].kind == "touch"
    assert tracker.touched == {"wall"}


def test_a_pattern_moves_no_pin_but_says_when_the_first_comes_and_the_last_goes():
    tracker = ContactTracker(EFFECTS)
    first, pins = tracker.touch(INDEX, "table", 1)
    assert (first[0].first_or_last, pins) == (True, [])
    assert not tracker.touch(THUMB, "table", 2)[0][0].first_or_last
    assert not tracker.leave(INDEX, "table", 3)[0][0].first_or_last
    assert tracker.leave(THUMB, "table", 4)[0][0].first_or_last


def test_what_is_said_twice_changes_nothing():
    tracker = ContactTracker(EFFECTS)
    assert tracker.leave(INDEX, "ball", 0) == ([], [])
    tracker.touch(INDEX, "ball", 1)
    assert tracker.touch(INDEX, "ball", 2) == ([], [])
    with pytest.raises(InputError, match="ball, wall, cup, table"):
        tracker.touch(INDEX, "moon", 3)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(st.tuples(st.booleans(), st.integers(0, 14), st.sampled_from(list(EFFECTS))), max_size=60))
def test_pins_are_out_exactly_where_something_holds_them_and_letting_go_withdraws_all(steps):
    tracker, out, touching = ContactTracker(EFFECTS), set(), set()
    for time, (begin, site, name) in enumerate(steps):
        (touching.add if begin else touching.discard)((site, name))
        for change in (tracker.touch if begin else tracker.leave)(site, name, time)[1]:
            assert change.out != (change.site in out)  # a pin never goes where it is
            (out.add if change.out else out.discard)(change.site)
        wanted = {s for s, n in touching if n == "ball"} | {s for s, n in touching if n == "wall" and s == INDEX}
        if any(n == "cup" for _, n in touching):
            wanted |= {THUMB, INDEX}
        assert out == wanted == set(tracker.pins_out)
    tracker.release_all(len(steps))
    assert tracker.pins_out == ()
    assert tracker.touched == frozenset()


def test_hovering_inside_the_band_makes_one_touch():
    band = TouchBand(["ball"], leave_m=0.002)
    distance, changes = np.full((1, 15), 0.05), []
    for depth_m in (0.001, -0.0001, 0.0005, 0.0019, -0.0003, 0.0005, np.nan, 0.0021, 0.001):
        distance[0, INDEX] = depth_m
        changes += band.update(distance)
    assert changes == [(True, INDEX, "ball"), (False, INDEX, "ball")]


def test_distances_of_another_shape_are_refused():
    with pytest.raises(InputError, match="objects by sites"):
        TouchBand(["ball"]).update(np.zeros((2, 15)))
