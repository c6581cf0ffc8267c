"""``haptics garment`` as a person or a program meets it."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="extra `report`")

from quick_garments import quick_garments

from haptics.garments import catalogue
from haptics.garments.bodies import open_body
from haptics.garments.design.designs import read_designs
from haptics.garments.design.job import open_designs
from haptics.garments.design.rating import Densities, solved
from haptics.garments.equilibrium import simulation
from haptics.garments.equilibrium.cholesky import installed_solvers
from haptics.garments.garment import cut_garment
from haptics.garments.mesh import SurfaceMesh
from haptics.garments.mesh_files import write_obj

pytestmark = pytest.mark.slow

SLEEVE = ("--garment", "sleeve", "--motion", "elbow_flexion", "--angle-deg", "90", "--level", "coarse")
FILES = {"designs.h5", "sequence.png", "density.png", "garment.png", "design.json"}


BEFORE = 1
"""Equilibria before the first step: the full garment. The drawn line and X are those found for ``designed``."""


@pytest.fixture(scope="module", autouse=True)
def _quick():
    with quick_garments():
        yield


@pytest.fixture(scope="module")
def designed(tmp_path_factory) -> tuple[Path, dict]:
    """A design made once by the command: its folder, and what the command said."""
    import contextlib
    import io

    from haptics.cli import main as cli

    folder = tmp_path_factory.mktemp("garment") / "sleeve"
    out, words = io.StringIO(), ["haptics", "garment", "design", *SLEEVE, "--coverage", "0.85", "--out", str(folder), "--json"]
    before, sys.argv = sys.argv, words
    try:
        with contextlib.redirect_stdout(out), pytest.raises(SystemExit) as stop:
            cli.main()
        assert stop.value.code in (0, None)
    finally:
        sys.argv = before
    return folder, json.loads(out.getvalue())


class TestDesign:
    def test_says_what_the_contract_names(self, designed):
        folder, data = designed
        assert {"vertices", "steps", "converged_steps", "solver", "density_increase", "density_increase_eq65"} <= data.keys()
        assert data["vertices"] == 467
        assert data["steps"] == data["converged_steps"] >= 11 + 10  # down to 85 % by 1.5 % each, then two spans of five
        assert data["solver"] in installed_solvers()
        assert abs(data["coverage"] - 0.85) <= 0.003
        assert 0 < data["seconds_per_step"]["median"] <= data["seconds_per_step"]["p95"]
        assert data["largest_residual_n"] <= 1e-7
        assert data["energy_j"] > 0
        assert data["faults"] == data["notes"] == []
        assert data["density_increase"] > max(1.0, data["line"]["density"], data["x"]["density"])
        assert {Path(file).name for file in data["files"]} == {path.name for path in folder.iterdir()} == FILES

    def test_writes_what_it_says(self, designed):
        folder, data = designed
        assert json.loads((folder / "design.json").read_text()) == data

    def test_density_and_baselines_are_the_same_ratio(self, designed):
        folder, data = designed
        kept = open_designs(folder)
        cloth, (number, step) = kept.worn.simulation, kept.step()
        assert number == data["final_step"]
        full = Densities.of(cloth.designable, cloth.areas_m2, solved(cloth, cloth.designable).element_energy_j)
        state = solved(cloth, step.design, kept.sequence.at_final.positions_m)
        by_area = state.element_energy_j[step.design].sum() / cloth.areas_m2[step.design].sum()
        # the same equilibria, to the tolerance of the force: 1e-7 N over centimetres
        assert by_area / full.reinforced_j_m2 == pytest.approx(data["density_increase"], rel=1e-6)
        assert state.energy_j / cloth.areas_m2[step.design].sum() / full.eq65_j_m2 == pytest.approx(
            data["density_increase_eq65"], rel=1e-6
        )
        assert data["energy_j"] == pytest.approx(state.energy_j, rel=1e-6)

    def test_baselines_have_the_designs_area_to_half_a_triangle(self, designed):
        folder, data = designed
        areas = open_designs(folder).worn.simulation.areas_m2
        for shape in ("line", "x"):
            assert abs(data[shape]["coverage"] - data["coverage"]) <= areas.max() / areas.sum()
            best = max(density for density in data[shape]["tried"].values() if density is not None)
            assert data[shape]["density"] == best

    def test_overwrites_nothing_unasked(self, designed, refused):
        folder, _ = designed
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        assert "--force" in refused("garment", "design", *SLEEVE, "--coverage", "0.85", "--out", folder)
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == before

    def test_an_interrupted_run_goes_on_to_the_same_bytes(self, designed, command, tmp_path, monkeypatch):
        whole, data = designed
        solve, calls = simulation.GarmentOnBody.solve, []

        def interrupted(self, design, start=None):
            calls.append(1)
            if len(calls) == BEFORE + 8:
                raise KeyboardInterrupt
            return solve(self, design, start)

        words = ("garment", "design", *SLEEVE, "--coverage", "0.85", "--out", tmp_path / "d")
        with monkeypatch.context() as patched:
            patched.setattr(simulation.GarmentOnBody, "solve", interrupted)
            code, _, _ = command(*words)
        assert code == 130
        assert [path.name for path in (tmp_path / "d").iterdir()] == ["designs.h5"]
        assert len(read_designs(tmp_path / "d" / "designs.h5")[1].steps) == 7
        code, out, _ = command(*words, "--resume", "--json")
        assert code == 0
        assert (tmp_path / "d" / "designs.h5").read_bytes() == (whole / "designs.h5").read_bytes()
        for name in ("sequence.png", "density.png", "garment.png"):
            assert (tmp_path / "d" / name).read_bytes() == (whole / name).read_bytes()
        again = json.loads(out)
        assert again["steps"] == data["steps"]
        assert again["density_increase"] == data["density_increase"]

    def test_a_store_begun_with_other_settings_does_not_go_on_and_nothing_is_computed(self, designed, refused, monkeypatch):
        folder, _ = designed
        monkeypatch.delattr(simulation.GarmentOnBody, "solve")
        before = {path.name: path.read_bytes() for path in folder.iterdir()}
        words = ("garment", "design", *SLEEVE, "--out", folder, "--resume")
        assert "coverage was 0.85 and is now 0.6" in refused(*words, "--coverage", "0.6")
        assert "--angle-deg was 90.0 and is now 80.0" in refused(*words, "--coverage", "0.85", "--angle-deg", "80")
        assert "lame was 'plane' and is now 'thesis'" in refused(*words, "--coverage", "0.85", "--lame", "thesis")
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == before

    def test_a_step_without_equilibrium_is_a_failed_limit_and_keeps_what_there_is(self, designed, command, tmp_path, monkeypatch):
        solve, calls = simulation.GarmentOnBody.solve, []

        def failing(self, design, start=None):
            found = solve(self, design, start)
            calls.append(1)
            return replace(found, converged=False, residual_n=1.0) if len(calls) in (BEFORE + 5, BEFORE + 6) else found

        monkeypatch.setattr(simulation.GarmentOnBody, "solve", failing)
        code, out, _ = command("garment", "design", *SLEEVE, "--coverage", "0.85", "--out", tmp_path / "d", "--json")
        data = json.loads(out)
        assert code == 1
        assert (data["steps"], data["converged_steps"], data["complete"]) == (5, 4, False)
        assert "no equilibrium" in data["faults"][0]
        assert "coverage" in data["faults"][1]
        assert {path.name for path in (tmp_path / "d").iterdir()} == FILES

    def test_no_equilibrium_at_all_is_a_failed_limit(self, command, tmp_path, monkeypatch):
        solve = simulation.GarmentOnBody.solve
        fail = lambda self, design, start=None: replace(solve(self, design, start), converged=False, residual_n=1.0)  # noqa: E731
        monkeypatch.setattr(simulation.GarmentOnBody, "solve", fail)
        code, out, err = command("garment", "design", *SLEEVE, "--coverage", "0.85", "--out", tmp_path / "d")
        assert (code, out) == (1, "")
        assert "sleeve, elbow_flexion" in err

    def test_without_matplotlib_the_numbers_are_there_and_a_note(self, answer, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        data = answer("garment", "design", *SLEEVE, "--coverage", "1", "--out", tmp_path / "d")
        assert ".[report]" in data["notes"][0]
        assert {Path(file).name for file in data["files"]} == {"designs.h5", "design.json"}
        assert {path.name for path in (tmp_path / "d").iterdir()} == {"designs.h5", "design.json"}

    def test_the_folder_is_named_by_garment_motion_and_time(self, command, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        code, out, err = command("garment", "design", *SLEEVE, "--coverage", "1")
        assert (code, err) == (0, "")  # no progress where no person looks
        (folder,) = tmp_path.iterdir()
        assert folder.name.startswith("sleeve-elbow_flexion-2")
        assert "drawn line" in out
        assert "asked for 100 %" in out
        assert f"{folder.name}/designs.h5" in out

    def test_a_terminal_is_told_of_each_step(self, designed, command, monkeypatch, tmp_path):
        import io

        class Terminal(io.StringIO):
            def isatty(self) -> bool:
                return True

        seen = Terminal()
        monkeypatch.setattr(sys, "stderr", seen)
        monkeypatch.setenv("COLUMNS", "160")
        monkeypatch.setenv("TERM", "xterm-256color")
        from haptics.cli.garment import watched

        _, sequence = read_designs(designed[0] / "designs.h5")
        with watched(0.85, silent=False) as (progress, say):
            assert progress is not None
            assert say is not None
            progress(5, sequence.steps[5])
        for words in ("step 6 of about 21", "coverage 92.7 %", "density × ", "residual "):
            assert words in seen.getvalue()
        with watched(0.85, silent=True) as nothing:
            assert nothing == (None, None)

    @pytest.mark.parametrize(
        ("words", "why"),
        [
            (("--coverage", "0"), "allowed 0.01 to 1"),
            (("--coverage", "1.2"), "allowed 0.01 to 1"),
            (("--coverage", "nan"), "allowed 0.01 to 1"),
            (("--garment", "glove"), "allowed: sleeve, knee_sleeve"),
            (("--motion", "wave"), "allowed: elbow_flexion"),
            (("--motion", "lunge"), "no cloth is stretched; allowed: elbow_flexion, elbow_extension, slouch"),
            (("--angle-deg", "0"), "allowed 1 to 120 deg"),
            (("--angle-deg", "150"), "allowed 1 to 120 deg"),
            (("--level", "fine"), "allowed: coarse, draft"),
            (("--body", "star"), "allowed: capsule, anny"),
            (("--phenotype", "tall"), "NAME=NUMBER"),
            (("--phenotype", "height_m=9"), "allowed 1.4 to 2.1 m"),
            (("--phenotype", "girth=1", "--phenotype", "girth=1.1"), "once for each name"),
            (("--solver", "abacus"), "allowed: "),
            (("--lame", "both"), "allowed: plane, thesis"),
            (("--resume", "--force"), "pass --out DIR"),
        ],
    )
    def test_refuses(self, words, why, refused, tmp_path):
        given = ("garment", "design", *SLEEVE, "--coverage", "0.85", "--out", tmp_path / "d", *words)
        assert why in refused(*given)
        assert not list(tmp_path.iterdir())

    def test_refuses_to_resume_nowhere(self, refused):
        assert "--out DIR" in refused("garment", "design", *SLEEVE, "--coverage", "0.85", "--resume")


class TestOwnGarment:
    """A garment that a designer drew: a mesh around the straight body."""

    @pytest.fixture
    def drawn(self, tmp_path) -> Path:
        body = open_body("capsule")
        cut = cut_garment(body, "sleeve", "coarse")
        mesh = SurfaceMesh(cut.on(body.straight_m), cut.triangles)
        mesh = mesh.at(mesh.vertices_m + 0.003 * mesh.vertex_normals)
        write_obj(mesh, np.zeros(len(mesh.triangles), bool), tmp_path / "mine.obj")
        return tmp_path / "mine.obj"

    def test_is_designed_and_exported_and_must_stay_as_it_was(self, drawn, answer, refused, tmp_path):
        words = ("--garment", drawn, "--motion", "elbow_flexion", "--angle-deg", "90", "--coverage", "0.99")
        data = answer("garment", "design", *words, "--out", tmp_path / "d")
        assert (data["garment"], data["level"], data["vertices"]) == (str(drawn), "own", 467)
        assert data["steps"] == data["converged_steps"]
        cut = answer("garment", "export", tmp_path / "d", "--out", tmp_path / "cut")
        assert Path(cut["files"][0]).name == f"mine-{data['final_step']:03d}.svg"
        drawn.write_text(drawn.read_text() + "# changed\n")
        assert "mine.obj" in refused("garment", "export", tmp_path / "d", "--out", tmp_path / "again")
        assert "garment_sha256 was" in refused("garment", "design", *words, "--out", tmp_path / "d", "--resume")
        drawn.unlink()
        assert "mine.obj' is not a file" in refused("garment", "evaluate", tmp_path / "d")

    def test_a_bad_mesh_is_refused_with_the_place(self, drawn, refused, tmp_path):
        lines = drawn.read_text().splitlines()
        faces = [line for line in lines if line.startswith("f ")]
        a, b, _ = faces[0].split()[1:]
        drawn.write_text("\n".join([*lines, "v 0.5 0 1.2", "v 0.6 0 1.2", f"f {a} {b} 468", f"f {a} {b} 469"]))
        words = ("--garment", drawn, "--motion", "elbow_flexion", "--coverage", "0.97")
        error = refused("garment", "design", *words, "--out", tmp_path / "d")
        assert "mine.obj: edge " in error
        assert " m belongs to " in error
        assert "not manifold" in error
        assert not (tmp_path / "d").exists()

    def test_has_no_level(self, drawn, refused):
        words = ("--garment", drawn, "--motion", "elbow_flexion", "--coverage", "0.97", "--level", "draft")
        assert "--level = 'draft' is not allowed; allowed: own" in refused("garment", "design", *words)


class TestEvaluate:
    def test_energy_and_torque_by_angle_beside_a_drawn_line(self, designed, answer, tmp_path):
        folder, made = designed
        words = ("--steps", "3", "--against", "line", "--picture", tmp_path / "m.png", "--rrd", tmp_path / "m.rrd")
        data = answer("garment", "evaluate", folder, *words)
        assert (data["garment"], data["motion"], data["step"]) == ("sleeve", "elbow_flexion", made["final_step"])
        assert data["converged"]
        assert data["angles_deg"] == [0, 30, 60, 90]
        assert data["density_increase"] == pytest.approx(made["density_increase"], rel=0.01)  # equilibria depend on the path
        line = data["against"]
        assert line["density_increase"] == pytest.approx(made["line"]["density"], rel=0.01)
        assert line["coverage"] == pytest.approx(data["coverage"], abs=0.003)
        assert np.all(np.diff(data["energy_j"]) > 0)
        assert data["energy_j"][-1] > line["energy_j"][-1]
        assert {path.name for path in tmp_path.iterdir()} == {"m.png", "m.rrd"} == {Path(f).name for f in data["files"]}

    def test_torque_is_the_slope_of_what_is_stored(self, designed, answer):
        folder, _ = designed
        data = answer("garment", "evaluate", folder, "--steps", "10", "--angle-deg", "40")
        stored, angles = np.array(data["stored_j"]), np.radians(data["angles_deg"])
        torque = np.array(data["torque_n_m"])
        # Simpson's rule over pairs of 4 degree steps
        integral = (angles[1] - angles[0]) / 3 * (torque[:-2] + 4 * torque[1:-1] + torque[2:])
        assert integral == pytest.approx(stored[2:] - stored[:-2], rel=0.003)

    def test_another_motion(self, designed, answer):
        data = answer("garment", "evaluate", designed[0], "--motion", "elbow_extension", "--steps", "2")
        assert (data["motion"], data["angles_deg"]) == ("elbow_extension", [60, 30, 0])

    def test_one_step_of_the_sequence(self, designed, answer):
        folder, _ = designed
        by_number = answer("garment", "evaluate", folder, "--steps", "1", "--step", "10")
        by_coverage = answer("garment", "evaluate", folder, "--steps", "1", "--coverage", str(0.985**10))
        assert by_number["step"] == by_coverage["step"] == 10
        assert by_number["coverage"] == pytest.approx(0.985**10, abs=0.003)

    def test_a_mask_against_a_mask(self, designed, answer, tmp_path):
        _, data = designed
        half = np.zeros(data["triangles"], bool)
        half[: data["triangles"] // 2] = True
        np.savez(tmp_path / "half.npz", design=half)
        same = answer("garment", "evaluate", tmp_path / "half.npz", *SLEEVE, "--steps", "1", "--against", tmp_path / "half.npz")
        assert (same["name"], same["garment"]) == ("half.npz", "sleeve")
        assert 0 < same["density_increase"] < data["density_increase"]
        assert same["against"]["coverage"] == pytest.approx(same["coverage"], abs=0.006)  # a triangle of this coarse mesh

    def test_a_person_reads_a_table(self, designed, command, monkeypatch):
        monkeypatch.setenv("COLUMNS", "160")
        code, out, _ = command("garment", "evaluate", designed[0], "--steps", "2", "--against", "line")
        assert code == 0
        for words in ("torque", "line: energy", "reinforced part (5.6)", "45"):
            assert words in out

    def test_an_angle_without_equilibrium_is_a_failed_limit(self, designed, command, monkeypatch):
        solve, calls = simulation.GarmentOnBody.solve, []

        def failing(self, design, start=None):
            calls.append(1)
            found = solve(self, design, start)
            return replace(found, converged=False, residual_n=0.5) if len(calls) == 4 else found

        monkeypatch.setattr(simulation.GarmentOnBody, "solve", failing)
        code, out, _ = command("garment", "evaluate", designed[0], "--steps", "2")
        assert code == 1
        assert "45 deg: no equilibrium, 0.5 N" in out

    @pytest.mark.parametrize(
        ("words", "why"),
        [
            (("--step", "999"), "allowed 0 to "),
            (("--step", "1", "--coverage", "0.9"), "only one of the two"),
            (("--coverage", "0.2"), "coverage = 0.2; allowed"),
            (("--motion", "crouch"), "no cloth is stretched"),
            (("--against", "circle"), "expected line, x, or a mask"),
            (("--against", "no.png"), "no such design"),
            (("--steps", "0"), "allowed 1 to 1000"),
            (("--garment", "sleeve"), "only with a mask"),
            (("--picture", "/nowhere/m.png"), "there is no folder"),
            (("--picture", "m.jpg"), "ending of picture m.jpg = '.jpg' is not allowed; allowed: .png"),
            (("--rrd", "m.txt"), "allowed: .rrd"),
        ],
    )
    def test_refuses(self, words, why, designed, refused):
        assert why in refused("garment", "evaluate", designed[0], *words)

    def test_refuses_what_is_no_design(self, refused, tmp_path):
        (tmp_path / "x.h5").write_bytes(b"no")
        assert "not a design sequence" in refused("garment", "evaluate", tmp_path / "x.h5")
        assert "no such file" in refused("garment", "evaluate", tmp_path)
        assert "--garment and --motion" in refused("garment", "evaluate", tmp_path / "m.png")
        assert "no such design" in refused("garment", "evaluate", tmp_path / "m.png", *SLEEVE)
        (tmp_path / "m.txt").write_text("0")
        assert "step = 2" in refused("garment", "evaluate", tmp_path / "m.txt", *SLEEVE, "--step", "2")


class TestExport:
    def test_writes_pattern_and_meshes_with_their_areas(self, designed, answer, tmp_path):
        folder, made = designed
        data = answer("garment", "export", folder, "--out", tmp_path / "cut", "--seam-allowance-mm", "5")
        stem = f"sleeve-{made['final_step']:03d}"
        assert {path.name for path in (tmp_path / "cut").iterdir()} == {
            f"{stem}{s}" for s in (".svg", ".dxf", ".obj", ".mtl", ".ply")
        }
        assert {Path(file).name for file in data["files"]} == {path.name for path in (tmp_path / "cut").iterdir()}
        cloth = open_designs(folder).worn.simulation
        assert sum(piece["area_cm2"] for piece in data["pieces"]) == pytest.approx(1e4 * cloth.areas_m2.sum())
        assert data["reinforced_cm2"] == pytest.approx(1e4 * made["coverage"] * cloth.areas_m2.sum())
        assert data["cut_cm2"] == pytest.approx(data["reinforced_cm2"] * data["flat_area_ratio"], rel=0.01)
        assert all(0 <= piece["distortion_rms"] < 0.1 for piece in data["pieces"])
        assert all(seam["length_cm"] > 10 for seam in data["seams"])

    def test_a_person_reads_pieces_and_seams(self, designed, command, tmp_path):
        code, out, _ = command("garment", "export", designed[0], "--out", tmp_path / "cut", "--coverage", "0.9")
        assert code == 0
        for words in ("cloth", "on the pieces, cm", "to cut, cm²", "sleeve-007.svg"):
            assert words in out

    def test_overwrites_nothing_unasked(self, designed, answer, refused, tmp_path):
        (tmp_path / "sleeve-003.ply").write_text("mine")
        words = ("garment", "export", designed[0], "--step", "3", "--out", tmp_path)
        assert "--force" in refused(*words)
        assert [path.name for path in tmp_path.iterdir()] == ["sleeve-003.ply"]
        answer(*words, "--force")

    def test_without_libigl_it_says_what_to_install(self, designed, refused, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "igl", None)
        assert ".[garment]" in refused("garment", "export", designed[0], "--out", tmp_path / "cut")

    def test_refuses_a_sheet_too_small(self, designed, refused, tmp_path):
        words = ("garment", "export", designed[0], "--out", tmp_path, "--sheet-width-mm", "200", "--sheet-length-mm", "200")
        assert "allowed on this sheet" in refused(*words)
        assert not list(tmp_path.iterdir())


class TestBodies:
    def test_lists_what_there_is(self, answer):
        data = answer("garment", "bodies")
        assert [body["name"] for body in data["bodies"]] == ["capsule", "anny"]
        assert {garment["name"] for garment in data["garments"]} == {"sleeve", "knee_sleeve", "shirt", "long_shirt", "shorts"}
        assert len(data["motions"]) == 10
        assert [level["name"] for level in data["levels"]] == ["coarse", "draft", "standard", "reference"]
        assert {m["provenance"] for m in data["materials"]} == {"stated", "assumed"}
        assert [s["name"] for s in data["solvers"] if s["installed"]] == installed_solvers()
        assert all(solver["licence"] for solver in data["solvers"])

    def test_says_how_to_get_a_body_that_is_missing(self, answer, command, monkeypatch):
        monkeypatch.setattr(catalogue, "find_spec", lambda name: None)
        capsule, anny = answer("garment", "bodies")["bodies"]
        assert capsule["installed"]
        assert not anny["installed"]
        assert ".[body]" in anny["get"]

    def test_a_person_reads_tables(self, command):
        code, out, _ = command("garment", "bodies")
        assert code == 0
        for words in ("slouch", "GPL-3.0", "height_m", "N/m3", "5.6.1"):
            assert words in out


class TestPatch:
    def test_a_strip_pulls_as_an_independent_solution_says(self, answer):
        data = answer("garment", "patch", "--design", "strip", "--coverage", "0.4")
        assert data["force_n"] == pytest.approx(8.32, rel=0.005)
        assert data["elements"] > 1000
        assert data["coverage"] == pytest.approx(0.4)

    def test_the_thesis_constants_are_stiffer(self, answer):
        plane, thesis = (
            answer("garment", "patch", "--design", "full", "--lame", lame)["force_n"] for lame in ("plane", "thesis")
        )
        assert 1.1 < thesis / plane < 1.16

    @pytest.mark.parametrize(
        ("words", "why"),
        [
            (("--design", "spiral"), "allowed: none, full, strip, line, x"),
            (("--design", "strip", "--coverage", "1.1"), "allowed 0 to 1"),
            (("--design", "strip", "--strain", "-0.1"), "allowed 0 to 2"),
            (("--design", "strip", "--angle-deg", "200"), "allowed -90 to 90"),
        ],
    )
    def test_refuses(self, words, why, refused):
        assert why in refused("garment", "patch", *words)


def test_help_names_every_command_with_its_units(command):
    _, out, _ = command("garment", "-h")
    for name in ("design", "evaluate", "export", "bodies", "patch", "report"):
        assert name in out


def test_the_command_line_starts_without_what_garments_need():
    import subprocess

    code = (
        "import sys, haptics.cli.main; "
        "print([m for m in ('numpy', 'numba', 'scipy', 'matplotlib', 'haptics.garments') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
