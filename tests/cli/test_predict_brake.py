"""``haptics predict brake`` against the figures of thesis 4.4, 4.7 and Table 4.2."""

from __future__ import annotations

import pytest

TABLE_4_2_N = {
    ("index", 200): 0.10,
    ("index", 400): 1.34,
    ("index", 800): 6.04,
    ("thumb", 200): 0.16,
    ("thumb", 400): 1.05,
    ("thumb", 800): 3.91,
}
EPS0_F_PER_M = 8.8541878128e-12


def test_the_answer_has_the_promised_keys(answer):
    keys = {
        "force_n",
        "force_sd_n",
        "law",
        "capacitance_f",
        "compression_ideal_n",
        "friction_ideal_n",
        "field_v_per_um",
        "t90_ms",
    }
    keys |= {"power_eq44_w", "supply_power_w", "amplitude_v", "valid", "reasons"}
    assert keys <= set(answer("predict", "brake", "--volts", 1000))


@pytest.mark.parametrize(("finger", "volts"), TABLE_4_2_N)
def test_force_of_table_4_2(answer, finger, volts):
    told = answer("predict", "brake", "--volts", volts, "--finger", finger, "--hz", 10)
    published_n = TABLE_4_2_N[finger, volts]
    # the published spread between devices is 10 %; at 200 V, on the threshold, the table's own second decimal is half of that
    assert told["force_n"] == pytest.approx(published_n, abs=0.05 if volts == 200 else 0.1 * published_n)
    assert told["force_sd_n"] > 0
    assert told["valid"] is True


def test_twenty_newtons_at_1500_volts(answer):
    assert answer("predict", "brake", "--volts", 1500, "--finger", "index", "--hz", 10)["force_n"] == pytest.approx(20.0, rel=0.1)


def test_the_predicted_figures_of_section_4_7_1(answer):
    told = answer("predict", "brake", "--volts", 1500, "--hz", 20)
    assert told["capacitance_f"] == pytest.approx(2.547e-9, rel=5e-4)
    assert told["compression_ideal_n"] == pytest.approx(220.0, rel=0.005)
    assert told["friction_ideal_n"] == pytest.approx(44.0, rel=0.005)
    assert told["field_v_per_um"] == pytest.approx(1500 / 13)
    assert told["power_eq44_w"] == pytest.approx(0.0573, rel=1e-3)
    assert told["power_eq44_w"] == pytest.approx(0.5 * told["capacitance_f"] * 1500**2 * 20)
    assert told["amplitude_v"] == pytest.approx(1500.0, rel=1e-3)


def test_a_source_gives_at_least_twice_what_each_charging_stores(answer):
    told = answer("predict", "brake", "--volts", 1500, "--hz", 20)
    # two chargings a period from 0 V, each taking C V^2 / 2 at a constant current, stray and bleeder on top
    assert told["supply_power_w"] >= told["capacitance_f"] * 1500**2 * 20


def test_charging_at_the_supply_s_current_takes_c_v_over_i(answer):
    told = answer("predict", "brake", "--volts", 1500)
    assert told["t90_ms"] == pytest.approx(0.9 * (told["capacitance_f"] + 0.2e-9) * 1500 / 500e-6 * 1e3, rel=0.02)


def test_strips_overlap_and_film_scale_the_capacitance(answer):
    one = answer("predict", "brake", "--volts", 300)
    told = answer("predict", "brake", "--volts", 300, "--strips", 3, "--overlap-cm2", 5.5, "--thickness-um", 26)
    assert told["capacitance_f"] == pytest.approx(one["capacitance_f"] * 3 * 0.5 * 0.5)
    assert one["capacitance_f"] == pytest.approx(one["permittivity"] * EPS0_F_PER_M * 11e-4 / 13e-6)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["threshold", "ideal", "closing_gap"])
@pytest.mark.parametrize("force_n", [0.5, 4.0, 15.0])
def test_the_inverse_gives_the_volts_that_hold_the_force(answer, law, force_n):
    volts = answer("predict", "brake", "--force-n", force_n, "--law", law, "--hz", 10)["volts"]
    told = answer("predict", "brake", "--volts", volts, "--law", law, "--hz", 10)
    assert told["force_n"] == pytest.approx(force_n, rel=1e-6)
    assert told["law"] == law


def test_past_breakdown_there_is_a_reason_and_no_force(command, strict_json):
    code, out, _ = command("predict", "brake", "--volts", 4000, "--json")  # 308 V/um, above the film's 300
    told = strict_json(out)
    assert code == 0  # an answer, and not nonsense
    assert told["valid"] is False
    assert any("breakdown" in reason for reason in told["reasons"])
    assert told["force_n"] == 0
    code, shown, _ = command("predict", "brake", "--volts", 99999)
    assert code == 0
    assert "not valid: 99999 V is above the supply's 2000 V" in shown
    assert "plateau" not in shown, "a row without a value"
    assert " - " not in shown


@pytest.mark.parametrize("arguments", [("--volts", 1999), ("--volts", 1500, "--hz", 500), ("--volts", 500, "--hz", 0)])
def test_what_is_outside_the_measured_is_answered_and_marked(answer, arguments):
    told = answer("predict", "brake", *arguments)
    assert told["valid"] is False
    assert told["reasons"]


def test_no_volts_is_no_nonsense(answer):
    told = answer("predict", "brake", "--volts", 0)
    assert told["valid"] is True
    assert told["max_frequency_hz"] == 1000.0  # the bridge's own (4.4.3)
    assert 0 <= told["force_n"] < 0.01  # off: a few mN (4.7.3)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "--force-n"),
        (("--volts", 10, "--force-n", 3), "--force-n"),
        (("--volts", -5), "volts"),
        (("--volts", "nan"), "volts"),
        (("--volts", "inf"), "volts"),
        (("--volts", "many"), "--volts"),
        (("--volts", 100, "--finger", "nose"), "finger"),
        (("--volts", 100, "--law", "wishful"), "law"),
        (("--volts", 100, "--strips", 0), "strips"),
        (("--volts", 100, "--thickness-um", 0), "--thickness-um"),
        (("--volts", 100, "--overlap-cm2", -1), "--overlap-cm2"),
        (("--volts", 100, "--hz", -3), "--hz"),
        (("--force-n", -1), "--force-n"),
        (("--force-n", 1e9), "--force-n"),
    ],
)
def test_nonsense_is_refused_by_name(refused, arguments, word):
    assert word in refused("predict", "brake", *arguments)
