"""The package's face: what its first page shows, run as it stands there."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import pytest

import haptics.garments as garments


def test_every_name_of_the_face_is_there():
    for name in garments.__all__:
        assert getattr(garments, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        garments.nothing  # noqa: B018


@pytest.mark.slow
def test_the_first_page_runs(monkeypatch):
    """At the coarsest level, a high coverage and few angles, which is quick; else word for word."""
    lines = [line for line in garments.__doc__.splitlines() if line.startswith("    ")]
    source = (
        textwrap.dedent("\n".join(lines))
        .replace('"sleeve")', '"sleeve", "coarse")', 1)
        .replace("0.15", "0.97")
        .replace(", 12)", ", 3)")
    )
    names = {name: getattr(garments, name) for name in garments.__all__}
    exec(source, names)
    assert names["designs"].final.coverage == pytest.approx(0.97, abs=0.003)
    assert names["over_the_motion"].converged
    assert names["pattern"].panels


def test_importing_it_imports_nothing_heavy():
    code = (
        "import sys, haptics.garments; print([m for m in ('scipy', 'numba', 'igl', 'torch', 'matplotlib') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
