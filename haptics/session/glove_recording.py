"""The recording of a glove that a program drives: begun when the glove is opened, made whole when it is closed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.recording.ending import finish, keep
from haptics.recording.leftovers import journal_of, refuse_leftover
from haptics.recording.output import check_folder, check_outputs
from haptics.session.composition import EarlyWire
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.session.recorder import Recorder, provenance, sites_of_joints
from haptics.session.whose_hand import calibration_header, calibration_of, sites_of


class GloveRecording:
    """A recording to be: a journal while the glove is open, HDF5 afterwards.

    :param out: HDF5 file to write.
    :param force: overwrite one that exists.
    :raises InputError: it cannot be written, or a journal of an earlier session is in the way.

    :ivar wire: the tap to open the glove's devices with.
    """

    def __init__(self, out: Path, force: bool):
        if out.suffix != ".h5":
            raise InputError(f"record = {str(out)!r} does not end in .h5; expected the name of an HDF5 file to write")
        self._out, self._force = out, force
        self._journal = journal_of(out)
        check_folder("record", out)
        refuse_leftover(self._journal, force)
        check_outputs({"record": out, "the journal of record": self._journal}, force)
        self.wire = EarlyWire()
        self._recorder: Recorder | None = None

    def begin(self, devices: Devices, configuration: Configuration, seed: int) -> Recorder:
        """Start to record.

        :param devices: open.
        :param configuration: they were opened with.
        :param seed: of the simulated boards.
        :return: what takes rows from now on.
        :raises InputError: the journal cannot be written.
        """
        calibration = calibration_of(configuration)
        header: dict[str, Any] = {
            **provenance(),
            "title": "a glove driven by a program",
            "seed": seed,
            "realtime": devices.realtime,
            "configuration": configuration.model_dump(mode="json"),
            "sites": sites_of_joints(sites_of(calibration)),
            **calibration_header(calibration),
            "brakes": [] if devices.brakes is None else list(devices.brakes.channels),
            "default_plot": {"stream": "ticks", "signal": "rise_k" if devices.brakes is None else "force_n"},
        }
        recorder = self._recorder = Recorder(self._journal, header, self._force, by_hand=True, live=True)
        self.wire.attach(recorder)
        devices.on_event(recorder.link_event)
        devices.on_result(recorder.result)
        return recorder

    def hold_errors(self) -> None:
        """From now on a disk that fails keeps nothing else from being done: the glove goes off first."""
        if self._recorder is not None:
            self._recorder.journal.raises = False

    def end(self, error: BaseException | None) -> None:
        """Make the recording whole.

        :param error: what ended the glove, if it did not end well; it is given a note of where the recording is.
        :raises InputError, HapticsError: no recording could be made; a note says what there is.
        """
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        journal = recorder.journal
        if error is not None:
            keep(journal, self._out, self._force, error)
            return
        try:
            if journal.error is not None:
                raise journal.error
            journal.raises = True
            finish(journal, self._out, self._force, {"ended": "off"})
        except BaseException as trouble:
            keep(journal, self._out, self._force, trouble)
            raise
