"""Lines of TOML files: those that people's editors show, whatever stands in comments, texts and tables within tables."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from haptics.toml_lines import lines_of

FILE = '''# rise_limit_k = 3, side = "left"
side = "right" # baud = 1
text = """
[[objects]]
baud = 2
"""
"quoted key" = 1
a.b.c = 3

[tactiles]
sites = [
  "thumb_tip", # the first
  "index_tip",
]
matrix = [[1, 2],
  [3, 4]]
[brake]
baud = 5

[tactiles.calibration.index_tip]
tau_s = 5
[ "brake" . calibration . 'thumb' ]
k = 'it # is'

[[objects]]
name = "one"
effects = [
  { kind = "grasp" },
  { kind = "contact", sites = [
    "elbow" ] },
]
[[objects]]
[[objects.effects]]
kind = "x"
[[objects.effects]]
kind = "y"
[objects.shape]
kind = "box"
'''
PLACES = {
    ("side",): 2,
    ("text",): 3,
    ("quoted key",): 7,
    ("a", "b", "c"): 8,
    ("tactiles",): 10,
    ("tactiles", "sites"): 11,
    ("tactiles", "sites", 0): 12,
    ("tactiles", "sites", 1): 13,
    ("tactiles", "matrix", 0, 1): 15,
    ("tactiles", "matrix", 1): 16,
    ("brake", "baud"): 18,
    ("tactiles", "calibration", "index_tip", "tau_s"): 21,
    ("brake", "calibration", "thumb", "k"): 23,
    ("objects", 0): 25,
    ("objects", 0, "effects", 0, "kind"): 28,
    ("objects", 0, "effects", 1): 29,
    ("objects", 0, "effects", 1, "sites", 0): 30,
    ("objects", 1): 32,
    ("objects", 1, "effects", 0, "kind"): 34,
    ("objects", 1, "effects", 1, "kind"): 36,
    ("objects", 1, "shape", "kind"): 38,
}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_every_part_is_where_it_is(end):
    text = FILE.replace("\n", end)
    tomllib.loads(text)
    found = lines_of(text)
    assert {place: found.get(place) for place in PLACES} == PLACES


def test_a_separator_that_is_no_line_end_in_toml_ends_no_line():
    assert lines_of("# one\u2028two\u0085three\na = 1\n")[("a",)] == 2


def paths(value, path=()):
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield (*path, key)
        yield from paths(inner, (*path, key))


@pytest.mark.parametrize("file", sorted(Path(__file__).parents[2].glob("**/data/*.toml")), ids=lambda file: file.name)
def test_every_part_of_the_files_that_ship_has_its_line(file):
    text = file.read_text("utf-8")
    assert set(lines_of(text)) == set(paths(tomllib.loads(text)))
