"""The file of a design sequence: whole whenever it is read, continued to the same bytes, refused with other settings."""

from __future__ import annotations

import random
import subprocess
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from bar_panel import BarPanel

from haptics.errors import HapticsError, InputError
from haptics.garments.design.designs import DesignStore, read_designs
from haptics.garments.design.topology import BesoParameters, DesignInterrupted, optimise

COVERAGE = 0.3
SETTINGS = {"garment": "panel", "angle_deg": 90.0}


class Stopped(Exception):
    """The person pressed a key."""


def _panel(**options) -> BarPanel:
    return BarPanel(np.linspace(0.005, 0.02, 20), columns=15, **options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The file of an uninterrupted run."""
    path = tmp_path_factory.mktemp("whole") / "designs.h5"
    optimise(_panel(), COVERAGE, store=DesignStore(path, SETTINGS))
    return path.read_bytes()


def test_file_reads_back_as_the_sequence(tmp_path: Path) -> None:
    store = DesignStore(tmp_path / "designs.h5", SETTINGS)
    made = optimise(_panel(), COVERAGE, store=store)
    settings, read = read_designs(store.path)
    assert settings["garment"] == "panel"
    assert settings["beso.evolution_rate"] == 0.015
    assert (read.full, read.complete) == (made.full, True)
    assert read.coverage == COVERAGE
    for one, other in ((read.at_final, made.at_final), (read.at_latest, made.at_latest)):
        assert np.array_equal(one.positions_m, other.positions_m)
        assert np.array_equal(one.history_j_m2, other.history_j_m2)
    for one, other in zip(read.steps, made.steps, strict=True):
        assert np.array_equal(one.design, other.design)
        assert {**vars(one), "design": 0} == {**vars(other), "design": 0}


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 57, 85])
def test_interrupted_and_resumed_gives_the_same_bytes(tmp_path: Path, whole: bytes, steps: int) -> None:
    store = DesignStore(tmp_path / "designs.h5", SETTINGS)

    def stop(number: int, step: object) -> None:
        if number == steps - 1:
            raise Stopped

    with pytest.raises(Stopped):
        optimise(_panel(), COVERAGE, store=store, progress=stop)
    assert len(read_designs(store.path)[1].steps) == steps
    panel = _panel()
    optimise(panel, COVERAGE, store=store)
    assert store.path.read_bytes() == whole
    assert panel.starts[0] is not None  # from the stored equilibrium


def test_complete_file_is_not_computed_again(tmp_path: Path, whole: bytes) -> None:
    (tmp_path / "designs.h5").write_bytes(whole)
    panel = _panel()
    assert optimise(panel, COVERAGE, store=DesignStore(tmp_path / "designs.h5", SETTINGS)).complete
    assert not panel.starts


@pytest.mark.slow
def test_steps_before_one_that_does_not_converge_are_kept(tmp_path: Path, whole: bytes) -> None:
    store = DesignStore(tmp_path / "designs.h5", SETTINGS)
    with pytest.raises(DesignInterrupted):
        optimise(_panel(fails_at={30, 31}), COVERAGE, store=store)
    assert len(read_designs(store.path)[1].steps) == 30
    optimise(_panel(), COVERAGE, store=store)
    assert store.path.read_bytes() == whole


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coverage": 0.4}, r"coverage was 0\.3 and is now 0\.4"),
        ({"parameters": BesoParameters(evolution_rate=0.02)}, r"beso\.evolution_rate was 0\.015 and is now 0\.02"),
        ({"parameters": BesoParameters(filter_spread_m=0.01)}, r"beso\.filter_spread_m was None and is now 0\.01"),
        ({"settings": {**SETTINGS, "angle_deg": 80.0}}, r"angle_deg was 90\.0 and is now 80\.0"),
        ({"settings": {**SETTINGS, "body": "anny"}}, r"body was None and is now 'anny'"),
        ({"panel": BarPanel(np.linspace(0.005, 0.02, 20), columns=16)}, "mesh was '[0-9a-f]{64}' and is now"),
        ({"start": np.arange(600) < 300}, r"start was 'full' and is now '[0-9a-f]{64}'"),
    ],
)
def test_other_settings_are_refused_with_what_differs(tmp_path: Path, whole: bytes, change: dict, message: str) -> None:
    path = tmp_path / "designs.h5"
    path.write_bytes(whole)
    store = DesignStore(path, change.get("settings", SETTINGS))
    with pytest.raises(InputError, match=message) as caught:
        optimise(
            change.get("panel", _panel()),
            change.get("coverage", COVERAGE),
            change.get("parameters", BesoParameters()),
            store,
            start=change.get("start"),
        )
    assert str(caught.value).count(" and is now ") == 1
    assert path.read_bytes() == whole


@pytest.mark.parametrize("content", [b"", b"not HDF5 at all", None])
def test_another_file_is_refused(tmp_path: Path, whole: bytes, content: bytes | None) -> None:
    path = tmp_path / "designs.h5"
    path.write_bytes(whole[: len(whole) // 2] if content is None else content)
    with pytest.raises(InputError, match=r"designs\.h5: not a design sequence, or a damaged one"):
        optimise(_panel(), COVERAGE, store=DesignStore(path, SETTINGS))


def test_missing_file_and_missing_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.h5: no such file"):
        read_designs(tmp_path / "none.h5")
    with pytest.raises(InputError, match="there is no folder"):
        optimise(_panel(), COVERAGE, store=DesignStore(tmp_path / "none" / "designs.h5", SETTINGS))


def test_settings_that_are_not_plain_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="settings are not plain JSON data"):
        optimise(_panel(), COVERAGE, store=DesignStore(tmp_path / "designs.h5", {"body": object()}))


def test_full_disk_leaves_the_last_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "designs.h5"
    kept: list[bytes] = []

    def fill(number: int, step: object) -> None:
        if number == 3:
            kept.append(path.read_bytes())
            monkeypatch.setattr("os.fsync", _no_space)

    with pytest.raises(HapticsError, match=r"designs\.h5 cannot be written: .*No space"):
        optimise(_panel(), COVERAGE, store=DesignStore(path, SETTINGS), progress=fill)
    assert path.read_bytes() == kept[0]
    assert [entry.name for entry in tmp_path.iterdir()] == ["designs.h5"]


def _no_space(descriptor: int) -> None:
    raise OSError(28, "No space left on device")


CHILD = f"""
import sys
import numpy as np
from bar_panel import BarPanel
from haptics.garments.design.designs import DesignStore
from haptics.garments.design.topology import optimise
store = DesignStore(sys.argv[1], {SETTINGS!r})
panel = BarPanel(np.linspace(0.005, 0.02, 20), columns=15)
optimise(panel, {COVERAGE}, store=store, progress=lambda number, step: print(number, flush=True))
"""


def _killed_again_and_again(path: Path, kills: int, seed: int) -> int:
    """Kill runs on one file, each a few steps and a random moment after its start, until one ends; returns the kills made."""
    chance = random.Random(seed)
    for made in range(kills + 1):
        child = subprocess.Popen(
            [sys.executable, "-c", CHILD, str(path)], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent
        )
        assert child.stdout is not None
        if made == kills:
            assert child.communicate()[0] or path.exists()
            assert child.returncode == 0
            return made
        told = [int(line) for line in islice(child.stdout, chance.randint(0, 8))]
        for _ in range(chance.randint(0, 20000)):  # anywhere within a step, without a clock
            pass
        child.kill()
        child.communicate()
        if told:
            assert len(read_designs(path)[1].steps) > told[-1]
        if path.exists() and read_designs(path)[1].complete:
            return made + 1
    raise AssertionError


@pytest.mark.slow
def test_killed_at_any_moment_all_told_steps_are_kept_and_the_end_is_the_same(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "designs.h5"
    assert _killed_again_and_again(path, 2, seed=4) == 2
    assert path.read_bytes() == whole


@pytest.mark.soak
def test_killed_a_hundred_times(tmp_path: Path, whole: bytes) -> None:
    kills = 0
    while kills < 100:
        path = tmp_path / f"designs{kills}.h5"
        kills += _killed_again_and_again(path, min(20, 100 - kills), seed=kills)
        assert path.read_bytes() == whole
