"""What comes out of the printer: areas and lengths in the files, read by other programs, against the garment in space."""

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from io import BytesIO

import ezdxf
import numpy as np
import pytest
from analytic_garments import three_openings, tube
from PIL import Image

from haptics.garments.pattern import PatternOptions, make_pattern, write_pattern

pytestmark = pytest.mark.slow

SPACE = "{http://www.w3.org/2000/svg}"
MM2_PER_M2, MM_PER_M = 1e6, 1e3
AREA_AGREES = 5e-3
"""0.5 %: the smoothed outlines keep the area to 0.1 %; numbers in the files have 0.1 um."""


def band_and_ring(garment):
    x, y, z = (garment.centres_m - garment.centres_m.mean(axis=0)).T
    ring = np.hypot(x, z)
    return (np.abs(z + 0.5 * x) < 0.015) | ((ring > 0.03) & (ring < 0.045) & (y < 0))


GARMENTS = {"cylinder": tube(24, 26), "barrel": tube(24, 26, bulge=0.02), "shorts": three_openings()}


@pytest.fixture(scope="module", params=list(GARMENTS))
def case(request, tmp_path_factory):
    garment = GARMENTS[request.param]
    design = band_and_ring(garment)
    options = PatternOptions(sheet_width_m=1.0, sheet_length_m=1.5)
    pattern = make_pattern(garment, design, request.param, {"body": "analytic"}, options)
    svg, dxf = write_pattern(pattern, tmp_path_factory.mktemp("sheets"), request.param)
    return garment, design, pattern, svg, dxf


def ring_area(points):
    x, y = np.asarray(points).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def svg_lines(root, layer):
    """Lines of a layer in mm, as the page shows them: the viewBox scaled to the page's size."""
    size = [float(re.fullmatch(r"([0-9.]+)mm", root.get(side)).group(1)) for side in ("width", "height")]
    box = [float(value) for value in root.get("viewBox").split()]
    scale = np.array(size) / box[2:]
    (group,) = [group for group in root.iter(f"{SPACE}g") if group.get("id") == layer]
    numbers = re.compile(r"-?[0-9.]+")
    lines = [line for path in group for line in path.get("d").split("M")[1:]]
    return [np.array([float(n) for n in numbers.findall(line)]).reshape(-1, 2) * scale for line in lines]


def dxf_lines(document, layer):
    assert document.header["$INSUNITS"] == 4  # millimetres
    return [np.array(line.get_points("xy")) for line in document.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]')]


@pytest.fixture(scope="module", params=["svg", "dxf"])
def lines(request, case):
    """What an independent reader finds in a file: layer to lines, in mm."""
    if request.param == "svg":
        root = ET.parse(case[3]).getroot()
        return lambda layer: svg_lines(root, layer)
    document = ezdxf.readfile(case[4])
    return lambda layer: dxf_lines(document, layer)


def test_the_reinforcement_to_cut_has_the_area_it_has_on_the_body(case, lines):
    garment, design, pattern, _, _ = case
    # Outer rings and holes run opposite ways: their signed areas add up.
    cut_m2 = abs(sum(ring_area(line) for line in lines("cut-reinforcement"))) / MM2_PER_M2
    on_body_m2 = garment.areas_m2[design].sum()
    assert cut_m2 == pytest.approx(on_body_m2 * pattern.flat_area_ratio, rel=AREA_AGREES)
    # And the ratio is one of flattening, not a fudge: no more than the area distortion that is reported.
    worst = max(panel.flat.distortion.largest_area for panel in pattern.panels)
    assert abs(pattern.flat_area_ratio - 1) <= worst


def test_the_cloth_to_cut_has_the_garments_area(case, lines):
    garment, _, _, _, _ = case
    cloth_m2 = sum(abs(ring_area(line)) for line in lines("cloth")) / MM2_PER_M2
    assert cloth_m2 == pytest.approx(garment.areas_m2.sum(), rel=1e-5)


def test_seams_are_as_long_as_on_the_body_within_the_reported_distortion(case, lines):
    _, _, pattern, _, _ = case
    drawn = sorted(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() / MM_PER_M for line in lines("seams"))
    assert len(drawn) == 2 * len(pattern.seams)
    smallest = min(panel.flat.distortion.smallest_stretch for panel in pattern.panels)
    largest = max(panel.flat.distortion.largest_stretch for panel in pattern.panels)
    for length_m, on_body_m in zip(drawn, sorted(seam.length_m for seam in pattern.seams for _ in seam.sides), strict=True):
        assert smallest * on_body_m - 1e-6 <= length_m <= largest * on_body_m + 1e-6


def test_the_openings_are_as_long_as_on_the_body_within_the_reported_distortion(case, lines):
    garment, _, pattern, _, _ = case
    edges = garment.vertices_m[garment.boundary_edges]
    on_body_m = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).sum()
    around = sum(np.linalg.norm(line - np.roll(line, 1, axis=0), axis=1).sum() for line in lines("cloth")) / MM_PER_M
    seams = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines("seams")) / MM_PER_M
    smallest = min(panel.flat.distortion.smallest_stretch for panel in pattern.panels)
    largest = max(panel.flat.distortion.largest_stretch for panel in pattern.panels)
    # Without a seam allowance the cloth is cut along its seams and its openings.
    assert smallest * on_body_m - 1e-5 <= around - seams <= largest * on_body_m + 1e-5


def test_a_cad_program_finds_no_fault_in_the_dxf(case):
    document = ezdxf.readfile(case[4])
    audit = document.audit()
    assert not audit.has_errors
    assert not audit.has_fixes
    assert all(line.closed for line in document.modelspace().query('LWPOLYLINE[layer=="cut-reinforcement" | layer=="cloth"]'))


@pytest.fixture(scope="module")
def printed(case, tmp_path_factory):
    """The page as Chromium draws it, ``(rows, columns, 3)``, and its pixels per mm by the definition of a CSS pixel.

    One garment's page shows what is on each: a band, a ring with its hole, marks, text.
    """
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert chromium, "chromium is needed to judge the print scale"
    folder, svg = tmp_path_factory.mktemp("printed"), case[3]
    root = ET.parse(svg).getroot()
    width, height = (float(root.get(side)[:-2]) for side in ("width", "height"))
    css = 96 / 25.4
    shot = folder / "page.png"
    window = f"--window-size={int(width * css) + 20},{int(height * css) + 20}"
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={folder / 'profile'}"]
    command = [chromium, *flags, "--force-device-scale-factor=2", window, f"--screenshot={shot}", svg.as_uri()]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return np.asarray(Image.open(BytesIO(shot.read_bytes())).convert("RGB")).astype(np.int16), 2 * css


@pytest.mark.parametrize("case", ["cylinder"], indirect=True)
def test_a_browser_draws_the_scale_bar_100_mm_long(printed):
    pixels, per_mm = printed
    # The longest horizontal dark run in the heading, on the right, is the bar.
    dark = pixels[: int(45 * per_mm)].max(axis=2) < 140
    longest = 0
    for row in dark:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]])))
        longest = max([longest, *(edges[1::2] - edges[::2]).tolist()])
    assert longest / per_mm == pytest.approx(100.0, abs=0.4)  # the line's width and a pixel at each end


@pytest.mark.parametrize("case", ["cylinder"], indirect=True)
def test_a_browser_fills_the_area_of_the_reinforcement(case, printed):
    garment, design, pattern, _, _ = case
    pixels, per_mm = printed
    red, green, blue = np.moveaxis(pixels, 2, 0)
    filled = (np.abs(red - 0xC8) < 12) & (np.abs(green - 0xD8) < 12) & (np.abs(blue - 0xF0) < 12)
    # The outline, 0.25 mm wide, covers half its width of the fill; dashes, marks and notches cover a little more.
    outline_mm = sum(
        ring.length
        for panel in pattern.panels
        for polygon in panel.cut.polygons
        for ring in (polygon.exterior, *polygon.interiors)
    )
    stroke_mm2 = 0.125 * outline_mm * MM_PER_M
    expected = MM2_PER_M2 * garment.areas_m2[design].sum() * pattern.flat_area_ratio
    assert filled.sum() / per_mm**2 + stroke_mm2 == pytest.approx(expected, rel=0.015)
