"""The pattern's sheets and files: what is on them, how panels are placed, the same bytes each time, nothing overwritten."""

import xml.etree.ElementTree as ET

import ezdxf
import numpy as np
import pytest
import shapely
from analytic_garments import nothing, three_openings, tube

from haptics.errors import InputError
from haptics.garments.pattern import PatternOptions, make_pattern, write_pattern
from haptics.garments.pattern.sheet import CLOTH, LAYERS, MARKS, REINFORCEMENT, SEAMS, lay_out

LABELS = {"motion": "elbow_flexion", "body": "capsule", "coverage": "15.0 %"}


def design(garment):
    return (np.hypot(garment.centres_m[:, 0], garment.centres_m[:, 2] - 0.1) < 0.03) & (garment.centres_m[:, 1] < 0)


def make(garment=None, **options):
    garment = tube() if garment is None else garment
    return make_pattern(garment, design(garment), "sleeve", LABELS, PatternOptions(**options))


def polygons(sheet, layer):
    return [shapely.Polygon(shape.lines[0], shape.lines[1:]) for shape in sheet.shapes if shape.layer == layer]


def test_panels_lie_on_the_sheet_apart_from_each_other_and_below_the_title():
    pattern = make(three_openings(), sheet_width_m=0.9, seam_allowance_m=0.008)
    (sheet,) = lay_out(pattern)
    cloths = polygons(sheet, CLOTH)
    assert len(cloths) == len(pattern.panels) > 1
    for i, one in enumerate(cloths):
        left, bottom, right, top = one.bounds
        assert left >= 15 - 1e-9
        assert bottom >= 15 - 1e-9
        assert right <= 900 - 15 + 1e-9
        assert top < min(text.y_mm for text in sheet.texts if text.text.startswith("garment"))
        assert all(one.distance(other) >= 15 - 1e-9 for other in cloths[:i])
    for polygon in polygons(sheet, REINFORCEMENT):
        assert any(cloth.covers(polygon) for cloth in cloths)


def test_what_does_not_fit_one_sheet_goes_on_the_next(tmp_path):
    garment = three_openings()
    pattern = make(garment, sheet_width_m=0.6, sheet_length_m=0.5)
    sheets = lay_out(pattern)
    assert len(sheets) > 1
    assert sum(len(polygons(sheet, CLOTH)) for sheet in sheets) == len(pattern.panels)
    assert max(sheet.height_mm for sheet in sheets) <= 500
    names = [path.name for path in write_pattern(pattern, tmp_path, "shorts")]
    assert names[:4] == ["shorts.svg", "shorts.dxf", "shorts-2.svg", "shorts-2.dxf"]


def test_a_panel_too_wide_is_turned_and_one_too_large_is_refused_with_its_size():
    # The tube unrolls to 314 x 400 mm.
    (turned,) = lay_out(make(sheet_width_m=0.6, sheet_length_m=0.42))
    left, bottom, right, top = polygons(turned, CLOTH)[0].bounds
    assert right - left == pytest.approx(400, abs=2)
    assert top - bottom == pytest.approx(314, abs=2)
    with pytest.raises(InputError, match=r"panel A is 31\d x 40\d mm; allowed on this sheet: 275 x \d+ mm within the margins"):
        lay_out(make(sheet_width_m=0.305))


def test_up_on_the_garment_is_up_on_the_sheet_and_right_is_right_seen_from_outside():
    garment = tube()
    # A mark near the top and, seen from the front (where the wearer's left, +x, is on the right), to the right.
    marked = (garment.centres_m[:, 2] > 0.34) & (
        np.abs(np.arctan2(garment.centres_m[:, 0], -garment.centres_m[:, 1]) - 0.8) < 0.3
    )
    for mirrored in (False, True):
        (sheet,) = lay_out(make_pattern(garment, marked, "sleeve", options=PatternOptions(mirrored=mirrored)))
        (mark,), (cloth,) = polygons(sheet, REINFORCEMENT), polygons(sheet, CLOTH)
        assert mark.centroid.y > cloth.centroid.y + 130
        assert (mark.centroid.x > cloth.centroid.x + 20) != mirrored
        (heading,) = [text.text for text in sheet.texts if "seen from" in text.text]
        assert ("mirrored" in heading) == mirrored
        arrow_up = next(text for text in sheet.texts if text.text == "up")
        arrow_down = next(text for text in sheet.texts if text.text == "down")
        assert arrow_up.y_mm > arrow_down.y_mm


def test_a_tubes_axis_is_upright_on_the_sheet_however_it_hangs():
    turn = np.deg2rad(40.0)
    hanging = tube().vertices_m @ np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    (sheet,) = lay_out(make(tube().at(hanging)))
    left, bottom, right, top = polygons(sheet, CLOTH)[0].bounds
    assert top - bottom == pytest.approx(400, abs=3)
    assert right - left == pytest.approx(314, abs=3)
    (sheet,) = lay_out(make(tube().at(hanging), up=(1.0, 0.0, 0.0)))
    assert polygons(sheet, CLOTH)[0].bounds[3] - polygons(sheet, CLOTH)[0].bounds[1] == pytest.approx(400, abs=3)


def test_labels_notches_and_scale_bar_are_on_the_sheet():
    pattern = make(up_label="shoulder", down_label="wrist")
    (sheet,) = lay_out(pattern)
    texts = [text.text for text in sheet.texts]
    title = "  |  ".join(texts)
    for label in ("garment: sleeve", "motion: elbow_flexion", "body: capsule", "coverage: 15.0 %", "100 mm"):
        assert label in title
    assert {"shoulder", "wrist", "A  sleeve"} <= set(texts)
    # Each notch is on both sides of its seam, under the same number.
    for i in range(len(pattern.seams[0].notches_m)):
        assert texts.count(f"1.{i + 1}") == 2
    seams = shapely.union_all([shapely.LineString(shape.lines[0]) for shape in sheet.shapes if shape.layer == SEAMS])
    cloth = polygons(sheet, CLOTH)[0]
    ticks = [shapely.LineString(s.lines[0]) for s in sheet.shapes if s.layer == MARKS and not s.closed]
    ticks = [tick for tick in ticks if tick.distance(seams) < 1e-6]
    assert len(ticks) == 2 * len(pattern.seams[0].notches_m)
    assert all(cloth.buffer(1e-6).covers(tick) and tick.length == pytest.approx(4.0) for tick in ticks)


def test_both_files_hold_the_same_layers_and_lines(tmp_path):
    pattern = make()
    svg, dxf = write_pattern(pattern, tmp_path, "sleeve")
    space = "{http://www.w3.org/2000/svg}"
    root = ET.parse(svg).getroot()
    groups = {group.get("id"): group for group in root.iter(f"{space}g")}
    assert tuple(groups) == LAYERS
    document = ezdxf.readfile(dxf)
    height = float(root.get("viewBox", "").split()[3])
    for layer in LAYERS[:-1]:
        drawn = [line for path in groups[layer] for line in path.get("d", "").split("M ")[1:]]
        lines = list(document.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]'))
        assert len(drawn) == len(lines)
        for text, line in zip(drawn, lines, strict=True):
            points = np.array([[float(v) for v in pair.split(",")] for pair in text.replace("Z", "").split()])
            np.testing.assert_allclose(points * [1, -1] + [0, height], np.array(line.get_points("xy")), atol=2e-4)
            assert text.strip().endswith("Z") == line.closed
    assert [t.text for t in groups["text"]] == [t.dxf.text for t in document.modelspace().query("TEXT")]


def test_the_same_pattern_gives_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_pattern(make(), tmp_path / name, "sleeve")
    for suffix in ("svg", "dxf"):
        assert (tmp_path / "one" / f"sleeve.{suffix}").read_bytes() == (tmp_path / "two" / f"sleeve.{suffix}").read_bytes()
    assert not ezdxf.options.write_fixed_meta_data_for_testing


def test_nothing_is_overwritten_unless_forced(tmp_path):
    pattern = make()
    (tmp_path / "sleeve.dxf").write_text("mine")
    with pytest.raises(InputError, match=r"sleeve\.dxf exists and is not overwritten"):
        write_pattern(pattern, tmp_path, "sleeve")
    assert [path.name for path in tmp_path.iterdir()] == ["sleeve.dxf"]
    assert (tmp_path / "sleeve.dxf").read_text() == "mine"
    assert len(write_pattern(pattern, tmp_path, "sleeve", force=True)) == 2
    with pytest.raises(InputError, match="there is no folder"):
        write_pattern(pattern, tmp_path / "missing", "sleeve")
    with pytest.raises(InputError, match="expected a name without folders"):
        write_pattern(pattern, tmp_path, "../sleeve")


def test_options_and_designs_out_of_range_are_refused():
    with pytest.raises(InputError, match="sheet_width_m = 0 m; allowed"):
        PatternOptions(sheet_width_m=0)
    with pytest.raises(InputError, match=r"front = .* expected three finite numbers, not all 0"):
        PatternOptions(front=(0.0, 0.0, 0.0))
    garment = tube()
    with pytest.raises(InputError, match=r"design is bool of shape \(3,\)"):
        make_pattern(garment, np.zeros(3, bool), "sleeve")
    with pytest.raises(InputError, match="label 'two\\\\nlines' cannot be printed"):
        make_pattern(garment, nothing(garment), "sleeve", {"body": "two\nlines"})
