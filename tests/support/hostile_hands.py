"""Files of hands that nobody would write: what may become of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.scene.hand_files.account import account_of
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.motion import judge_motion


def loads_or_refuses(path: Path) -> None:
    """No error but ``InputError``; what loads can be told of, and what is judged good is finite and in order."""
    try:
        recording = load_hand(path)
        account_of(recording)
        motion = judge_motion(recording)
    except InputError:
        return
    assert np.isfinite([frame.position_m for frame in motion.frames]).all()
    assert (np.diff([frame.time_ns for frame in motion.frames]) > 0).all()


def damaged(content: bytes, at: int, noise: bytes, cut: bool) -> bytes:
    """Bytes that were cut off, or overwritten, at some place."""
    at %= len(content)
    return content[:at] if cut else content[:at] + noise + content[at + len(noise) :]
