"""A signal while a recording is made waits until it is: HDF5 calls us back, and crashes where that is broken off."""

from __future__ import annotations

import signal

import pytest
from recorded_session import record_session

from haptics.ends import Ended, orderly, shield_tracker
from haptics.recording import Journal, finalise, hdf5_file, load
from haptics.recording.ending import finish, keep


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Each seek of HDF5 in the file that it writes is met by Ctrl-C."""
    met: list[str] = []
    seek = hdf5_file._Sink.seek

    def meets(self, offset: int, whence: int = 0) -> int:
        met.append("seek")
        signal.raise_signal(signal.SIGINT)
        return seek(self, offset, whence)

    monkeypatch.setattr(hdf5_file._Sink, "seek", meets)
    return met


def test_in_a_script_of_its_own(tmp_path, interrupted):
    journal, out = record_session(tmp_path / "r.journal"), tmp_path / "r.h5"
    with pytest.raises(KeyboardInterrupt):
        finalise(journal, out)
    assert interrupted
    assert load(out).complete
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_in_a_program_that_says_where_the_recording_is(tmp_path, interrupted):
    journal, out = Journal.create(tmp_path / "r.journal", {}), tmp_path / "r.h5"
    made = []

    def program() -> None:
        try:
            finish(journal, out, False, {})
        except BaseException as error:
            made.extend([type(error), keep(journal, out, False, error), *error.__notes__])
            raise

    with pytest.raises(KeyboardInterrupt), orderly():
        program()
    assert made == [Ended, None, f"the recording {out} is complete"]
    assert load(out).complete
    assert interrupted


def test_a_signal_while_handlers_go_back_is_heard_when_they_are(monkeypatch):
    put, heard = signal.signal, []

    def late(number: int, handler: object) -> None:
        if not heard and handler is signal.default_int_handler:
            heard.append("late")
            signal.raise_signal(signal.SIGINT)
        put(number, handler)  # type: ignore[arg-type]

    with pytest.raises(KeyboardInterrupt) as ended, orderly():
        monkeypatch.setattr(signal, "signal", late)
    assert heard
    assert not isinstance(ended.value, Ended)  # the usual course, as after it
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks here")
def test_the_account_of_processes_outlives_a_terminal_that_closes(monkeypatch):
    masks = []
    blocked = lambda: signal.pthread_sigmask(signal.SIG_BLOCK, [])  # noqa: E731
    monkeypatch.setattr("multiprocessing.resource_tracker.ensure_running", lambda: masks.append(blocked()))
    shield_tracker()
    assert [signal.SIGHUP in mask for mask in (*masks, blocked())] == [True, False]
