"""A bench goes off in one order, whoever asks: what pulls stops, nothing is held, pins are back, the board is off."""

from __future__ import annotations

import pytest

from rigs.bench import Bench, BenchOptions
from rigs.instruments import LoadCell, Stage, Thermocouple


@pytest.mark.parametrize("way", ["disarm", "leave"])
def test_the_stage_stops_before_volts_drop_and_volts_drop_before_the_board_is_off(way):
    order: list[str] = []
    with Bench("brake", [LoadCell, Stage], BenchOptions(seed=3), rig="test") as bench:
        members = bench.link.port._world.members
        stage, plant, off = members["stage"].board, members["brake"].board.plant, bench.glove.off
        cancel, drive = stage._cancel, plant.drive

        def off_now() -> None:
            # An armed board takes the release; one that is off would be armed anew with brakes still wished for.
            assert bench.link.armed
            assert not bench.glove.brakes.engaged()
            assert max(map(abs, plant.volts(bench.now_ns))) < 60.0
            order.append("off")
            off()

        bench.arm()
        bench.engage(0, 1000.0, 20.0)
        bench.move(5e-3, 10e-3)
        bench.wait(0.2)
        stage._cancel = lambda: (order.append("stage"), cancel())[1]
        plant.drive = lambda mask, *more: (order.append("volts on" if mask else "volts off"), drive(mask, *more))[1]
        bench.glove.off = off_now
        assert stage.truth()["hand_m_s"] > 0.0
        if way == "disarm":
            bench.disarm()
            assert not bench.link.armed
            bench.glove.off = off
            bench.wait(0.1)
            assert stage.truth()["hand_m_s"] == 0.0
    assert list(dict.fromkeys(order)) == ["stage", "volts off", "off"]


def test_pins_are_back_before_a_bench_disarms_its_board():
    with Bench("tactiles", [Thermocouple], BenchOptions(seed=3), rig="test") as bench:
        plant, off, seen = bench.glove.plant("tactiles"), bench.glove.off, []
        bench.arm()
        bench.pulse([2, 7], bench.now_ns + 50_000_000, 10e-3, toward_skin=True)
        bench.wait(0.2)
        assert [plant.truth()["latched"][k] for k in (2, 7)] == ["on", "on"]
        bench.glove.off = lambda: (seen.append(set(plant.truth()["latched"])), off())[1]
        bench.disarm()
        assert seen == [{"off"}]
        assert not bench.link.armed
