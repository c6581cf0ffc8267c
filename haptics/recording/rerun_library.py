"""The rerun library, as every writer of viewer files here needs it: present, and strict."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from haptics.errors import HapticsError, InputError


def open_rerun() -> Any:
    """The module.

    :raises InputError: it is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise InputError(f"the viewer's files need rerun ({error}): pip install 'wearable-haptics[view]'") from error
    return rerun


@contextmanager
def strict(rr: Any) -> Iterator[None]:
    """Data that rerun cannot log, of which it only warns unless told otherwise, are an error inside.

    :raises HapticsError: there were such data, or the file cannot be written.
    """
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    except (RuntimeError, TypeError, ValueError) as error:
        if isinstance(error, HapticsError):
            raise
        raise HapticsError(f"rerun cannot write the file: {error}") from error
    finally:
        rr.set_strict_mode(before)
