import numpy as np
import pytest

from haptics.folders import cache_folder
from haptics.garments.bodies.cache import kept


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HAPTICS_CACHE", str(tmp_path / "cache"))


class Maker:
    def __init__(self):
        self.times = 0

    def __call__(self):
        self.times += 1
        return {"points": np.arange(3000, dtype=np.float64).reshape(-1, 3), "parts": np.arange(7)}


def only_file():
    (path,) = (cache_folder() / "bodies").iterdir()
    return path


def test_what_was_made_is_kept_to_the_bit():
    make = Maker()
    first, second = kept("body", {"age": 0.5}, make), kept("body", {"age": 0.5}, make)
    assert make.times == 1
    assert all(first[name].tobytes() == second[name].tobytes() and first[name].dtype == second[name].dtype for name in first)


def test_another_key_is_another_file():
    make = Maker()
    kept("body", {"age": 0.5}, make)
    kept("body", {"age": 0.5000001}, make)
    assert make.times == 2


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"not an archive", lambda b: flipped(b)])
def test_a_damaged_file_is_made_again(damage):
    make = Maker()
    kept("body", {}, make)
    only_file().write_bytes(damage(only_file().read_bytes()))
    assert kept("body", {}, make)["points"][999, 2] == 2999
    assert make.times == 2
    kept("body", {}, make)
    assert make.times == 2


def flipped(content):
    """One bit within the data of the first array."""
    changed = bytearray(content)
    changed[300] ^= 1
    return bytes(changed)


def test_nothing_half_written_is_left_behind():
    kept("body", {}, Maker())
    assert only_file().name.startswith("body-")


def test_a_cache_that_cannot_be_written_is_gone_without(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HAPTICS_CACHE", str(tmp_path / "file"))
    assert kept("body", {}, Maker())["parts"].tolist() == list(range(7))
    assert "cannot keep" in capsys.readouterr().err
