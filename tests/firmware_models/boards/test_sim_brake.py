"""The brake controller: armed only after it tested itself, driven within its limits, off when in doubt, and what it holds."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from haptics.errors import InputError
from haptics.link.messages import Fault, State, Status
from haptics.physics.brake.charging import rise_time_s
from haptics.physics.brake.force_laws import force_law
from haptics.physics.brake.levels import LEVELS
from haptics.physics.brake.parameters import BRAKE, capacitance_f

MS = 1_000_000
NOMINAL_F = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
SAFE_V = 60.0
DISCHARGE_MS = 5.0


def drive(host, start: int, mask: int, volts: int, frequency_dhz: int = 200, ttl_ms: int = 1000) -> Status:
    return host.status("drive", start, mask, volts, frequency_dhz, ttl_ms)


def hold(host, ms: float) -> list[dict]:
    """Truth each millisecond, the dead-man fed."""
    seen = []
    for _ in range(round(ms)):
        host.send("keepalive")
        host.run(1)
        seen.append(host.port.truth())
    return seen


def armed(host, **query):
    h = host("brake", **query)
    h.arm()
    return h


def test_arming_goes_through_a_self_test_that_makes_no_force(host) -> None:
    h = host("brake", seed=2)
    assert h.status("arm", h.ask("identify").boot_id) == Status.OK
    states, volts, capacity = [], [], []
    for _ in range(100):
        h.run(0.1)
        truth = h.port.truth()
        states.append(truth["state"])
        volts.append(max(map(abs, truth["volts"])))
        capacity.append(max(truth["capacity_n"]))
    assert list(dict.fromkeys(states)) == [State.SELF_TEST, State.DISCHARGING, State.ARMED]
    assert 20.0 < max(volts) < 42.4
    assert max(capacity) < 0.01
    h.run(30)
    measured = h.last("brake_telemetry").capacitance
    assert [one * 1e-12 for one in measured] == pytest.approx([NOMINAL_F] * 5, rel=0.09)  # 5 % overlap, 1 % reading, thrice


def test_nothing_is_driven_before_the_self_test_is_over(host) -> None:
    h = host("brake")
    assert drive(h, h.tick_in(5), 1, 500) == Status.INTERLOCK
    h.send("arm", h.ask("identify").boot_id)
    h.run(0.6)
    assert drive(h, h.tick_in(5), 1, 500) == Status.INTERLOCK


def test_outputs_without_a_brake_are_not_driven(host) -> None:
    h = armed(host, fitted=2)
    h.run(30)
    assert [one == 0 for one in h.last("brake_telemetry").capacitance] == [False, False, True, True, True]
    reply = h.ask("drive", h.tick_in(5), 0b101, 500, 200, 100)
    assert (reply.status, reply.detail) == (Status.BAD_VALUE, 1)
    assert drive(h, h.tick_in(5), 0b011, 500) == Status.OK


@pytest.mark.parametrize(
    ("load", "fault"),
    [({"travel_m": 0.07}, Fault.OPEN), ({"leak_ohm": 1e3}, Fault.SHORT)],
)
def test_the_self_test_finds_a_torn_brake_and_a_short(host, load, fault) -> None:
    h = host("brake", spread=0)
    h.port.set_load(3, **load)
    h.send("arm", h.ask("identify").boot_id)
    h.run(20)
    assert h.port.truth()["state"] == State.FAULT
    assert (h.last("fault").code, h.last("fault").channel) == (fault, 3)


def test_no_brake_at_all_fails_the_self_test(host) -> None:
    h = host("brake", fitted=0)
    h.send("arm", h.ask("identify").boot_id)
    h.run(20)
    assert h.last("fault").code == Fault.SELF_TEST


@pytest.mark.parametrize(
    ("mask", "volts", "frequency_dhz", "ttl_ms", "detail"),
    [
        (0b100000, 500, 200, 100, 1),
        (1, 1501, 200, 100, 2),
        (1, 500, 4, 100, 3),  # a reversal at least each second
        (1, 1500, 700, 100, 3),  # beyond I / (2 C V), about 61 Hz
        (0b11, 1500, 400, 100, 3),  # two brakes share the supply
        (1, 100, 10_001, 100, 3),
        (1, 500, 200, 0, 4),
        (1, 500, 200, 2001, 4),
    ],
)
def test_a_value_beyond_its_limit_is_refused_by_field(host, mask, volts, frequency_dhz, ttl_ms, detail) -> None:
    h = armed(host, spread=0)
    reply = h.ask("drive", h.tick_in(5), mask, volts, frequency_dhz, ttl_ms)
    assert (reply.status, reply.detail) == (Status.BAD_VALUE, detail)
    hold(h, 20)
    assert h.port.truth()["state"] == State.ARMED


def test_what_is_just_within_the_limits_is_driven(host) -> None:
    h = armed(host, spread=0)
    assert drive(h, h.tick_in(5), 1, 1500, 550) == Status.OK
    hold(h, 300)
    assert h.port.truth()["state"] == State.DRIVING
    assert drive(h, h.tick_in(5), 0b11, 1500, 280) == Status.OK
    hold(h, 300)
    assert h.port.truth()["state"] == State.DRIVING


def test_stored_charge_is_bounded_whatever_the_capacitance(host) -> None:
    """45 uC: five brakes of four times the overlap, 10.2 nF each, hold that at about 883 V, though each may have 1500."""
    h = armed(host, spread=0, overlap_m2=4 * BRAKE.overlap_m2)
    h.run(30)
    measured_f = sum(h.last("brake_telemetry").capacitance) * 1e-12
    assert measured_f == pytest.approx(5 * 4 * NOMINAL_F, rel=0.02)
    most = math.floor(45e-6 / measured_f)
    for volts in (1500, most + 2):
        reply = h.ask("drive", h.tick_in(5), 31, volts, 5, 1500)
        assert (reply.status, reply.detail) == (Status.BAD_VALUE, 2)
    assert drive(h, h.tick_in(5), 31, most - 2, 5, 1500) == Status.OK
    charge_c = [sum(map(abs, truth["volts"])) * 4 * NOMINAL_F for truth in hold(h, 1200)]
    assert 44e-6 < max(charge_c) < 45e-6 * 1.02  # what the self test measured is within 2 %


def test_a_thin_dielectric_lowers_the_amplitude_limit(host) -> None:
    """150 V/um of what the controller is configured for."""
    h = host("brake", thickness_m=8e-6)
    assert h.ask("identify").limits[0] == 1200


def test_the_current_limit_counts_in_the_frequency_limit(host) -> None:
    h = host("brake", spread=0)
    limits = list(h.ask("identify").limits)
    limits[1] //= 2
    assert h.status("configure", limits) == Status.OK
    h.arm()
    assert drive(h, h.tick_in(5), 1, 1500, 550) == Status.BAD_VALUE
    assert drive(h, h.tick_in(5), 1, 1500, 270) == Status.OK


def test_the_wave_is_bipolar_and_its_first_half_period_has_half_the_length(host) -> None:
    h = armed(host, spread=0)
    start = h.tick_in(5)
    assert drive(h, start, 1, 1000, 200) == Status.OK
    h.listen(h.now_ns + 4 * MS)
    signs = []
    for truth in hold(h, 200):
        volts = truth["volts"][0]
        if abs(volts) > 900 and (not signs or signs[-1][1] != (volts > 0)):
            signs.append((truth["time_ns"], volts > 0))
    gaps = [round((b[0] - a[0]) / MS) for a, b in pairwise(signs)]
    assert gaps[0] in (13, 14)  # 12.5 ms, and the 1 ms clamp that the first ramp did not have
    assert gaps[1:] == [25] * (len(gaps) - 1)


def test_volts_rise_as_the_supplys_current_allows(host) -> None:
    h = armed(host, spread=0)
    drive(h, h.tick_in(5), 1, 1500, 100)
    seen = hold(h, 25)
    t0 = next(t["time_ns"] for t in seen if t["volts"][0] > 1.0)
    t90 = next(t["time_ns"] for t in seen if t["volts"][0] > 0.9 * 1500)
    assert (t90 - t0) / 1e9 == pytest.approx(rise_time_s(1500.0, NOMINAL_F), abs=1e-3)  # looked at each millisecond


@pytest.mark.parametrize("volts", [1000, 1500])
def test_capacity_reaches_the_laws_force(host, volts) -> None:
    """At 10 Hz; the index at 1500 V holds the published 20 N within the fit (thesis 4.7.3)."""
    h = armed(host, spread=0)
    drive(h, h.tick_in(5), 0b11, volts, 100, 2000)
    peak = [max(t["capacity_n"][channel] for t in hold(h, 300)) for channel in (0, 1)]
    for channel, finger in enumerate(("index", "thumb")):
        assert peak[channel] == pytest.approx(
            force_law(finger).force_n(volts, extrapolate=True), rel=0.002
        )  # two brakes ramp for 15 of 50 ms
    if volts == 1500:
        assert peak[0] == pytest.approx(20.0, rel=0.10)
    assert h.port.truth()["capacity_n"][2] < 0.01


def test_devices_differ_within_ten_per_cent(host) -> None:
    forces = []
    for seed in range(6):
        h = armed(host, seed=seed)
        drive(h, h.tick_in(5), 1, 1000, 100, 2000)
        forces.append(max(t["capacity_n"][0] for t in hold(h, 150)))
    nominal = force_law("index").force_n(1000)
    assert len(set(forces)) == 6
    assert all(abs(force / nominal - 1) < 0.10 + 0.05 + 0.02 for force in forces)  # force, overlap, twice the volts' 1 %


def test_half_capacity_is_told_once_a_drive(host) -> None:
    h = armed(host, spread=0)
    start_ns = h.now_ns
    drive(h, h.tick_in(5), 1, 1000, 100, 100)
    events = [event for t in hold(h, 300) for event in t["events"] if event[0] > start_ns]
    assert [event[2] for event in events] == ["driven", "half_capacity", "shorted"]
    half = force_law("index").force_n(1000) / 2
    assert events[1][3] == pytest.approx(half, rel=1e-6)
    assert 5 * MS < events[1][0] - events[0][0] < 9 * MS  # a ramp of 5.5 ms and a lag of 2 ms


def test_release_is_over_within_a_tenth_of_a_second(host) -> None:
    h = armed(host)
    drive(h, h.tick_in(5), 1, 1500, 100, 2000)
    hold(h, 200)
    held = h.port.truth()["capacity_n"][0]
    h.ask("stop")
    stopped_ns = h.now_ns
    h.run(30)  # one time constant of the release
    assert h.port.truth()["capacity_n"][0] == pytest.approx(held / math.e, rel=0.05)  # the exchange itself takes 1 ms
    h.listen(stopped_ns + 100 * MS)
    assert h.port.truth()["capacity_n"][0] < 0.1 * held


@pytest.mark.parametrize("how", ["ttl", "zero volts", "empty mask"])
def test_a_drive_ends_in_discharge_below_60_volts_in_the_stated_time_and_stays_armed(host, how) -> None:
    h = armed(host, ppm=0, tick_offset=0)
    start = h.tick_in(5)
    drive(h, start, 0b11, 1500, 100, 50 if how == "ttl" else 1000)
    if how != "ttl":
        assert drive(h, start + 100_000, *((0b11, 0) if how == "zero volts" else (0, 1500)), 0, 0) == Status.OK
    end_ns = start * 500 + 50 * MS
    h.listen(end_ns - 1)
    assert h.port.truth()["state"] == State.DRIVING
    h.listen(end_ns)
    assert h.port.truth()["state"] == State.DISCHARGING
    assert max(map(abs, h.port.truth()["volts"])) > 1000
    h.run(DISCHARGE_MS)
    truth = h.port.truth()
    assert max(map(abs, truth["volts"])) < SAFE_V
    assert truth["state"] == State.ARMED
    assert drive(h, h.tick_in(2), 1, 500) == Status.OK


@pytest.mark.parametrize("command", ["stop", "disarm"])
def test_stop_shorts_at_once_and_disarms(host, command) -> None:
    h = armed(host)
    drive(h, h.tick_in(2), 0b11111, 1500, 100, 2000)
    drive(h, h.tick_in(200), 0b11111, 1500, 100, 2000)
    hold(h, 100)
    assert h.port.energised() == [0, 1, 2, 3, 4]
    assert h.status(command) == Status.OK
    assert h.port.truth()["state"] in (State.DISCHARGING, State.DISARMED)
    h.run(DISCHARGE_MS)
    assert h.port.energised() == []
    assert h.port.truth()["state"] == State.DISARMED
    h.live(200)
    assert h.port.truth()["volts"] == pytest.approx([0.0] * 5, abs=1e-3)


@pytest.mark.parametrize("how", ["stop", "disarm", "dead-man", "lid", "brown-out"])
def test_nothing_asked_before_it_was_made_safe_comes_back_once_it_is_armed_again(host, how) -> None:
    """Volts and bursts that run, that wait for their tick, and a drive that waits for the outputs to be empty."""
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    assert h.status("piezo", h.tick_in(2), 0b00001, 1500) == Status.OK
    hold(h, 50)
    drive(h, h.tick_in(300), 0b100, 900, 100, 2000)
    assert h.status("piezo", h.tick_in(300), 0b00100, 1500) == Status.OK
    tick = h.tick_in(10)
    drive(h, tick, 0b010, 800, 100, 2000)
    assert h.port.truth()["piezo"][0]
    h.listen(h.port.tick_ns(tick) + MS)  # all was shorted at that tick, and this one would begin 2 ms after it
    begun: list[int] = []
    h.port.watch(lambda time_ns, kind, channel, on: begun.append(channel) if on else None)
    {
        "stop": lambda: h.status("stop"),
        "disarm": lambda: h.status("disarm"),
        "dead-man": lambda: h.run(101),
        "lid": lambda: h.port.set_load(0, lid_open=1),
        "brown-out": lambda: h.port.set_load(0, brown_out=1),
    }[how]()
    h.port.set_load(0, lid_open=0)
    h.run(1)
    assert h.port.truth()["state"] not in (State.ARMED, State.DRIVING)
    h.send("sync", 1)  # whose answer may be lost behind half a frame of before a reset
    h.run(DISCHARGE_MS)
    assert begun == [] or how == "dead-man"  # which lets it begin, and ends it
    h.status("disarm")
    h.arm()
    seen = hold(h, 450)
    assert max(max(map(abs, truth["volts"])) for truth in seen) < 1.0
    assert not any(any(truth["piezo"]) for truth in seen)


def test_a_host_that_falls_silent_on_the_way_back_to_armed_is_missed(host, monkeypatch) -> None:
    """Its outputs take 80 ms to be empty here; the dead-man does not wait for them."""
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1000, 100, 60)
    monkeypatch.setattr("firmware_models.boards.brake_board.DISCHARGE_NS", 200 * MS)
    hold(h, 40)
    fed_ns = h.now_ns
    highest_v = h.port.board.plant.highest_v
    monkeypatch.setattr(h.port.board.plant, "highest_v", lambda now_ns: max(highest_v(now_ns), 70.0))
    h.listen(fed_ns + 98 * MS)
    assert h.port.truth()["state"] == State.DISCHARGING
    h.listen(fed_ns + 102 * MS)
    assert h.port.truth()["state"] == State.FAULT
    assert h.last("fault").code == Fault.DEAD_MAN


def test_dead_man_while_driving_brings_volts_down(host) -> None:
    h = armed(host)
    drive(h, h.tick_in(2), 1, 1500, 100, 2000)
    hold(h, 50)
    fed_ns = h.now_ns
    h.listen(fed_ns + 99 * MS)
    assert h.port.truth()["state"] == State.DRIVING
    h.listen(fed_ns + 101 * MS + round(DISCHARGE_MS * MS))
    assert h.port.truth()["state"] == State.FAULT
    assert h.port.energised() == []
    assert h.last("fault").code == Fault.DEAD_MAN


def test_dead_man_guards_the_self_test_and_the_discharge(host) -> None:
    for silent_after_ms in (0.5, 5.0):
        h = host("brake")
        h.send("arm", h.ask("identify").boot_id)
        h.run(silent_after_ms)
        h.run(101)
        assert h.port.truth()["state"] == State.FAULT


def test_renewing_a_drive_keeps_its_phase(host) -> None:
    """A host that renews each 20 ms must not keep the wave from ever reversing (half period 50 ms)."""
    h = armed(host, spread=0)
    signs = set()
    for _ in range(20):
        assert drive(h, h.tick_in(2), 1, 800, 100, 100) == Status.OK
        signs |= {math.copysign(1, t["volts"][0]) for t in hold(h, 20) if abs(t["volts"][0]) > 700}
    assert signs == {1.0, -1.0}
    assert h.port.truth()["state"] == State.DRIVING


def test_a_changed_amplitude_and_a_second_brake_take_effect_while_driving(host) -> None:
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 400, 100, 2000)
    hold(h, 70)
    drive(h, h.tick_in(2), 0b11, 1200, 100, 2000)
    hold(h, 100)
    truth = h.port.truth()
    assert truth["state"] == State.DRIVING
    assert truth["amplitude_v"][:2] == pytest.approx([1200] * 2, rel=0.01)
    drive(h, h.tick_in(2), 0b10, 600, 100, 2000)
    hold(h, 100)
    truth = h.port.truth()
    assert truth["state"] == State.DRIVING
    assert abs(truth["volts"][0]) < 1.0
    assert truth["amplitude_v"][1] == pytest.approx(600, rel=0.01)


def test_a_drive_that_is_over_before_its_outputs_are_empty_energises_nothing(host) -> None:
    h = armed(host)
    drive(h, h.tick_in(2), 1, 600, 100, 500)
    hold(h, 30)
    driven: list[int] = []
    h.port.watch(lambda time_ns, kind, channel, on: driven.append(channel) if on else None)
    drive(h, h.tick_in(5), 2, 500, 100, 1)
    hold(h, 30)
    assert driven == []
    assert h.port.truth()["state"] == State.ARMED


def test_a_late_drive_is_dropped(host) -> None:
    h = armed(host)
    start = h.tick_in(1)
    h.run(5)
    assert drive(h, start, 1, 1000) == Status.LATE
    hold(h, 30)
    assert h.port.truth()["capacity_n"][0] < 0.01
    assert h.last("brake_telemetry").late == 1


def test_the_queue_takes_eight_drives(host) -> None:
    h = armed(host)
    start = h.tick_in(200)
    assert [drive(h, start + k, 1, 500) for k in range(9)] == [Status.OK] * 8 + [Status.FULL]


@pytest.mark.parametrize(
    ("query", "fault"),
    [({"volts_gain": 1.08}, Fault.OVER_VOLTAGE), ({"supply_current_a": 700e-6}, Fault.OVER_CURRENT)],
)
def test_a_bad_supply_trips_its_guard(host, query, fault) -> None:
    h = armed(host, spread=0, **query)
    drive(h, h.tick_in(2), 0b11, 1000, 100, 2000)
    hold(h, 60)
    assert h.port.truth()["state"] == State.FAULT
    assert h.last("fault").code == fault
    assert h.port.energised() == []


def test_a_regulated_supply_within_five_per_cent_does_not_trip(host) -> None:
    h = armed(host, spread=0, volts_gain=1.04)
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    hold(h, 200)
    assert h.port.truth()["state"] == State.DRIVING


@pytest.mark.parametrize(
    ("load", "fault"),
    [
        ({"leak_ohm": 1500 / 70e-6}, Fault.LEAK),
        ({"leak_ohm": 10e3}, Fault.LEAK),
        ({"travel_m": 0.11}, Fault.OPEN),
    ],
)
def test_a_brake_that_breaks_while_driven_is_found(host, load, fault) -> None:
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1500, 100, 2000)
    hold(h, 92)  # held volts, in the middle of a half period
    assert h.port.truth()["state"] == State.DRIVING
    h.port.set_load(0, **load)
    hold(h, 60)
    assert h.port.truth()["state"] == State.FAULT
    assert (h.last("fault").code, h.last("fault").channel) == (fault, 0)


def test_a_small_leak_is_reported_and_not_a_fault(host) -> None:
    h = armed(host, spread=0)
    h.port.set_load(0, leak_ohm=1000 / 30e-6)
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    hold(h, 90)
    assert h.port.truth()["state"] == State.DRIVING
    assert h.last("brake_telemetry").leakage[0] == pytest.approx(300, rel=0.05)


@pytest.mark.parametrize("frequency_dhz", [20, 100, 400])
def test_a_stuck_bridge_latches_after_one_and_a_half_half_periods(host, frequency_dhz) -> None:
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1000, frequency_dhz, 2000)
    hold(h, 10)
    h.port.board.plant.stage.stuck = True
    h.port.set_load(0)
    began_ns = h.now_ns
    half_ms = 5000 / frequency_dhz
    hold(h, 1.5 * half_ms + 10)
    assert h.last("fault").code == Fault.BRIDGE_STUCK
    assert next(heard for heard in h.heard if heard.name == "fault").time_ns - began_ns < (2 * half_ms + 2) * MS


def test_sliding_strips_are_sensed_by_their_capacitance(host) -> None:
    """0.23 pF/um (derived): 10 mm of travel take 9 % of the overlap."""
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    hold(h, 120)
    before = h.last("brake_telemetry").capacitance[0]
    h.port.set_load(0, travel_m=10e-3)
    hold(h, 120)
    assert before - h.last("brake_telemetry").capacitance[0] == pytest.approx(232, abs=3)


def test_a_pull_beyond_capacity_slips(host) -> None:
    h = armed(host, spread=0)
    h.port.set_load(0, pull_n=5.0)
    assert h.port.truth()["slipping"][0]
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    hold(h, 100)
    truth = h.port.truth()
    assert not truth["slipping"][0]
    assert truth["held_n"][0] == 5.0


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_a_board_of_any_level_arms_drives_and_holds_a_hand(host, level) -> None:
    """Guards and self test see the same volts; a hand 7 mm beyond the slack loads 800 N/m in series up to 8.8 N at 1000 V."""
    h = armed(host, spread=0, level=level)
    assert drive(h, h.tick_in(5), 1, 1000, 100, 2000) == Status.OK
    hold(h, 60)
    h.port.set_load(0, hand_m=0.0, hand_m_s=0.05)
    seen = hold(h, 160)
    assert h.port.truth()["state"] == State.DRIVING
    assert seen[10]["tension_n"][0] == 0.0
    rising = [t["tension_n"][0] for t in seen[40:100]]
    assert rising == sorted(rising)
    assert seen[100]["tension_n"][0] == pytest.approx(800 * 4.05e-3, abs=0.2)  # damping of the moving finger in it
    assert max(t["tension_n"][0] for t in seen) < force_law("index").force_n(1000)
    h.port.set_load(0, hand_m=0.04)
    held = hold(h, 60)[-1]
    assert held["slip_m"][0] > 0.02
    assert held["tension_n"][1:] == [0.0] * 4
    h.ask("stop")
    h.live(200)
    assert h.port.truth()["tension_n"][0] < 0.1


def test_a_hand_slides_the_strips_and_the_sensed_capacitance_says_so(host) -> None:
    h = armed(host, spread=0, level="dynamic")
    drive(h, h.tick_in(2), 1, 400, 100, 2000)
    hold(h, 120)
    before = h.last("brake_telemetry").capacitance[0]
    h.port.set_load(0, hand_m=0.015)
    hold(h, 150)
    slip_mm = h.port.truth()["slip_m"][0] * 1e3
    assert slip_mm > 10.0
    assert before - h.last("brake_telemetry").capacitance[0] == pytest.approx(23.2 * slip_mm, abs=3)


def test_a_hand_speed_needs_a_hand_and_a_level_must_be_one(host) -> None:
    h = host("brake")
    with pytest.raises(InputError, match="hand_m_s"):
        h.port.set_load(0, hand_m_s=0.1)
    with pytest.raises(InputError, match="hand_m"):
        h.port.set_load(0, hand_n=0.1)
    with pytest.raises(InputError, match="level"):
        host("brake", level="best")


@pytest.mark.parametrize("level", LEVELS)
def test_looking_often_changes_nothing_at_any_level(host, level) -> None:
    def play(look: bool) -> dict:
        h = armed(host, seed=5, level=level)
        drive(h, h.tick_in(2), 1, 1200, 100, 150)
        h.port.set_load(0, hand_m=0.0, hand_m_s=0.1)
        for _ in range(240 if look else 1):
            h.run(0.25 if look else 60)
            h.port.truth()
        return h.port.truth()

    a, b = play(True), play(False)
    for key in ("capacity_n", "tension_n", "slip_m"):
        assert a[key] == pytest.approx(b[key], rel=1e-8, abs=1e-9)


def test_supply_power_is_twice_c_v_squared_f_at_least(host) -> None:
    """Two charges a period from 0 V: C V^2 f for a sagging supply (found), stray capacitance and bleeder on top."""
    h = armed(host, spread=0)
    drive(h, h.tick_in(2), 1, 1500, 200, 2000)
    hold(h, 100)
    h.port.truth()
    hold_ns = 500 * MS
    h.live(hold_ns / MS)
    power = h.port.truth()["supply_power_w"]
    ideal = (NOMINAL_F + 0.2e-9) * 1500**2 * 20
    assert ideal < power < 1.15 * ideal


def test_piezos_vibrate_for_their_time_only_when_armed(host) -> None:
    h = host("brake")
    assert h.status("piezo", h.tick_in(1), 0b11, 300) == Status.INTERLOCK
    h.arm()
    assert h.status("piezo", h.tick_in(1), 0b11, 300) == Status.OK
    assert h.status("piezo", h.tick_in(1), 0b100000, 300) == Status.BAD_VALUE
    on = [sum(t["piezo"]) for t in hold(h, 400)]
    assert on.count(2) == pytest.approx(300, abs=3)  # it began during the exchange that followed
    assert on[-1] == 0


def test_time_that_nobody_looked_at_is_the_same_time(host) -> None:
    """Looking each millisecond, or not at all, gives the same volts and forces."""

    def play(look: bool) -> dict:
        h = armed(host, seed=9)
        drive(h, h.tick_in(2), 1, 1200, 100, 150)
        if look:
            for _ in range(280):
                h.run(0.25)
                h.port.truth()
        else:
            h.run(70)
        return h.port.truth()

    a, b = play(True), play(False)
    assert a["capacity_n"] == pytest.approx(b["capacity_n"], rel=1e-9)
    assert a["volts"] == pytest.approx(b["volts"], rel=1e-9, abs=1e-9)


def test_a_board_under_voltage_is_not_armed(host) -> None:
    h = host("brake")
    boot_id = h.ask("identify").boot_id
    h.port.board.plant.drive(1, 50.0, 0.0, h.now_ns)  # somebody else's volts
    h.run(5)
    assert h.status("arm", boot_id) == Status.INTERLOCK
    h.port.board.plant.drive(0, 0.0, 0.0, h.now_ns)
    h.run(5)
    assert h.status("arm", boot_id) == Status.OK


def test_a_discharge_that_does_not_come_latches_and_stays_latched(host, monkeypatch) -> None:
    h = armed(host)
    drive(h, h.tick_in(2), 1, 1000, 100, 2000)
    hold(h, 50)
    monkeypatch.setattr(h.port.board.plant, "highest_v", lambda now_ns: 900.0)
    assert h.status("stop") == Status.OK
    assert h.port.truth()["state"] == State.DISCHARGING
    h.run(DISCHARGE_MS + 1)
    assert h.port.truth()["state"] == State.FAULT
    h.run(1)
    assert (h.last("fault").code, h.last("fault").value) == (Fault.BRIDGE_STUCK, 900)
    assert h.ask("disarm").detail == 1 << Fault.BRIDGE_STUCK
    monkeypatch.undo()
    assert h.ask("disarm").detail == 0
