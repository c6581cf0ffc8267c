"""glove.toml: what it may say, and that the committed schema and page agree with the code."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from haptics.errors import InputError
from haptics.session.configuration import Configuration, check_configuration, load_configuration

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
        ({"tactiles": {"rise_limit_k": 61}}, ("tactiles.rise_limit_k", "61", "60")),
        ({"tactiles": {"contact_pulse_s": 0.02}}, ("contact_pulse_s", "0.02", "0.01")),
        ({"tactiles": {"sites": ["elbow"]}}, ("sites", "index_tip")),
        ({"tactiles": {"sites": ["index_tip", "index_tip"]}}, ("sites", "different")),
        ({"brake": {"amplitude_v": 1501}}, ("brake.amplitude_v", "1501", "1500")),
        ({"brake": {"channels": []}}, ("channels",)),
        ({"brake": {"channels": list("abcdef")}}, ("channels", "5")),
        ({"tracker_latency_s": float("nan")}, ("tracker_latency_s",)),
        ({"colour": 1}, ("colour",)),
        ({"tactiles": {"calibration": {"index_tip": {"tau_s": -1}}}}, ("tau_s", "-1")),
    ],
)
def test_what_is_not_allowed_is_refused_by_name_value_and_range(table, words):
    with pytest.raises(InputError) as refused:
        check_configuration(table, "glove.toml")
    for word in words:
        assert word in str(refused.value)


def test_calibration_of_a_site_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="elbow"):
        check_configuration({"tactiles": {"calibration": {"elbow": {"tau_s": 90}}}}, "glove.toml")


def test_a_calibrated_brake_gets_the_volts_of_its_own_law():
    own = {"brake": {"calibration": {"index": {"k_n_v2": 8e-6, "threshold_v": 100.0}}}}
    law, overlap_m2 = check_configuration(own, "glove.toml").brake.law("index")
    # F = k (V^2 - V0^2) + 5 mN of off force, solved by hand for 4 N
    assert law.volts_for(4.0, overlap_m2) == pytest.approx(((4.0 - 0.005) / 8e-6 + 100.0**2) ** 0.5, rel=1e-9)
    with pytest.raises(InputError, match=r"calibration of thumb, which no output drives; allowed: index"):
        check_configuration({"brake": {"channels": ["index"], "calibration": {"thumb": {"k_n_v2": 8e-6, "threshold_v": 1}}}}, "x")


def test_a_file_that_is_not_toml_is_refused_with_its_place(tmp_path):
    path = tmp_path / "glove.toml"
    path.write_text("side = \n")
    with pytest.raises(InputError, match="line 1"):
        load_configuration(path)


@pytest.mark.parametrize("part", ["tactiles", "brake"])
@pytest.mark.parametrize("url", ["spy://sim://tactiles?file={victim}", "alt://x?class=y", "socket://host", "hwgrep://", ""])
def test_a_port_of_a_kind_that_is_not_opened_is_refused_in_a_file(tmp_path, part, url):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    file = tmp_path / "glove.toml"
    file.write_text(f'[{part}]\nport = "{url.format(victim=victim)}"\n')
    with pytest.raises(InputError, match=f"{part}.port"):
        load_configuration(file)
    assert victim.read_text() == "mine"
