"""The hardware of the coil board as its CPU sees it: one word out, two senses in, and the plant that the Python board has too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from firmware_models.boards.boot import BOARD_OPTIONS
from firmware_models.cores.coil_pins import FEED, CoilPins
from firmware_models.plants.tactiles_plant import COIL_SHORT_OHM, PLANT_OPTIONS, Actuators
from haptics.errors import InputError

MS = 1_000_000
SUPPLY, CURRENT = 0, 1


def options(**given: Any) -> dict[str, Any]:
    return {key: option.default for key, option in {**BOARD_OPTIONS, **PLANT_OPTIONS}.items()} | given


def pins(seed: int = 1, **given: Any) -> CoilPins:
    return CoilPins(options(**given), np.random.default_rng(seed), 0)


def word(on: int, toward_skin: int = 0, feed: bool = True) -> int:
    return on | toward_skin << 16 | (FEED if feed else 0)


def test_words_do_to_the_plant_what_the_python_boards_switching_does() -> None:
    """Same seed, same nanoseconds: to the last bit."""
    by_word = pins(seed=7)
    by_call = Actuators(options(), np.random.default_rng(7), 0, fed=False)
    by_word.outputs(word(0), 1 * MS)
    by_call.feed(True, 1 * MS)
    for at_ns, on, toward, signs in [
        (5 * MS + 17, 0b101, 0b001, {0: 1, 2: -1}),
        (9 * MS, 0b110, 0b010, {0: 0, 1: 1}),
        (12 * MS, 0b110, 0b100, {1: -1, 2: 1}),
        (15 * MS + 333, 0, 0, {1: 0, 2: 0}),
    ]:
        by_word.outputs(word(on, toward), at_ns)
        by_call.switch(signs, at_ns)
        assert by_word.energised(at_ns) == by_call.energised == [k for k in range(15) if on >> k & 1]
    assert by_word.truth(60 * MS) == by_call.truth(60 * MS)
    assert sum(by_word.plant.switches) > 0


def test_the_direction_bit_of_a_coil_that_is_off_means_nothing() -> None:
    one = pins()
    one.outputs(word(0, 0x7FFF), MS)
    assert one.energised(2 * MS) == []
    assert one.truth(50 * MS)["energy_j"] == [0.0] * 15


@pytest.mark.parametrize("stuck", [0, 0b1010])
def test_without_its_feed_nothing_is_energised_not_even_behind_a_stuck_driver(stuck) -> None:
    one = pins(driver_stuck=stuck)
    one.outputs(word(0x7FFF, 0x7FFF, feed=False), MS)
    assert one.energised(10 * MS) == []
    assert one.counts(CURRENT, 10 * MS) == 0
    assert one.truth(50 * MS)["energy_j"] == [0.0] * 15


def test_a_stuck_driver_drives_its_coil_toward_the_skin_as_long_as_it_is_fed() -> None:
    one = pins(driver_stuck=0b100)
    one.outputs(word(0), MS)
    assert one.energised(MS) == [2]
    one.outputs(word(0b100, 0), 2 * MS)  # back, by the word
    assert one.energised(2 * MS) == [2]
    assert one.truth(20 * MS)["latched"][2] == "on"
    one.off(20 * MS)
    assert one.energised(20 * MS) == []


def test_a_fault_may_begin_and_end_while_the_board_runs() -> None:
    one = pins()
    one.outputs(word(0), MS)
    one.set_load(4, 2 * MS, driver_stuck=1)
    assert one.energised(2 * MS) == [4]
    one.set_load(4, 3 * MS, driver_stuck=0)
    assert one.energised(3 * MS) == []


def test_the_supply_reads_ten_millivolts_a_count_and_sags_by_what_is_on() -> None:
    one = pins(spread=0, supply_ohm=0.1)
    assert one.counts(SUPPLY, 0) == 500
    one.outputs(word(0b111), MS)
    assert one.counts(SUPPLY, 2 * MS) == round(100 * 5.0 / (1.0 + 0.1 * 3 / 1.38))
    one.set_load(0, 3 * MS, supply_v=2.0, supply_ohm=0.0)
    assert one.counts(SUPPLY, 3 * MS) == 200


def test_the_current_reads_sixty_four_milliamperes_a_count_and_is_clamped() -> None:
    one = pins(spread=0, level="event", resistance_per_k=0.0)
    one.outputs(word(0b111), MS)
    assert one.counts(CURRENT, 11 * MS) == pytest.approx(3 * 5.0 / 1.38 / 64e-3, abs=1.0)
    shorted = pins(spread=0, coil_short=0x7FFF)
    shorted.outputs(word(0b1), MS)
    assert shorted.counts(CURRENT, 2 * MS) == pytest.approx((5.0 / 1.38 + 5.0 / COIL_SHORT_OHM) / 64e-3, abs=2.0)
    shorted.outputs(word(0x7FFF), 3 * MS)
    assert shorted.counts(CURRENT, 4 * MS) == 1023


def test_a_short_pulls_the_supply_down_and_draws_only_while_its_coil_is_on() -> None:
    one = pins(spread=0, coil_short=0b1, supply_ohm=0.2)
    one.outputs(word(0b10), MS)
    assert one.plant.volts == pytest.approx(5.0 / (1.0 + 0.2 / 1.38))
    one.outputs(word(0b11), 2 * MS)
    assert one.plant.volts == pytest.approx(5.0 / (1.0 + 0.2 * (2 / 1.38 + 1 / COIL_SHORT_OHM)))


def test_sensing_changes_nothing() -> None:
    def play(look: bool) -> dict[str, Any]:
        one = pins(seed=3)
        one.outputs(word(0b11, 0b11), MS)
        for k in range(100 if look else 0):
            one.counts(CURRENT, MS + k * 100_000)
        one.outputs(word(0), 11 * MS)
        return one.truth(30 * MS)

    assert play(True) == play(False)


@pytest.mark.parametrize(
    ("load", "words"), [({"driver_stuck": 2}, "driver_stuck"), ({"supply_v": 6.0}, "supply_v"), ({"weight": 1.0}, "coil_short")]
)
def test_a_load_that_makes_no_sense_is_refused_by_name(load, words) -> None:
    with pytest.raises(InputError, match=words):
        pins().set_load(0, 0, **load)


def test_an_input_that_is_not_wired_is_refused() -> None:
    with pytest.raises(InputError, match="input = 2"):
        pins().counts(2, 0)
