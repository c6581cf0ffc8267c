"""Arrays that took long to make, kept on disk in the user's cache.

``HAPTICS_CACHE`` names another place than the platform's folder for such things.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptics.folders import cache_folder

Arrays = dict[str, NDArray[Any]]


def kept(kind: str, key: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
    """The arrays for a key: read if they are there and whole, else made and written.

    :param kind: what is kept; begins the file's name.
    :param key: all that they depend on, plain data; another key is another file.
    :param make: makes the arrays where there is no whole file.
    :return: the arrays by name. A cache that cannot be written is reported on stderr and does no harm.
    """
    digest = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:20]
    path = cache_folder() / "bodies" / f"{kind}-{digest}.npz"
    found = _read(path)
    if found is not None:
        return found
    made = make()
    _write(path, made)
    return made


def _read(path: Path) -> Arrays | None:
    """None where there is no file or it is damaged: the archive checks the sum of each array."""
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files} or None
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error):
        return None


def _write(path: Path, arrays: Arrays) -> None:
    """Written beside its place and moved there in one step; a cache that cannot be written is reported and skipped."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix="building-", suffix=".npz", delete=False) as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(file.name, path)
    except OSError as error:
        print(f"cannot keep {path}: {error}", file=sys.stderr)
