"""The array's driver on a simulated board: what is asked, what the plant does, what is said back."""

from __future__ import annotations

import pytest

import haptics
from haptics.errors import InputError
from haptics.link.messages import State
from haptics.session.glove import open as open_glove


def _truth(glove):
    return glove.devices.plant("tactiles").truth()


def test_a_contact_brings_the_pin_out_and_it_stays_without_power(glove):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    energy_j = _truth(glove)["energy_j"][1]
    glove.advance(1.0)
    truth = _truth(glove)
    assert truth["latched"][1] == "on"
    assert truth["energy_j"][1] == energy_j
    assert [r.played for r in glove.results()] == [True]


def test_a_release_brings_it_back(glove):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.1)
    glove.release("index_tip")
    glove.advance(0.1)
    assert _truth(glove)["latched"][1] == "off"


def test_a_pulse_leaves_the_pin_in(glove):
    glove.arm()
    glove.advance(0.05)  # telemetry comes each 20 ms
    before = glove.devices.telemetry["tactiles"].played[10]
    glove.pulse("palm_index", count=5, rate_hz=50)
    glove.advance(0.3)
    assert _truth(glove)["latched"][10] == "off"
    assert [r.played for r in glove.results()] == [True] * 5
    assert glove.devices.telemetry["tactiles"].played[10] == before + 10  # two strokes a pulse


def test_a_pulse_at_a_site_in_contact_is_denied_and_does_not_pull_the_pin_off_the_skin(glove):
    glove.arm()
    glove.contact("index_tip")
    glove.advance(0.05)
    glove.pulse("index_tip")
    glove.advance(0.05)
    assert _truth(glove)["latched"][1] == "on"
    assert [(r.kind, r.reason) for r in glove.results()] == [("contact", None), ("pulse", "contact")]


def test_unarmed_requests_are_denied_and_nothing_moves(glove):
    glove.contact("index_tip")
    glove.advance(0.1)
    assert [r.reason for r in glove.results()] == ["unarmed"]
    assert sum(_truth(glove)["energy_j"]) == 0
    glove.arm()
    glove.contact("index_tip")  # the driver must not believe that the pin is out
    glove.advance(0.1)
    assert _truth(glove)["latched"][1] == "on"


def test_a_train_that_nobody_may_play_is_denied_at_once(glove):
    glove.pulse("thumb_tip", count=5)
    assert [(r.kind, r.played, r.reason) for r in glove.results()] == [("pulse", False, "unarmed")] * 5


def test_all_sites_at_once_keep_within_the_current_limit_and_the_latency_bound(glove):
    glove.arm()
    start_ns = glove.devices.now_ns()
    for site in glove.devices.tactiles.sites:
        glove.contact(site)
    most = 0
    for _ in range(80):
        glove.advance(0.001)
        most = max(most, sum(_truth(glove)["coils_on"]))
    assert most == 3  # 12 A over 3.9 A a coil
    results = glove.results()
    assert all(r.played for r in results)
    rounds = 4  # floor(14 / 3) rounds of 10 ms, each 0.1 ms after the one before, after the command lead
    assert max(r.start_ns for r in results) - start_ns <= 3_000_000 + rounds * 10_100_000


def test_heat_denies_contacts_before_the_limit_and_never_a_release(glove):
    glove.arm()
    reasons = set()
    for _ in range(260):
        glove.contact("index_tip")
        glove.advance(0.02)
        glove.release("index_tip")
        glove.advance(0.02)
        results = glove.results()
        reasons |= {r.reason for r in results if not r.played}
        assert all(r.played for r in results if r.kind == "release")
    assert reasons == {"heat"}
    assert max(_truth(glove)["rise_k"]) <= 25.0


def test_what_a_calibrated_budget_believes_is_what_the_plant_feels(tmp_path):
    """5 V on 1.38 ohm are 18.12 W, of which motion and the current's rise take up to 1 %."""
    config = tmp_path / "glove.toml"
    config.write_text(
        "[tactiles]\nport = 'sim://tactiles?spread=0'\n"
        "[tactiles.calibration.index_tip]\ntau_s = 102\nc_k_per_w = 69\npower_w = 18.12\n"
    )
    with open_glove(str(config), clock="virtual") as glove:
        believed_k, felt_k = _believed_and_felt(glove)
    assert felt_k <= believed_k <= felt_k * 1.01


def test_what_an_uncalibrated_budget_believes_is_never_below_what_the_plant_feels(glove):
    believed_k, felt_k = _believed_and_felt(glove)
    worst = (79 / 97) * (25 / 1.28) / ((69 / 102) * (25 / 1.38))  # a jump at the bounds over one of the nominal coil, to 1 %
    assert felt_k * worst <= believed_k <= felt_k * worst * 1.011


def _believed_and_felt(glove) -> tuple[float, float]:
    glove.arm()
    for _ in range(20):
        glove.contact("index_tip")
        glove.advance(0.05)
        glove.release("index_tip")
        glove.advance(0.05)
    believed_k = glove.state().rise_k["index_tip"]
    return believed_k, _truth(glove)["rise_k"][1]


def test_going_off_withdraws_the_pins_and_disarms(glove):
    glove.arm()
    for site in ("index_tip", "thumb_tip", "palm_outer"):
        glove.contact(site)
    glove.advance(0.1)
    glove.off()
    truth = _truth(glove)
    assert set(truth["latched"]) == {"off"}
    assert truth["state"] == State.DISARMED


def test_an_unknown_site_names_those_that_exist(glove):
    with pytest.raises(InputError, match="index_tip"):
        glove.contact("elbow")


@pytest.mark.parametrize("ppm", [-150, -40, 40])
def test_strokes_that_meet_do_not_overlap_on_a_board_whose_clock_runs_otherwise(ppm):
    """A pulse's way back begins where its way out ends: rounded to the board's ticks one by one, they must still not meet."""
    with haptics.open(tactiles=f"sim://tactiles?ppm={ppm}", clock="virtual") as glove:
        glove.arm()
        for _ in range(20):
            glove.pulse("index_tip", count=5, rate_hz=100)
            glove.advance(0.3)
        assert {r.reason for r in glove.results()} == {None}
