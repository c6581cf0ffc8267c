"""The page of a characterisation as a person sees it, in a real browser."""

from __future__ import annotations

import re

import numpy as np
import pytest

from haptics.errors import InputError
from rigs.report import Block, Page, png_bytes, render_page, svg_text
from rigs.report.page import Table
from rigs.result import Plot, series

X = np.linspace(0.0, 10.0, 30)
PLOT = Plot(
    name="force-volts",
    title="Force against volts",
    x_label="amplitude (kV)",
    y_label="force (N)",
    series=(
        series("measured", "measured", X, X**2 + 1.0),
        series("fit", "fit", X, X**2),
        series("published ± 10 %", "published", X[::10], 0.9 * X[::10] ** 2, 0.1 * X[::10] ** 2),
    ),
    residuals=(series("measured less fit", "measured", X, np.ones(30)),),
    residual_label="residual (N)",
)
MEASURED_BLUE, FIT_ORANGE, PUBLISHED_GREEN = (0, 114, 178), (213, 94, 0), (0, 158, 115)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    table = Table("numbers", ("quantity", "value"), [("tau & <c>", 102.0), ("verdict", "differs")])
    blocks = [Block("Result", ["A sentence."], ["a <b>warning</b>"], [table]), Block("Curves", plots=[PLOT])]
    path.write_text(render_page(Page("A <title>", "Summary.", blocks, {"seed": 7})), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def looks(browser, page):
    return {width: browser.look(page, width, height=1600) for width in (1280, 480)}


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 480])
def test_axes_with_units_legends_and_residuals_are_readable(looks, width):
    seen = looks[width].seen
    (figure,) = seen["figures"]
    assert {"amplitude (kV)", "force (N)", "residual (N)", "measured", "fit", "published ± 10 %"} <= set(figure["words"])
    assert not figure["outside"]
    assert figure["width"] > 0.6 * width
    assert figure["smallest"] >= (9.0 if width == 1280 else 4.0)  # CSS pixels of the lowest text
    assert not seen["wide"]


@pytest.mark.slow
def test_points_fit_and_published_error_bars_are_on_the_screen(looks):
    for colour, least in ((MEASURED_BLUE, 100), (FIT_ORANGE, 200), (PUBLISHED_GREEN, 100)):
        assert looks[1280].count(*colour) > least, colour


def test_nothing_is_fetched_and_text_is_escaped(page):
    text = page.read_text(encoding="utf-8")
    body = re.sub(
        r'xmlns(:xlink)?="[^"]*"|<!DOCTYPE.*?>|https?://(www\.w3\.org|creativecommons\.org|purl\.org|matplotlib\.org)\S*',
        "",
        text,
    )
    assert not re.search(r'(src|href)="(?!#)|https?://|@import|url\((?!#)', body)
    assert "A &lt;title&gt;" in text
    assert "a &lt;b&gt;warning&lt;/b&gt;" in text
    assert "tau &amp; &lt;c&gt;" in text


@pytest.mark.slow
def test_the_same_plot_gives_the_same_bytes_and_two_on_a_page_share_no_identifier():
    assert svg_text(PLOT) == svg_text(PLOT)
    assert png_bytes(PLOT) == png_bytes(PLOT)
    other = svg_text(Plot("other", "t", "x (m)", "y (N)", PLOT.series))
    own = set(re.findall(r'clipPath id="([^"]*)"', svg_text(PLOT)))
    assert own
    assert not own & set(re.findall(r'clipPath id="([^"]*)"', other))


def test_an_environment_without_the_extra_is_told_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"\.\[report\]"):
        png_bytes(PLOT)
