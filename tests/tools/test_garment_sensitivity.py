"""What a garment owes to numbers that nobody measured, as a person asks for it."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

TOOL = Path(__file__).resolve().parents[2] / "tools" / "garment_sensitivity.py"


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    spec = importlib.util.spec_from_file_location("garment_sensitivity", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = tool  # where dataclasses look for their annotations
    spec.loader.exec_module(tool)
    tool.LEVELS = {level: tool.LEVELS[level] for level in ("coarse", "draft")}
    changed = ("attachment_n_m3", "rounding_m", "lame", "bulge", "level")
    return [asdict(tool.row(*one)) for one in tool.changes(tool.Setting(coverage=None), changed)]


@pytest.fixture
def energies(rows) -> dict[tuple[str, float | str], float]:
    return {(row["changed"], row["value"]): row["energy_j"] for row in rows}


def test_a_stiffer_attachment_leaves_the_cloth_more_to_stretch(energies):
    rising = [energies["attachment_n_m3", value] for value in (1e4, 1e5)]
    rising += [energies["nothing", ""], *(energies["attachment_n_m3", value] for value in (1e6, 1e7))]
    assert rising == sorted(rising)
    assert rising[-1] > 2 * rising[0]


def test_a_solid_s_constants_stiffen_by_what_they_add_to_the_modulus_of_the_sheet(energies):
    """lambda + 2 mu grows by (1 - nu)^2 / (1 - 2 nu) = 1.32, mu not at all: the energy lies between."""
    assert 1.0 < energies["lame", "thesis"] / energies["nothing", ""] < 1.32


def test_the_rounding_of_contact_hardly_matters(energies):
    for value in (5e-6, 8e-5):
        assert energies["rounding_m", value] == pytest.approx(energies["nothing", ""], rel=0.02)


def test_an_arm_without_a_bulging_muscle_stretches_the_sleeve_less(energies):
    assert energies["bulge", "none"] < energies["nothing", ""]


def test_a_finer_mesh_changes_the_energy_as_stated(rows, energies):
    """Against 28,712 vertices: coarse -1.9, draft -0.2 % (docs/explanation/garments.md)."""
    assert [row["vertices"] for row in rows if row["changed"] == "level"] == [1826]
    assert energies["nothing", ""] / energies["level", "draft"] == pytest.approx(0.981 / 0.998, rel=0.003)


def test_the_numbers_are_one_json_object(script):
    code, out, err = script("garment_sensitivity", "--no-design", "--only", "lame", "--json")
    assert code == 0, err
    found = json.loads(out)
    assert (found["garment"], found["motion"], found["angle_deg"], found["coverage"]) == ("sleeve", "elbow_flexion", 60.0, None)
    assert [row["changed"] for row in found["rows"]] == ["nothing", "lame"]
    assert all(row["density_increase"] is None for row in found["rows"])


def test_the_table_compares_each_design_with_the_unchanged_one(script):
    code, out, err = script("garment_sensitivity", "--coverage", 0.95, "--only", "lame")
    assert code == 0, err
    head, first, second = out.splitlines()
    assert head.split() == ["changed", "to", "vertices", "energy,", "J", "density"]
    assert first.split()[0] == "nothing"
    # Nineteen twentieths of the cloth cannot store more than all of it did, and the tenth that went was worth least.
    assert 1.0 < float(first.split()[-1]) <= 1 / 0.95
    assert second.split()[:2] == ["lame", "thesis"]
    energy, energy_change, density, density_change = (float(word) for word in second.split()[3:] if word != "%")
    assert energy_change == pytest.approx(100 * (energy / float(first.split()[2]) - 1), abs=0.1)
    assert density_change == pytest.approx(100 * (density / float(first.split()[3]) - 1), abs=1.0)  # of three digits


@pytest.mark.parametrize(
    "words",
    [
        ("--only", "weather"),
        ("--motion", "x"),
        ("--garment", "hat"),
        ("--level", "0"),
        ("--body", "x"),
        ("--coverage", "2"),
        ("--angle-deg", "200"),
    ],
)
def test_bad_arguments_are_refused_by_name(script, words):
    code, _, err = script("garment_sensitivity", *words)
    assert code == 1
    assert words[0].strip("-").split("-")[0] in err
    assert "allowed" in err
