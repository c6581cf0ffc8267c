"""``haptics predict laws`` and ``haptics predict recoil``: what is printed, against the published points and decay times."""

from __future__ import annotations

import math

import pytest

POINTS = {
    "index": [(200, 0.10), (400, 1.34), (800, 6.04), (1500, 20.0)],
    "thumb": [(200, 0.16), (400, 1.05), (800, 3.91)],
}


@pytest.mark.parametrize("finger", POINTS)
def test_every_law_is_told_with_its_fit_points_and_range(answer, finger):
    told = answer("predict", "laws", "--finger", finger)
    assert told["finger"] == finger
    assert [law["law"] for law in told["laws"]] == ["ideal", "threshold", "closing_gap"]
    for law in told["laws"]:
        count = len(law["names"])
        assert len(law["values"]) == len(law["sds"]) == len(law["covariance"]) == count
        for i, row in enumerate(law["covariance"]):
            assert math.sqrt(row[i]) == pytest.approx(law["sds"][i])
        assert [(p["volts"], p["measured_n"]) for p in law["points"]] == POINTS[finger]
        assert [(p["volts"], p["measured_n"]) for p in law["left_out"]] == POINTS[finger]
        assert law["chi2"] == pytest.approx(sum(p["residual_sigma"] ** 2 for p in law["points"]))
        assert law["degrees_of_freedom"] == len(POINTS[finger]) - count
        assert law["reduced_chi2"] == pytest.approx(law["chi2"] / law["degrees_of_freedom"])
        assert law["validity"]["volts"] == [POINTS[finger][0][0], POINTS[finger][-1][0]]


def test_the_threshold_law_of_the_index_is_the_published_fit(answer):
    law = answer("predict", "laws")["laws"][1]
    assert law["default"] is True
    values, sds = dict(zip(law["names"], law["values"], strict=True)), dict(zip(law["names"], law["sds"], strict=True))
    assert values["k_n_v2"] == pytest.approx(9.63e-6, abs=0.005e-6)  # three digits
    assert sds["k_n_v2"] == pytest.approx(0.59e-6, abs=0.005e-6)
    assert values["threshold_v"] == pytest.approx(171, abs=2)
    assert sds["threshold_v"] == pytest.approx(10, abs=0.5)


def test_it_says_which_law_is_the_default_and_why(answer):
    told = answer("predict", "laws")
    assert [law["law"] for law in told["laws"] if law["default"]] == [told["comparison"]["chosen"]] == ["threshold"]
    assert "simpler" in told["comparison"]["why"]
    assert {one["law"]: one["rejected"] for one in told["comparison"]["standings"]} == {
        "ideal": True,
        "threshold": False,
        "closing_gap": False,
    }


def test_what_a_left_out_point_cannot_tell_is_null_with_a_note(answer):
    first = answer("predict", "laws", "--finger", "thumb")["laws"][1]["left_out"][0]
    assert first["error_sigma"] is None
    assert "2 points for 2 parameters" in first["note"]


def test_a_person_gets_tables(command):
    code, out, _ = command("predict", "laws")
    assert code == 0
    for word in ("threshold (default), index", "closing_gap, index", "published points", "valid: volts", "simpler"):
        assert word in out


@pytest.mark.parametrize(("surface", "tau_s"), [("bare", 5.9e-3), ("silicone", 4.1e-3), ("foam", 1.8e-3)])
def test_recoil_of_the_published_surfaces(answer, surface, tau_s):
    told = answer("predict", "recoil", "--surface", surface)
    assert (told["tau_s"], told["peak_g"], told["sample_rate_hz"], told["valid"]) == (tau_s, pytest.approx(10.0), 3200.0, True)
    for t, a in zip(told["times_s"], told["acceleration_m_s2"], strict=True):
        assert a == pytest.approx(98.0665 * math.exp(-t / tau_s))


def test_recoil_of_another_impact_is_answered_as_not_valid(answer, command):
    told = answer("predict", "recoil", "--surface", "bare", "--relative-speed", 2, "--length-ms", 1)
    assert (told["peak_g"], told["valid"], len(told["times_s"])) == (pytest.approx(20.0), False, 4)
    assert "not valid: recoil was measured" in command("predict", "recoil", "--relative-speed", 2)[1]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("laws", "--finger", "ring"), "finger"),
        (("recoil", "--surface", "wood"), "surface"),
        (("recoil", "--relative-speed", -1), "--relative-speed"),
        (("recoil", "--relative-speed", "nan"), "--relative-speed"),
        (("recoil", "--length-ms", -1), "--length-ms"),
        (("recoil", "--sample-hz", 0), "--sample-hz"),
        (("recoil", "--surface"), "surface"),
    ],
)
def test_nonsense_is_refused_by_name(refused, arguments, word):
    assert word in refused("predict", *arguments)
