"""A value that was handed in, in a few characters, for messages that name it."""

from __future__ import annotations

import numpy as np


def shown(value: object) -> str:
    """What was seen, whatever it is: ``null``, ``'text'``, ``a list of 3``, ``an array (25, 3) of float64``.

    :param value: anything.
    :return: at most some 40 characters.
    """
    if isinstance(value, np.ndarray):
        return f"an array {value.shape} of {value.dtype}"
    if isinstance(value, (list, tuple, dict)):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) >= 10**20:
        return f"an integer of {value.bit_length()} bits"
    text = "null" if value is None else repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."
