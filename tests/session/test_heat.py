"""Heat of a glove against its plants: no actuator passes the limit, whatever is asked of it, whichever host came before."""

from __future__ import annotations

import numpy as np
import pytest
from cores import CORES

import haptics
from haptics.scene.sites import SITES

CORNERS = [f"tau_s={tau}&c_k_per_w={c}&resistance_ohm={ohm}" for tau in (97, 107) for c in (59, 79) for ohm in (1.28, 1.48)]


SWEPT_K = 0.010 * (25 / 1.28) * (79 / 97)
"""What arming a cold glove costs each coil at most: one stroke of 10 ms, on the coil of tolerance that warms most."""


def hottest(glove) -> float:
    """The plants' truth: the warmest actuator now."""
    return max(glove.devices.plant("tactiles").truth()["rise_k"])


def torment(glove, rng: np.random.Generator, seconds: float, sites=SITES) -> float:
    """Ask for all that the array can do, everywhere and at once; the warmest that any actuator really was."""
    array = glove.devices.tactiles
    peak_k = 0.0
    for _ in range(round(seconds / 0.25)):
        for site in sites:
            what = rng.integers(5)
            if what == 0:
                glove.contact(site)
            elif what == 1:
                glove.release(site)
            elif what == 2:
                glove.pulse(site, count=25, rate_hz=100)
            else:
                array.burst(site, 10, glove.devices.now_ns())
        for _ in range(5):
            glove.advance(0.05)
            for site in sites:
                array.burst(site, 10, glove.devices.now_ns())
        peak_k = max(peak_k, hottest(glove))
    return peak_k


@pytest.mark.parametrize("device", [CORNERS[2], CORNERS[-2], "seed=3"])
def test_no_actuator_within_tolerance_passes_the_limit_inside_one_session(device):
    rng = np.random.default_rng(1)
    sites = SITES[:3]
    with haptics.open(tactiles=f"sim://tactiles?level=event&{device}", clock="virtual") as glove:
        glove.arm()
        peak_k = torment(glove, rng, 3.0, sites)
        glove.off()
        glove.advance(1.0)
        glove.arm()
        peak_k = max(peak_k, torment(glove, rng, 1.0, sites))
        denied = {result.reason for result in glove.results() if not result.played}
        assert "heat" in denied
        assert "hot" not in denied
        believed_k = max(glove.state().rise_k.values())
    assert peak_k <= believed_k <= 25.0 * (1 + 1e-9)
    assert peak_k > 15.0  # the limit was what held it


@pytest.mark.soak
@pytest.mark.parametrize("level", ["event", "table", "dynamic"])
@pytest.mark.parametrize("device", [*CORNERS, *(f"seed={seed}" for seed in range(100, 124))])
def test_no_actuator_passes_the_limit_at_any_level(device, level):
    rng = np.random.default_rng(2)
    with haptics.open(tactiles=f"sim://tactiles?level={level}&{device}", clock="virtual") as glove:
        peak_k = 0.0
        for _ in range(3):
            glove.arm()
            peak_k = max(peak_k, torment(glove, rng, 8.0))
            glove.off()
            glove.advance(float(rng.uniform(0.0, 40.0)))
        denied = {result.reason for result in glove.results() if not result.played}
    assert "heat" in denied
    assert "hot" not in denied
    assert peak_k <= 25.0


def glove_file(folder, url: str, calibration: str = "", **limits: object) -> str:
    """A configuration of an array and nothing else."""
    path = folder / "glove.toml"
    lines = [f"{name} = {value}" for name, value in limits.items()]
    path.write_text("\n".join(["[tactiles]", f'port = "{url}"', *lines, calibration]), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("seed", range(2))
def test_a_legal_glove_never_meets_the_boards_own_limit_whatever_its_calibration(seed, core, tmp_path):
    """Calibrations as wild as a file may be: the board's account never has to refuse what the host lets through."""
    rng = np.random.default_rng(seed)
    sites = SITES[:3]
    calibration = "\n".join(
        f"[tactiles.calibration.{site}]\ntau_s = {rng.uniform(20, 500):.1f}\nc_k_per_w = {rng.uniform(10, 120):.1f}\n"
        f"power_w = {rng.uniform(2, 40):.1f}\ntau_sd_s = {rng.uniform(0, 2):.2f}"
        for site in sites
    )
    url = f"sim://tactiles?level=event&seed={seed}&core={core}"
    config = glove_file(tmp_path, url, calibration, rise_limit_k=rng.uniform(10, 30))
    with haptics.open(config, clock="virtual") as glove:
        glove.arm()
        torment(glove, rng, 6.0, sites)
        reasons = [result.reason for result in glove.results()]
    assert "heat" in reasons
    assert "hot" not in reasons


def test_a_calibrated_actuator_is_held_by_its_own_values_and_gets_more(tmp_path):
    device = "level=event&tau_s=102&c_k_per_w=69&resistance_ohm=1.38"
    own = "[tactiles.calibration.index_tip]\ntau_s = 102\nc_k_per_w = 69\npower_w = 18.116"
    peaks = {}
    for name, calibration in (("own", own), ("worst", "")):
        config = glove_file(tmp_path, f"sim://tactiles?{device}", calibration)
        with haptics.open(config, clock="virtual") as glove:
            glove.arm()
            peaks[name] = torment(glove, np.random.default_rng(1), 4.0, ("index_tip",))
    assert peaks["worst"] < 25.0 * (69 / 102 / 1.38) / (79 / 97 / 1.28) * 1.01
    assert 24.0 < peaks["own"] <= 25.0


def test_limits_of_the_file_reach_the_boards(tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text(
        "[tactiles]\nrise_limit_k = 10\ncurrent_limit_a = 8\ncontact_pulse_s = 0.008\n"
        "[brake]\nmax_amplitude_v = 400\nmax_frequency_hz = 50\nttl_s = 0.1\nmax_charge_c = 2e-6\n"
    )
    with haptics.open(str(path), clock="virtual") as glove:
        array, brake = (glove.devices.plant(name).board for name in ("tactiles", "brake"))
        assert list(array.limits) == [160, 8000, 64, 3000, 636]
        assert list(brake.limits) == [400, 500, 500, 1000, 2000]
        with pytest.raises(haptics.InputError, match="400"):
            glove.brake("index", volts=401)
        glove.arm()
        link = glove.devices.links["brake"]
        raw = link.send(
            "drive", link.to_ticks(glove.devices.now_ns() + 10_000_000), 1, 401, 200, 100, now_ns=glove.devices.now_ns()
        )
        glove.advance(0.05)
        assert raw.status == 7  # bad_value: a path that passes by the driver meets the board


def test_where_a_board_was_built_stricter_its_limits_hold_and_a_note_says_so(tmp_path):
    url = "sim://tactiles?level=event&current_limit_a=5"
    with haptics.open(tactiles=url, clock="virtual") as glove:
        assert glove.state().notes == ("tactiles: the board holds a stricter limit: coil current 5000 mA (configured: 12000)",)
        glove.arm()
        for site in SITES:
            glove.contact(site)
        glove.advance(0.3)
        results = glove.results()
    assert len(results) == 15
    assert all(result.played for result in results)  # one after the other, none of them refused by the board


# Hosts after hosts on one board.


def url_in(name: str, device: str = CORNERS[-2], core: str = "py") -> str:
    return f"sim://tactiles?world={name}&level=event&core={core}&{device}"


def disarm(glove) -> None:
    """As ``haptics off`` does: clear what a dead-man or a brown-out latched."""
    glove.devices.links["tactiles"].send("disarm", now_ns=glove.devices.now_ns())
    glove.advance(0.1)


def session(url: str, rng: np.random.Generator, end: str, seconds: float = 1.5) -> tuple[float, float, int]:
    """One host: what it believes once armed, the true peak while it was there, how many requests were denied for heat."""
    glove = haptics.open(tactiles=url, clock="virtual")
    disarm(glove)
    glove.arm()
    believed_k = glove.state().rise_k["index_tip"]
    assert glove.devices.plant("tactiles").truth()["rise_k"][1] <= believed_k * (1 + 1e-9)
    peak_k = torment(glove, rng, seconds, SITES[:3])
    reasons = [result.reason for result in glove.results()]
    assert "hot" not in reasons
    if end == "killed":
        for link in glove.devices.links.values():
            link.close()
    else:
        if end == "rebooted":
            glove.devices.links["tactiles"].port.board.reset()
        glove.close()
    return believed_k, peak_k, reasons.count("heat")


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("ends", [("closed",) * 5, ("killed",) * 5, ("rebooted",) * 5], ids=lambda ends: ends[0])
def test_five_hosts_one_after_the_other_on_one_board_pass_no_limit(world, core, ends):
    name, entered = world
    rng = np.random.default_rng(5)
    believed, peaks, denied = [], [], 0
    for end in ends:
        believed_k, peak_k, count = session(url_in(name, core=core), rng, end)
        believed.append(believed_k)
        peaks.append(peak_k)
        denied += count
        entered.advance(entered.now_ns + 300_000_000)
    assert max(peaks) <= 25.0
    assert denied > 0
    assert max(peaks) > 20.0  # it was the account that held them
    assert believed[0] == pytest.approx(SWEPT_K, rel=0.01)
    assert min(believed[2:]) > 20.0


@pytest.mark.parametrize("core", [*CORES[:2], pytest.param(*CORES[2].values, marks=[*CORES[2].marks, pytest.mark.soak])])
def test_a_board_that_lost_its_account_starts_at_its_limit_and_the_host_says_so(world, core):
    name, _ = world
    session(url_in(name, core=core), np.random.default_rng(1), "killed")
    with haptics.open(tactiles=url_in(name, core=core), clock="virtual") as glove:
        plant = glove.devices.plant("tactiles")
        plant.set_load(0, brown_out=1)
        glove.advance(0.5)
        disarm(glove)
        glove.arm()
        notes = glove.state().notes
        (note,) = [note for note in notes if "start warm" in note]
        assert note.startswith(
            "tactiles: 15 coils start warm (up to 42 K, from the board's account): denied until cooled, up to "
        )
        wait_s = float(note.split()[-2])
        glove.contact("palm_outer")
        glove.advance(0.1)
        assert [result.reason for result in glove.results()] == ["heat"]
        glove.release("palm_outer")
        glove.off()
        glove.arm()
        assert glove.state().notes == notes  # each said once
        assert len(glove.state().pins_out) == 15  # releases wait, too
        glove.advance(wait_s + 1.0)
        assert glove.state().pins_out == ()
        glove.contact("palm_outer")
        glove.advance(0.1)
        glove.release("palm_outer")
        glove.advance(0.1)
        assert [result.played for result in glove.results()] == [True, True]


def test_what_a_host_knows_itself_is_neither_lowered_nor_raised_by_arming_again():
    """Off and armed again: the board's account says nothing that this host has not booked."""
    with haptics.open(tactiles="sim://tactiles?level=event", clock="virtual") as glove:
        glove.arm()
        torment(glove, np.random.default_rng(1), 1.0, SITES[:3])
        for _ in range(3):
            glove.off()
            budget = glove.devices.tactiles.budgets[1]
            before_k, at_ns = budget.rise_k(budget.latest_ns), budget.latest_ns
            glove.arm()
            now_k, now_ns = budget.rise_k(budget.latest_ns), budget.latest_ns
            assert now_k == pytest.approx(before_k * np.exp(-(now_ns - at_ns) / 1e9 / 107), rel=1e-9)
        assert glove.state().notes == ()


def test_what_a_stuck_driver_took_is_in_the_account_when_armed_again():
    """The board charges every coil, as any may have been the one; the plant shows which."""
    with haptics.open(tactiles=f"sim://tactiles?level=event&{CORNERS[2]}", clock="virtual") as glove:
        plant = glove.devices.plant("tactiles")
        for _ in range(3):
            glove.arm()
            plant.set_load(1, driver_stuck=1)
            glove.advance(0.1)
            plant.set_load(1, driver_stuck=0)
            assert "coil_on_time" in " ".join(glove.state().faults)
            disarm(glove)
        glove.arm()
        assert 0.0 < plant.truth()["rise_k"][1] <= glove.state().rise_k["index_tip"]


def test_a_cold_board_starts_a_host_at_nothing():
    with haptics.open(tactiles="sim://tactiles", clock="virtual") as glove:
        glove.arm()
        assert list(glove.state().rise_k.values()) == pytest.approx([SWEPT_K] * 15, rel=0.01)
        assert glove.state().notes == ()


def test_a_bench_warms_on_purpose_and_keeps_the_boards_own_limit():
    from rigs.bench import Bench, BenchOptions

    with Bench("tactiles", (), BenchOptions(), rig="test") as bench:
        assert bench.link.identity.limits == (200, 12_000, 64, 3000, 2500)
