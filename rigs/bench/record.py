"""The recording of one bench: begun when its instruments are open, whole or kept as far as it got when the bench ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from haptics.link.events import Event
from haptics.recording import StreamSpec
from haptics.recording.ending import finish, keep
from haptics.recording.leftovers import journal_of, refuse_leftover
from haptics.recording.output import check_folder, check_outputs
from haptics.session.recorder import LinkRecorder, provenance
from rigs.bench.options import BenchOptions
from rigs.instruments import SampleStream, Stage

Kinds = Sequence[type[SampleStream] | type[Stage]]


class BenchRecord:
    """What is written of a bench; nothing where ``options.record`` is None.

    :param options: where to, and what the header says of the run.
    :raises InputError: the recording cannot be written; or a journal of an earlier session is in the way.
    """

    def __init__(self, options: BenchOptions):
        self._options = options
        self._recorder: LinkRecorder | None = None
        self._early: list[tuple[str, int, bool, bytes]] = []
        """Bytes on the wire before the recording begins."""
        if options.record is not None:
            journal = journal_of(options.record)
            check_folder("record", options.record)
            refuse_leftover(journal, options.force)
            check_outputs({"recording": options.record, "its journal": journal}, options.force)

    def begin(self, rig: str, board: str, instruments: Kinds, plot: tuple[str, str] | None) -> None:
        """Write the header, and what was on the wire so far.

        :param rig: its name.
        :param board: ``tactiles`` or ``brake``.
        :param instruments: each that samples becomes a stream.
        :param plot: stream and signal that a viewer shows first.
        """
        options = self._options
        if options.record is None:
            return
        header: dict[str, Any] = {
            **provenance(),
            "title": rig,
            "rig": rig,
            "port": options.board_url(board),  # as asked for: the name of a simulated world means nothing later
            "instruments": {kind.kind: options.instruments.get(kind.kind, f"sim://{kind.kind}") for kind in instruments},
            "level": options.level,
            "seed": options.seed,
            "channel": options.channel,
        }
        if plot is not None:
            header["default_plot"] = {"stream": plot[0], "signal": plot[1]}
        streams = [_stream_spec(kind) for kind in instruments if issubclass(kind, SampleStream)]
        self._recorder = LinkRecorder(journal_of(options.record), header, options.force, streams)
        for name, time_ns, to_board, data in self._early:
            self._recorder.wire(time_ns, name, to_board, data)
        self._early.clear()

    def wire(self, name: str, time_ns: int, to_board: bool, data: bytes) -> None:
        """Bytes on a board's wire.

        :param name: of the board.
        :param time_ns: on the bench's clock, ns.
        :param to_board: which way they go.
        :param data: the bytes.
        """
        if self._recorder is not None:
            self._recorder.wire(time_ns, name, to_board, data)
        elif self._options.record is not None:
            self._early.append((name, time_ns, to_board, data))

    def link_event(self, name: str, event: Event) -> None:
        """What a board said.

        :param name: of the board.
        :param event: as its link understood it.
        """
        if self._recorder is not None:
            self._recorder.link_event(name, event)

    def note(self, now_ns: int, kind: str, subject: str = "", detail: str = "") -> None:
        """Something that the bench did.

        :param now_ns: time of the bench's clock, ns.
        :param kind: such as ``armed``.
        :param subject: what it was done to.
        :param detail: in words.
        """
        if self._recorder is not None:
            self._recorder.event(now_ns, kind, subject, detail=detail)

    def samples(self, now_ns: int, one: SampleStream) -> None:
        """What an instrument printed since the last call.

        :param now_ns: when it was read, ns.
        :param one: the instrument.
        """
        if self._recorder is not None:
            stream = self._recorder.streams[one.kind]
            for number, values in one.fresh():
                stream.append((now_ns, number, *values))

    def acknowledge(self, now_ns: int) -> None:
        """All up to now has been handed over.

        :param now_ns: time of the bench's clock, ns.
        """
        if self._recorder is not None:
            self._recorder.acknowledge(now_ns)

    def bear_errors(self) -> None:
        """From here on a disk that is full ends nothing: boards go off first; ``end`` raises it."""
        if self._recorder is not None:
            self._recorder.journal.raises = False

    def end(self, error: BaseException | None) -> None:
        """Make the recording whole, or keep what there is, marked incomplete.

        :param error: what ended the bench; None: it ran to its end.
        :raises HapticsError: it could not be written.
        """
        recorder, self._recorder = self._recorder, None
        if recorder is None or self._options.record is None:
            return
        journal, record, force = recorder.journal, self._options.record, self._options.force
        if error is not None:
            keep(journal, record, force, error)
            return
        try:
            if journal.error is not None:
                raise journal.error
            journal.raises = True
            finish(journal, record, force, {"ended": "off"})
        except BaseException as trouble:
            keep(journal, record, force, trouble)
            raise


def _stream_spec(kind: type[SampleStream]) -> StreamSpec:
    fields = [("time_ns", "i8"), ("number", "i8"), *((name, "f8") for name, _ in kind.columns)]
    return StreamSpec(
        kind.kind, np.dtype(fields), dict(kind.columns), f"Samples of the {kind.kind}: time read, its own count, values."
    )
