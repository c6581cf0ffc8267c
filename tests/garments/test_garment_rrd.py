"""The rerun view of a garment in motion holds what was computed, and nothing else is touched."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="extra `view`")

from haptics.errors import InputError
from haptics.garments.design.job import DesignJob, put_on
from haptics.garments.equilibrium.wearing import evaluate_motion
from haptics.garments.views.rrd import HIGHEST_COLOUR, LOWEST_COLOUR, write_motion_rrd


def columns(path: Path, entity: str, static: bool = False) -> dict[str, list]:
    """All columns of an entity, by name; rows by angle, as the reader gives them. The viewer's row numbers are left out."""
    from rerun.chunk import RrdReader

    found: dict[str, list] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and chunk.is_static == static:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name != "rerun.controls.RowId":
                    found.setdefault(name, []).extend(batch.column(name).to_pylist())
    return found


def logged(path: Path, entity: str, name: str) -> np.ndarray:
    return np.array([row for row in columns(path, entity)[name] if row is not None])


@pytest.fixture(scope="module")
def worn():
    return put_on(DesignJob("sleeve", "elbow_extension", level="coarse", angle_deg=30.0))


@pytest.fixture(scope="module")
def found(worn):
    return evaluate_motion(worn, worn.garment.designable, [30.0, 12.5, 0.0])


@pytest.fixture(scope="module")
def rrd(worn, found, tmp_path_factory):
    return write_motion_rrd(worn, found, tmp_path_factory.mktemp("rrd") / "motion.rrd")


def test_the_cloth_and_the_body_move_by_angle(rrd, worn, found):
    expected = np.stack([state.positions_m for state in found.equilibria[::-1]]).astype(np.float32)
    assert np.array_equal(logged(rrd, "/world/garment", "Mesh3D:vertex_positions"), expected)
    expected = np.stack([worn.posed_m(angle) for angle in (0.0, 12.5, 30.0)]).astype(np.float32)
    assert np.array_equal(logged(rrd, "/world/body", "Mesh3D:vertex_positions"), expected)
    (triangles,) = columns(rrd, "/world/garment", static=True)["Mesh3D:triangle_indices"]
    assert np.array_equal(triangles, worn.garment.triangles)


def test_the_timeline_is_the_angle(rrd):
    times = columns(rrd, "/energy_j")["angle_deg"]
    assert [time.value / 1e9 if hasattr(time, "value") else time.total_seconds() for time in times] == [0.0, 12.5, 30.0]


def test_curves_are_energy_and_torque(rrd, found):
    assert np.array_equal(logged(rrd, "/energy_j", "Scalars:scalars")[:, 0], found.energy_j[::-1])
    assert np.array_equal(logged(rrd, "/torque_n_m", "Scalars:scalars")[:, 0], found.torque_n_m[::-1])


def test_colours_run_from_no_energy_to_the_most_stretched_state(rrd):
    packed = logged(rrd, "/world/garment", "Mesh3D:vertex_colors")
    colours = np.stack([packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255], axis=2)
    straight, halfway, bent = colours
    assert np.all(bent == LOWEST_COLOUR)  # put on there: nothing is stored
    assert np.any(np.all(straight == HIGHEST_COLOUR, axis=1))
    assert bent.mean() < halfway.mean() < straight.mean()


def test_the_windows_are_in_the_file(rrd):
    from rerun.chunk import RrdReader

    reader = RrdReader(rrd)
    assert len(reader.recordings()) == len(reader.blueprints()) == 1
    paths = {chunk.entity_path for chunk in reader.stream().to_chunks()}
    assert {"/world/body", "/world/garment", "/energy_j", "/torque_n_m"} <= paths


def test_the_same_motion_is_the_same_recording(worn, found, rrd, tmp_path):
    from rerun.chunk import RrdReader

    again = write_motion_rrd(worn, found, tmp_path / "again.rrd")
    one, other = (RrdReader(path).recordings()[0] for path in (rrd, again))
    assert one.recording_id == other.recording_id
    for entity in ("/world/body", "/world/garment", "/energy_j", "/torque_n_m"):
        assert columns(rrd, entity) == columns(again, entity)


def test_nothing_but_the_file_is_touched(worn, found, tmp_path, monkeypatch):
    def refused(*_args, **_kwargs):
        raise AssertionError("a view must not open a socket")

    monkeypatch.setattr(socket.socket, "connect", refused)
    monkeypatch.setattr(socket.socket, "bind", refused)
    write_motion_rrd(worn, found, tmp_path / "one.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["one.rrd"]
    with pytest.raises(InputError, match="--force"):
        write_motion_rrd(worn, found, tmp_path / "one.rrd")
    write_motion_rrd(worn, found, tmp_path / "one.rrd", force=True)


def test_a_missing_extra_is_named(worn, found, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"pip install '\.\[view\]'"):
        write_motion_rrd(worn, found, tmp_path / "one.rrd")
    assert not list(tmp_path.iterdir())
