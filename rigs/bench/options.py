"""Where and how a rig runs: ports, seed, channel, what is written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from haptics.session.configuration import Configuration


def _silent(what: str) -> None:
    """No progress; a function with a name, so that options can be handed to another process."""


@dataclass(frozen=True)
class BenchOptions:
    """Where and how a rig runs.

    :param port: URL of the board's port; None uses the configuration's.
    :param level: level of a simulated board's models, such as ``dynamic``; None leaves the board's default.
    :param seed: of simulated boards and instruments, 0 to 2^32 - 1.
    :param channel: channel of the board that the instruments are attached to, from 0.
    :param instruments: port URLs by kind (``thermocouple``, ``stage`` ...); on hardware every instrument that the rig needs must
        be given.
    :param surface: what the pin lands on, for the pendulum: ``bare``, ``silicone`` or ``foam``; None measures all three on a
        simulated board.
    :param configuration: glove configuration; its ports serve where ``port`` is None.
    :param record: HDF5 file to write; None records nothing.
    :param force: overwrite a recording that exists.
    :param progress: called with a line of text at each stage of the run.
    """

    port: str | None = None
    level: str | None = None
    seed: int = 1
    channel: int = 0
    instruments: Mapping[str, str] = field(default_factory=dict)
    surface: str | None = None
    configuration: Configuration = field(default_factory=Configuration)
    record: Path | None = None
    force: bool = False
    progress: Callable[[str], None] = _silent

    def part(self, name: str) -> BenchOptions:
        """The same, recording under another name: ``thermal.h5`` becomes ``thermal-NAME.h5``.

        :param name: appended to the recording's name, after a hyphen.
        :return: options for that part of the run; unchanged where nothing is recorded.
        """
        if self.record is None:
            return self
        return replace(self, record=self.record.with_stem(f"{self.record.stem}-{name}"))

    def board_url(self, board: str) -> str:
        """The board's port.

        :param board: ``tactiles`` or ``brake``.
        :return: URL of the board's port.
        """
        if self.port is not None:
            return self.port
        return self.configuration.tactiles.port if board == "tactiles" else self.configuration.brake.port
