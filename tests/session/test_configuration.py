"""glove.toml: what it may say, and that the committed schema and page agree with the code."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from haptics.errors import InputError
from haptics.session.configuration import (
    ActuatorCalibration,
    BrakeCalibration,
    BrakeConfiguration,
    Configuration,
    TactilesConfiguration,
    check_configuration,
    load_configuration,
)
from haptics.session.devices import Devices
from haptics.table_faults import line_of

DOCS = Path(__file__).resolve().parents[2] / "docs" / "reference"


def test_without_a_file_it_is_the_simulated_glove():
    configuration = load_configuration(None)
    assert configuration.tactiles.port == "sim://tactiles"
    assert configuration.brake.port == "sim://brake"
    assert configuration.tracker_latency_s == 0.010


def test_the_committed_schema_is_the_codes():
    assert json.loads((DOCS / "glove.schema.json").read_text()) == Configuration.model_json_schema()


def test_the_example_on_the_page_is_valid_and_shows_the_defaults():
    example = re.search(r"```toml\n(.*?)```", (DOCS / "configuration.md").read_text(), re.S)
    assert example is not None
    shown = check_configuration(tomllib.loads(example.group(1)), "the page")
    plain = shown.model_copy(update={"side": "auto", "tactiles": shown.tactiles.model_copy(update={"calibration": {}})})
    plain = plain.model_copy(update={"brake": shown.brake.model_copy(update={"calibration": {}})})
    assert plain == Configuration()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"tactiles": {"rise_limit_k": 31}}, ("rise_limit_k = 31 K in [tactiles]", "30")),
        ({"tactiles": {"current_limit_a": 3.9}}, ("current_limit_a = 3.9 A in [tactiles]", "3.907")),
        ({"tactiles": {"contact_pulse_s": 0.02}}, ("contact_pulse_s", "0.02", "0.01")),
        ({"tactiles": {"sites": ["elbow"]}}, ("sites", "index_tip")),
        ({"tactiles": {"sites": ["index_tip", "index_tip"]}}, ("sites", "index_tip", "twice")),
        ({"brake": {"amplitude_v": 1501}}, ("amplitude_v = 1501 V in [brake]", "1500")),
        ({"brake": {"max_amplitude_v": 1501}}, ("max_amplitude_v = 1501 V in [brake]", "1500")),
        ({"brake": {"max_charge_c": 46e-6}}, ("max_charge_c = 4.6e-05 C in [brake]", "4.5e-05")),
        ({"brake": {"max_amplitude_v": 600, "amplitude_v": 700}}, ("amplitude_v = 700", "max_amplitude_v = 600")),
        ({"brake": {"max_frequency_hz": 10, "frequency_hz": 20}}, ("frequency_hz = 20", "max_frequency_hz = 10")),
        ({"brake": {"channels": []}}, ("channels",)),
        ({"brake": {"channels": list("abcdef")}}, ("channels", "5")),
        ({"tracker_latency_s": float("nan")}, ("tracker_latency_s",)),
        ({"colour": 1}, ("colour",)),
        ({"tactiles": {"calibration": {"index_tip": {"tau_s": -1}}}}, ("tau_s", "-1")),
        ({"tactiles": {"calibration": {"index_tip": {"c_sd_k_per_w": 1}}}}, ("c_sd_k_per_w = 1", "c_k_per_w")),
    ],
)
def test_what_is_not_allowed_is_refused_by_name_value_and_range(table, words):
    with pytest.raises(InputError) as refused:
        check_configuration(table, "glove.toml")
    for word in words:
        assert word in str(refused.value)


def test_what_is_not_given_keeps_to_a_limit_that_is():
    brake = check_configuration({"brake": {"max_amplitude_v": 300}}, "glove.toml").brake
    assert (brake.amplitude_v, brake.clutch_amplitude_v, brake.max_amplitude_v) == (300, 300, 300)


def test_boards_are_configured_with_the_least_that_lets_every_legal_request_through():
    """By hand: 25 K over 79/97 K/J at 25/1.28 W are 1571.7 ms of on-time, 99 % of what the board is given."""
    nominal = Configuration()
    assert nominal.tactiles.board_limits() == (200, 12_000, None, None, 1588)
    assert nominal.brake.board_limits() == (1500, None, 10_000, 1000, 45_000)
    tables = {
        "tactiles": {"rise_limit_k": 10, "current_limit_a": 8.5, "contact_pulse_s": 0.00604},
        "brake": {"max_amplitude_v": 612.5, "max_frequency_hz": 40.0, "ttl_s": 0.0305, "max_charge_c": 3e-6},
    }
    lowered = check_configuration(tables, "glove.toml")
    assert lowered.tactiles.contact_pulse_s == 0.00605  # what is booked is what plays, in units of 50 us
    assert lowered.tactiles.board_limits() == (121, 8500, None, None, 636)
    assert lowered.brake.board_limits() == (612, None, 400, 1000, 3000)


def test_pulses_of_three_milliseconds_stay_legal_whatever_a_contact_takes():
    assert check_configuration({"tactiles": {"contact_pulse_s": 0.001}}, "glove.toml").tactiles.board_limits()[0] == 60


def test_a_calibration_counts_with_three_of_its_standard_deviations_and_what_it_lacks_at_its_worst():
    own = {"tau_s": 100.0, "tau_sd_s": 1.0, "c_k_per_w": 70.0, "c_sd_k_per_w": 0.7, "power_w": 18.0, "power_sd_w": 0.0}
    tables = {"tactiles": {"calibration": {"index_tip": own, "thumb_tip": {"tau_s": 100.0}}}}
    tactiles = check_configuration(tables, "glove.toml").tactiles
    index, thumb, other = (tactiles.coil_heat(site) for site in ("index_tip", "thumb_tip", "palm_outer"))
    assert index.jump_k_per_s == pytest.approx(70 * 1.03 * 18 / 97)  # 3 sd of 1 % in c, of 1 s in tau
    assert (index.parameters.tau_s, index.power_w) == (103.0, 18.0)
    assert thumb.jump_k_per_s == pytest.approx(79 * (25 / 1.28) / 100)
    assert thumb.parameters.tau_s == 100.0
    assert other.jump_k_per_s == pytest.approx(79 * (25 / 1.28) / 97)
    assert other.parameters.tau_s == 107.0


def test_calibration_of_a_site_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="elbow"):
        check_configuration({"tactiles": {"calibration": {"elbow": {"tau_s": 90}}}}, "glove.toml")


def test_a_calibrated_brake_gets_the_volts_of_its_own_law():
    own = {"brake": {"calibration": {"index": {"k_n_v2": 8e-6, "threshold_v": 100.0}}}}
    law, overlap_m2 = check_configuration(own, "glove.toml").brake.law("index")
    # F = k (V^2 - V0^2) + 5 mN of off force, solved by hand for 4 N
    assert law.volts_for(4.0, overlap_m2) == pytest.approx(((4.0 - 0.005) / 8e-6 + 100.0**2) ** 0.5, rel=1e-9)
    with pytest.raises(InputError, match=r"calibration\.thumb is of no brake of this glove; its brakes \(channels\): index"):
        check_configuration({"brake": {"channels": ["index"], "calibration": {"thumb": {"k_n_v2": 8e-6, "threshold_v": 1}}}}, "x")


def test_faults_of_a_file_come_in_its_order_each_with_its_own_line(tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text(
        '[brake]\nchannels = ["index", "thumb"]\nmax_amplitude_v = 500\n\n'
        "[brake.calibration.indx]\nk_n_v2 = 1e-5\nthreshold_v = 3\n"
        '[tactiles]\nsites = ["index_tip", "palm_indx"]\n[tactiles.calibration.index_tip]\ntau_sd_s = 1\n'
    )
    with pytest.raises(InputError) as refused:
        load_configuration(path)
    brake, sites, calibration = str(refused.value).splitlines()
    assert brake.startswith(
        f"{path}:5: [brake]: calibration.indx is of no brake of this glove; its brakes (channels): index, thumb"
    )
    assert brake.endswith("did you mean index?")
    assert sites.startswith(f"{path}:9: sites in [tactiles]: site = 'palm_indx' is not allowed; allowed: thumb_tip, ")
    assert sites.endswith("did you mean palm_index?")
    assert calibration.startswith(f"{path}:11: [tactiles.calibration.index_tip]: tau_sd_s = 1 s without tau_s")
    path.write_text("[brake]\nmax_amplitude_v = 500\namplitude_v = 800\n")
    with pytest.raises(InputError, match=r":3: \[brake\]: amplitude_v = 800 V is above max_amplitude_v = 500 V"):
        load_configuration(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"glove.toml is not TOML: it is no text in UTF-8 \(invalid start byte at byte 0\)"):
        load_configuration(path)


@pytest.mark.parametrize("made", [lambda table, **keys: table(**keys), lambda table, **keys: table.model_validate(keys)])
@pytest.mark.parametrize(
    ("table", "keys", "said"),
    [
        (Configuration, {"side": "x"}, "Configuration: side = 'x'; allowed: auto, left, right"),
        (Configuration, {"brake": {"volts": 3}}, "Configuration: unknown key 'volts' in [brake]; known keys: port"),
        (TactilesConfiguration, {"rise_limit_k": 99}, "TactilesConfiguration: rise_limit_k = 99 K; allowed 1 to 30 K"),
        (BrakeConfiguration, {"colour": 1}, "BrakeConfiguration: unknown key 'colour'; known keys: port"),
        (BrakeCalibration, {"k_n_v2": 1e-5}, "BrakeCalibration: key 'threshold_v' is missing; it is required"),
        (ActuatorCalibration, {"tau_s": -1}, "ActuatorCalibration: tau_s = -1 s; allowed 20 to 500 s"),
    ],
)
def test_a_table_made_by_hand_is_refused_like_one_of_a_file(made, table, keys, said):
    with pytest.raises(InputError) as refused:
        made(table, **keys)
    assert str(refused.value).startswith(said)


def test_a_file_that_is_not_toml_is_refused_with_its_place(tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text("side = \n")
    with pytest.raises(InputError, match=r"glove\.toml:1: .*is not TOML"):
        load_configuration(path)


@pytest.mark.parametrize("part", ["tactiles", "brake"])
@pytest.mark.parametrize("url", ["spy://sim://tactiles?file={victim}", "alt://x?class=y", "socket://host", "hwgrep://", ""])
def test_a_port_of_a_kind_that_is_not_opened_is_refused_in_a_file(tmp_path, part, url):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    file = tmp_path / "glove.toml"
    file.write_text(f'[{part}]\nport = "{url.format(victim=victim)}"\n')
    with pytest.raises(InputError, match=rf"\[{part}\]: port = "):
        load_configuration(file)
    assert victim.read_text() == "mine"


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (
            {"tactile": {}},
            "known keys: side, tracker_latency_s, tick_hz, hand_calibration, tactiles, brake; did you mean tactiles",
        ),
        ({"tactiles": {"rise_limit": 5}}, "unknown key 'rise_limit' in [tactiles]; known keys: port, baud, sites, rise_limit_k"),
        (
            {"tactiles": {"calibration": {"index_tip": {"tau": 5}}}},
            "unknown key 'tau' in [tactiles.calibration.index_tip]; known keys: tau_s, tau_sd_s",
        ),
        ({"brake": {"port": "spy://x"}}, "[brake]: port = 'spy://x' has the unknown kind"),
    ],
)
def test_an_unknown_key_is_refused_with_those_there_are(table, said):
    with pytest.raises(InputError) as refused:
        check_configuration(table, "glove.toml")
    assert said in str(refused.value)


def worked_hard(table: dict, sites: tuple[str, ...] = ("index_tip",), cycles: int = 400) -> dict:
    """The plant, after a glove of this file was asked for more than it may give: out and in again each 40 ms."""
    part = check_configuration({"tactiles": {"port": "sim://tactiles?spread=0", **table}}, "glove.toml").tactiles
    glove = Devices(part, None, realtime=False)
    try:
        glove.arm()
        max_on = 0
        for _ in range(cycles):
            for move in (glove.tactiles.contact, glove.tactiles.release):
                for site in sites:
                    move(site, glove.now_ns())
                for _ in range(4):
                    glove.step_to(glove.now_ns() + 5_000_000)
                    max_on = max(max_on, sum(glove.plant("tactiles").truth()["coils_on"]))
        return {**glove.plant("tactiles").truth(), "max_on": max_on}
    finally:
        glove.off()
        glove.close()


@pytest.mark.parametrize("limit_k", [4.0, 9.0])
def test_a_rise_limit_holds_on_the_plant_and_is_used_up(limit_k):
    """Measured where the heat is: an ideal array comes near its own limit, and never passes it."""
    hottest = max(worked_hard({"rise_limit_k": limit_k}, cycles=100)["rise_k"])
    assert 0.5 * limit_k < hottest <= limit_k  # what no bench has measured is counted as the warmest within tolerance


def test_a_current_limit_holds_on_the_plant():
    assert worked_hard({"current_limit_a": 8.0}, ("index_tip", "thumb_tip", "palm_outer"), cycles=3)["max_on"] == 2


def test_an_actuator_that_its_bench_found_to_warm_more_is_spared_more():
    """Twice the kelvins a watt: the same limit is reached with half the energy."""
    own = {"calibration": {"index_tip": {"c_k_per_w": 138.0}, "palm_outer": {"c_k_per_w": 69.0}}, "rise_limit_k": 6.0}
    energy_j = worked_hard(own, ("index_tip", "palm_outer"), cycles=100)["energy_j"]
    assert energy_j[1] == pytest.approx(energy_j[14] / 2, rel=0.15)


def test_a_brakes_time_to_live_is_what_its_volts_have_when_the_program_hangs():
    part = check_configuration({"brake": {"ttl_s": 0.05}}, "glove.toml").brake
    glove = Devices(None, part, realtime=False)
    try:
        glove.arm()
        glove.brakes.engage("index", 800.0, glove.now_ns())
        glove.step_to(glove.now_ns() + 40_000_000)
        assert abs(glove.plant("brake").truth()["volts"][0]) > 100
        glove.follow(glove.now_ns() + 70_000_000)  # the link lives, the driver is not ticked any more
        assert abs(glove.plant("brake").truth()["volts"][0]) < 60
    finally:
        glove.off()
        glove.close()


def test_each_fault_of_a_file_has_its_own_line_with_the_place_in_the_file(tmp_path):
    file = tmp_path / "glove.toml"
    file.write_text(
        '[tactiles]\nport = "sim://tactiles"\nrise_limit_k = 99\n\n[brake]\nport = "sim://brake"\nrise_limit_k = 3\nttl_s = 9\n'
    )
    with pytest.raises(InputError) as refused:
        load_configuration(file)
    first, *others = str(refused.value).splitlines()
    assert first == f"{file}:3: rise_limit_k = 99 K in [tactiles]; allowed 1 to 30 K"
    assert f"{file}:8: ttl_s = 9 s in [brake]; allowed 0.02 to 1 s" in others
    assert any(line.startswith(f"{file}:7: unknown key 'rise_limit_k' in [brake]") for line in others)


def test_what_is_no_toml_is_shown_with_its_line(tmp_path):
    file = tmp_path / "glove.toml"
    file.write_text('[tactiles]\nport = "sim://tactiles\n')
    with pytest.raises(InputError, match=rf"{file}:2: .*sim://tactiles.* is not TOML .*column 23"):
        load_configuration(file)


def test_a_name_of_a_list_that_is_none_is_named_with_the_nearest(tmp_path):
    with pytest.raises(InputError, match=r"site = 'index_tp' .*did you mean index_tip"):
        check_configuration({"tactiles": {"sites": ["thumb_tip", "index_tp"]}}, "glove.toml")
    with pytest.raises(InputError, match=r"channel = 'index' is given twice"):
        check_configuration({"brake": {"channels": ["index", "thumb", "index"]}}, "glove.toml")


def test_a_configuration_made_by_hand_is_refused_in_the_project_s_own_words():
    with pytest.raises(InputError, match=r"^Configuration: side = 'x'; allowed: auto, left, right$"):
        Configuration(side="x")


def test_what_a_power_may_be_off_by_counts_beside_what_c_may_be_off_by():
    def rise(**more):
        own = {"tau_s": 100.0, "c_k_per_w": 70.0, "power_w": 18.0, **more}
        heat = check_configuration({"tactiles": {"calibration": {"index_tip": own}}}, "x").tactiles.coil_heat("index_tip")
        return heat.parameters.c_k_per_w * heat.power_w

    exact = rise()
    assert rise(power_sd_w=0.18) / exact == pytest.approx(1 + 3 * 0.01)
    assert rise(c_sd_k_per_w=0.7) / exact == pytest.approx(1 + 3 * 0.01)
    assert rise(power_sd_w=0.18, c_sd_k_per_w=0.7) / exact == pytest.approx(1 + 3 * 0.01 * 2**0.5)


def test_a_fault_in_a_table_that_follows_another_at_once_has_its_own_line():
    text = "[[objects]]\n[[objects]]\nname = 3\n"
    assert line_of(text, ("objects", 0, "name")) == 1
    assert line_of(text, ("objects", 1, "name")) == 3
    assert line_of("a = 1\n[tactiles]\nport = 1\n[brake]\nport = 2\n[brake.calibration.index]\nk = 3\n", ("brake", "port")) == 5


def test_an_array_has_a_site_and_a_limit_that_is_no_number_is_refused_under_its_own_name():
    with pytest.raises(InputError, match=r"sites in \[tactiles\]: no site is named; expected 1 to 15 of thumb_tip"):
        check_configuration({"tactiles": {"sites": []}}, "x")
    assert check_configuration({"brake": {"max_amplitude_v": "100"}}, "x").brake.amplitude_v == 100.0
    with pytest.raises(InputError, match=r"^x: max_amplitude_v = .many. in .brake.; expected a number"):
        check_configuration({"brake": {"max_amplitude_v": "many"}}, "x")
