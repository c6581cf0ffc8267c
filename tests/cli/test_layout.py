"""What people read: units with prefixes, and no number or name cut, however narrow the terminal."""

from __future__ import annotations

import pytest

from haptics.cli.layout import layout, quantity
from haptics.units import engineering

REPORTS = (
    ("scenes",),
    ("ports",),
    ("predict", "brake", "--volts", "1000"),
    ("predict", "thermal", "--rate-per-min", "60"),
    ("predict", "laws"),
    ("fidelity", "plan", "playground"),
    ("garment", "bodies"),
)


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (1000.0, "V", "1.0 kV"),
        (999.96, "V", "1.0 kV"),
        (-1500.0, "V", "-1.5 kV"),
        (2.547e-9, "F", "2.547 nF"),
        (0.02, "s", "20 ms"),
        (3600.0, "s", "3600 s"),
        (0.486, "K", "0.486 K"),
        (20.0, "%", "20 %"),
        (0.0, "V", "0 V"),
        (1.0, "", "1.0"),
        (123456.0, "", "123456"),
        (1e12, "", "1e12"),
        (5e-20, "J", "5e-8 pJ"),
        (float("nan"), "V", "-"),
    ],
)
def test_quantities_are_written_as_engineers_do(value, unit, shown):
    assert engineering(value, unit) == shown


def test_a_unit_moves_from_the_name_to_the_value():
    assert quantity("energy_j", 0.000012) == ("energy", "12 µJ")
    assert quantity("volts", 1500) == ("volts", "1.5 kV")
    assert quantity("is_s", "text") == ("is_s", "text")
    assert quantity("first_denied_s", None) == ("first_denied", "-")
    assert quantity("valid", True) == ("valid", "yes")


@pytest.mark.parametrize("words", REPORTS, ids=" ".join)
def test_no_word_is_cut_at_forty_columns(words, command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    wide = command(*words)[1]
    monkeypatch.setenv("COLUMNS", "40")
    narrow = command(*words)[1]
    assert "…" not in narrow
    drawn = set("┏┳┓┃┡╇┩│└┴┘━─")
    whole = {word.strip(":") for word in narrow.split()}
    assert {word.strip(":") for word in wide.split() if not set(word) & drawn} <= whole


@pytest.mark.parametrize("words", [("run",), ("garment", "evaluate"), ("characterize",)], ids=" ".join)
def test_help_cuts_no_option_at_forty_columns(words, command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    options = {word for word in command(*words, "--help")[1].split() if word.startswith("--")}
    monkeypatch.setenv("COLUMNS", "40")
    narrow = command(*words, "--help")[1]
    assert len(options) > 8
    assert options <= set(narrow.split())
    assert "…" not in narrow


def test_what_fits_is_a_table_and_what_does_not_is_lines():
    from rich.table import Table

    rows = [("a" * 18, 1000.0), ("b" * 18, 0.5)]
    assert isinstance(layout("t", ("name", "peak, V"), rows, 40), Table)
    assert str(layout("t", ("name", "other", "peak, V"), [(*row, 1.0) for row in rows], 24)).splitlines()[:4] == [
        "t",
        f"name: {'a' * 18}",
        "  other: 1000",
        "  peak: 1.0 V",
    ]
