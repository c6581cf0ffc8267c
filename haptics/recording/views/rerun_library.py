"""The rerun library, as every writer of viewer files here needs it: present, and strict."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from haptics.errors import HapticsError, InputError
from haptics.extras import install
from haptics.recording.output import replacing


def open_rerun() -> Any:
    """Import rerun.

    :return: the module.
    :raises InputError: it is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise InputError(f"the viewer's files need rerun ({error}); install it with: {install('view')}") from error
    return rerun


@contextmanager
def viewer_file(rr: Any, path: Path, force: bool, application: str, number: str, blueprint: Callable[[], Any]) -> Iterator[Any]:
    """A stream to log to; what was logged becomes the file. The bytes do not go through rerun's own sink, which waits for ever on
    a full disk.

    :param rr: the module.
    :param path: the file to write (``.rrd``).
    :param force: overwrite it if it exists.
    :param application: name that the viewer groups recordings by.
    :param number: of the recording, hexadecimal.
    :param blueprint: the layout of the viewer's windows.
    :return: the stream, as a context.
    :raises InputError: ``path`` exists and ``force`` is not given.
    :raises HapticsError: there were data that rerun cannot log, or the file cannot be written.
    """
    with replacing(path, force) as partial, _strict(rr):
        stream = rr.RecordingStream(application, recording_id=number, send_properties=False)
        made = stream.binary_stream()
        stream.send_blueprint(blueprint(), make_active=False, make_default=True)
        yield stream
        stream.flush()
        partial.write_bytes(made.read() or b"")
        stream.disconnect()


@contextmanager
def _strict(rr: Any) -> Iterator[None]:
    """Data that rerun cannot log, of which it only warns by default, are an error inside.

    :raises HapticsError: there were such data.
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
