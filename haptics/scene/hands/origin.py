"""Where the joints of a recorded hand came from: what a tracker gave, and what was made of it."""

from __future__ import annotations

from dataclasses import dataclass

from haptics.scene.hands.joints import JOINTS


@dataclass(frozen=True, slots=True)
class Origin:
    """How a file's numbers became joints.

    :param format: of the file, in words.
    :param basis: whose axes its numbers have, a name of ``haptics.BASES`` or in words.
    :param unit: of its lengths.
    :param time: unit of its times.
    :param made: joints that it lacks, which were made of others, in the order of ``JOINTS``.
    :param turned: whether orientations were made from where the joints are; False where they were read.
    :param off_m: how far a joint that was read comes to lie from where the file has it, when it is turned back, at most, m; None
        where that was not measured.
    """

    format: str
    basis: str
    unit: str
    time: str
    made: tuple[str, ...] = ()
    turned: bool = False
    off_m: float | None = None

    @property
    def read(self) -> tuple[str, ...]:
        """Joints that the file has."""
        return tuple(name for name in JOINTS if name not in self.made)

    @property
    def made_of_others(self) -> tuple[str, ...]:
        """What was made rather than read, in sentences for people."""
        names, count = ", ".join(self.made), len(self.made)
        joints = f"{count} of {len(JOINTS)} joints {'was' if count == 1 else 'were'} made rather than read: {names}"
        turns = "orientations were made from where the joints are"
        return (*((joints,) if self.made else ()), *((turns,) if self.turned else ()))

    @property
    def losses(self) -> tuple[str, ...]:
        """What was made, and how exact the rest is, in sentences for people."""
        if self.off_m is None:
            return self.made_of_others
        return (*self.made_of_others, f"joints that were read are within {self.off_m * 1e3:.1g} mm of the file")
