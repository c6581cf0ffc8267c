"""Table 5.1 beside our own designs: rows that go on where they broke off, and a page on which nothing is cut off."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace

import pytest
from quick_garments import quick_garments

from haptics.cli import main as cli
from haptics.errors import InputError
from haptics.garments.design_run import FILES
from haptics.garments.equilibrium import simulation
from rigs.garments import table
from rigs.garments.report import page_of, warnings_of, write_report
from rigs.garments.table import CASES, TableOptions, make_rows
from rigs.reference import curve

# coarse meshes and much reinforcement: a few seconds
QUICK = TableOptions(level="coarse", motions=("elbow_flexion", "elbow_extension"), coverage=0.96)


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _quick():
    with quick_garments():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("table")


@pytest.fixture(scope="module")
def rows(folder):
    return make_rows(QUICK, folder)


@pytest.fixture(scope="module")
def page(rows, folder):
    return write_report(rows, QUICK, folder / "table.html")


def test_the_cases_are_the_published_rows():
    for name in ("table51_vertices", "table51_steps", "table51_time", "table51_density"):
        assert [point.label for point in curve(name).points] == [case.label for case in CASES]
    assert {case.motion: case.coverage for case in CASES if case.coverage != 0.15} == {"knee_flexion": 0.10, "slouch": 0.10}


def test_published_numbers_and_ours_are_on_the_page(page, rows):
    text = page.read_text(encoding="utf-8")
    for row, published in zip(rows, ("1.97", "2.26"), strict=True):
        assert row.sound
        (cells,) = (
            re.findall(r"<td[^>]*>([^<]*)</td>", line)
            for line in text.splitlines()
            if f"<td>{row.case.written}</td>" in line and "°" in line and "%" in line
        )
        assert cells[3] == published
        assert cells[4] == f"{row.data['density_increase']:.2f}"
        assert cells[6:] == [f"{row.data[shape]['density']:.2f}" for shape in ("line", "x")]
    assert "7100" in text
    assert "10.65" in text
    assert "SMPL" in text


def test_pictures_are_in_the_file_and_nothing_is_fetched(page):
    text = page.read_text(encoding="utf-8")
    assert text.count('src="data:image/png;base64,') == 3 * 2
    assert not re.search(r'(src|href)="(?!data:|#)|https?://|@import|url\(', text)


@pytest.mark.parametrize("width", [1280, 480])
def test_nothing_is_cut_off_in_a_browser(browser, page, width):
    looked = browser.look(page, width, height=3500)
    assert not looked.seen["wide"]
    pixels = looked.pixels
    ink = (pixels < 245).any(axis=2).any(axis=0)
    assert not ink[:4].any()  # a margin is left at both sides
    assert not ink[-4:].any()
    blue = (pixels[..., 2].astype(int) - pixels[..., 0] > 60).sum()
    assert blue > 1000  # reinforcement in the pictures


def test_finished_rows_are_read_and_not_made_again(rows, folder, monkeypatch):
    monkeypatch.setattr(table, "run_design", lambda *args, **more: pytest.fail("made again"))
    assert [row.data for row in make_rows(QUICK, folder)] == [row.data for row in rows]


@pytest.mark.parametrize("other", [{"coverage": 0.9}, {"phenotype": {"girth": 1.1}}, {"level": "draft"}])
def test_a_row_of_other_settings_is_no_such_row(other, rows, folder):
    with pytest.raises(InputError, match="begun with other settings"):
        make_rows(replace(QUICK, motions=("elbow_flexion",), **other), folder)
    assert all((rows[0].folder / name).is_file() for name in FILES)


def test_a_begun_row_goes_on(rows, tmp_path, monkeypatch):
    options = replace(QUICK, motions=("elbow_flexion",))
    solve, calls = simulation.GarmentOnBody.solve, []

    def interrupted(self, design, start=None):
        calls.append(1)
        if len(calls) == 1 + 4:  # after the full garment; line and X are those found for ``rows``
            raise KeyboardInterrupt
        return solve(self, design, start)

    with monkeypatch.context() as patched:
        patched.setattr(simulation.GarmentOnBody, "solve", interrupted)
        with pytest.raises(KeyboardInterrupt):
            make_rows(options, tmp_path)
    made = []
    (row,) = make_rows(options, tmp_path, progress=lambda number, step: made.append(number))
    assert made[0] == 3  # steps 0 to 2 were kept
    assert row.data["density_increase"] == rows[0].data["density_increase"]


def test_a_row_without_equilibrium_is_on_the_page_with_its_reason(tmp_path, monkeypatch):
    solve = simulation.GarmentOnBody.solve
    monkeypatch.setattr(
        simulation.GarmentOnBody, "solve", lambda self, design, start=None: replace(solve(self, design, start), converged=False)
    )
    options = replace(QUICK, motions=("elbow_flexion",))
    rows = make_rows(options, tmp_path)
    assert not rows[0].sound
    assert "no equilibrium" in warnings_of(rows)[0]
    assert "Arm Flexion" in write_report(rows, options, tmp_path / "t.html").read_text(encoding="utf-8")


def test_a_design_that_a_drawn_one_beats_is_said_aloud(rows):
    data = dict(rows[0].data) | {"x": {"density": 99.0}}
    beaten = replace(rows[0], data=data)
    assert warnings_of([beaten]) == ["Arm Flexion: a drawn design stores more for its area"]
    assert "0 of 1 store more" in page_of([beaten], QUICK).summary


def test_the_page_is_not_overwritten_unasked(rows, page):
    before = page.read_bytes()
    with pytest.raises(InputError, match="--force"):
        write_report(rows, QUICK, page)
    write_report(rows, QUICK, page, force=True)
    assert page.read_bytes() == before  # the same rows give the same page


def test_no_such_row():
    with pytest.raises(InputError, match=r"arms_raise.*allowed: elbow_flexion, elbow_extension, knee_flexion"):
        TableOptions(motions=("arms_raise",))


def test_the_command_says_what_is_on_the_page(rows, folder, capsys, monkeypatch):
    words = ["haptics", "garment", "report", "--level", "coarse", "--motion", "elbow_flexion", "--coverage", "0.96"]
    monkeypatch.setattr(sys, "argv", [*words, "--folder", str(folder), "--out", str(folder / "two.html"), "--json"])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code in (0, None)
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["case"] == "arm_flexion"
    assert row["design"]["density_increase"] == rows[0].data["density_increase"]
    monkeypatch.setattr(sys, "argv", [*words, "--folder", str(folder), "--out", str(folder / "three.html")])
    with pytest.raises(SystemExit):
        cli.main()
    assert "1.97" in capsys.readouterr().out
