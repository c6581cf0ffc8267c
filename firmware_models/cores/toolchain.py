"""Builds the C firmware on first use, into the user's cache: the core as a library, the images, and what simulates the chip.

The folder in the cache is named by a hash of every source, of the Makefile and of the compilers' versions, so that a change of
any of them is a new build and an old one is never mistaken for it. ``HAPTICS_CACHE`` names another cache.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from haptics.errors import InputError
from haptics.folders import cache_folder
from haptics.units import one_of

FIRMWARE = Path(__file__).parents[1] / "firmware"
_SIMAVR_HEADER = "#include <simavr/sim_avr.h>\n"
_WITHOUT = "core=py works without"


def host_library() -> Path:
    """The core as a shared library (``firmware/host/host.h``).

    :return: path of the library.
    :raises InputError: make or a C compiler is missing, or the build failed.
    """
    return _build("host", (_compiler(),)) / "libcore.so"


def lockstep_library() -> Path:
    """What runs an image on a simulated ATmega328P (``firmware/simavr/lockstep.h``).

    :return: path of the library.
    :raises InputError: make, a C compiler or libsimavr is missing, or the build failed.
    """
    compiler = _compiler()
    if not _compiles(compiler, _SIMAVR_HEADER):
        raise _missing("libsimavr and its headers", "the package libsimavr-dev (Debian, Ubuntu), or simavr from its source")
    return _build("lockstep", (compiler,)) / "liblockstep.so"


def image(board: str) -> Path:
    """The image that a board is flashed with.

    :param board: "tactiles" or "brake".
    :return: path of the .hex file.
    :raises InputError: no such board, make or avr-gcc is missing, or the build failed.
    """
    one_of("board", board, ("tactiles", "brake"))
    return _build(board, (_program("avr-gcc", "gcc-avr, binutils-avr and avr-libc"),)) / f"{board}.hex"


def _missing(what: str, install: str) -> InputError:
    return InputError(f"{what} not found; the C firmware is built with it: install {install}; {_WITHOUT}")


def _program(name: str, packages: str) -> str:
    path = shutil.which(name)
    if path is None:
        raise _missing(name, packages)
    return path


def _compiler() -> str:
    """The C compiler of this machine: ``CC``, or cc."""
    return _program(os.environ.get("CC") or "cc", "a C compiler (the packages gcc and libc6-dev, or clang)")


def _compiles(compiler: str, source: str) -> bool:
    command = [compiler, "-fsyntax-only", "-x", "c", "-"]
    return subprocess.run(command, input=source, capture_output=True, text=True, check=False).returncode == 0


@cache
def _version(compiler: str) -> str:
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)
    return f"{compiler}\n{done.stdout}"


def _key(target: str, compilers: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    sources = [FIRMWARE / "Makefile", *sorted(FIRMWARE.rglob("*.[ch]"))]
    for part in (target, *map(_version, compilers)):
        digest.update(part.encode() + b"\0")
    for path in sources:
        digest.update(path.relative_to(FIRMWARE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:20]


def _build(target: str, compilers: tuple[str, ...]) -> Path:
    """The folder that holds the target, built if it is not there yet."""
    folder = cache_folder() / "firmware" / f"{target}-{_key(target, compilers)}"
    if folder.is_dir():
        return folder
    make = _program("make", "make")
    folder.parent.mkdir(parents=True, exist_ok=True)
    # built beside its place and moved there in one step: another process sees all of it or nothing
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="building-") as temporary:
        out = Path(temporary) / "out"
        command = [make, "--silent", "-C", str(FIRMWARE), target, f"OUT={out}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(f"the C firmware could not be built ({' '.join(command)}):\n{done.stderr.strip()}\n{_WITHOUT}")
        try:
            out.rename(folder)
        except OSError:
            if not folder.is_dir():  # else another process was there first, with the same
                raise
    return folder
