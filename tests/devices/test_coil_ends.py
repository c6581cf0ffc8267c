"""Strokes behind each other play on boards whose clocks are slow or fast; truth is the board's own count of pulses."""

from __future__ import annotations

import pytest

from haptics.devices.coil_ends import CoilEnds
from haptics.session.glove import open as open_glove


def _played(glove) -> list[int]:
    """The board's own counts, as of now."""
    glove.advance(0.05)  # telemetry comes each 20 ms
    return glove.devices.telemetry["tactiles"].played


@pytest.mark.parametrize("ppm", [-1000, -50, 0, 50, 1000])
def test_a_slow_or_fast_clock_costs_no_pulse(ppm):
    with open_glove(tactiles=f"sim://tactiles?spread=0&ppm={ppm}", clock="virtual") as glove:
        glove.arm()
        before = _played(glove)
        for site in ("index_tip", "thumb_tip"):
            glove.pulse(site, count=20, rate_hz=50)
        glove.contact("ring_tip")
        glove.advance(0.6)
        results = glove.results()
        assert len(results) == 41
        assert {(one.played, one.reason) for one in results} == {(True, None)}
        played = [now - then for now, then in zip(_played(glove), before, strict=True)]
        assert sorted(played, reverse=True)[:4] == [40, 40, 1, 0]  # two strokes a pulse


def test_a_start_inside_the_stroke_ahead_by_less_than_100_us_moves_behind_it():
    ends = CoilEnds()
    assert ends.start(1000, {3: 60}) == 1000  # 60 units of 50 us: 6000 ticks
    assert ends.start(6980, {3: 60, 4: 60}) == 7000
    assert ends.start(12_999, {4: 60}) == 13_000
    assert ends.start(12_000, {5: 60}) == 12_000


def test_a_start_far_inside_is_left_for_the_board_to_refuse_and_one_behind_is_left_alone():
    ends = CoilEnds()
    ends.start(1000, {0: 60})
    assert ends.start(5000, {0: 60}) == 5000
    assert ends.start(11_000, {0: 60}) == 11_000
    assert ends.start(90_000, {0: 60}) == 90_000


def test_ends_go_on_across_the_wrap_of_the_tick_counter():
    ends = CoilEnds()
    assert ends.start(2**32 - 5990, {0: 60}) == 2**32 - 5990
    assert ends.start(4, {0: 60}) == 10
