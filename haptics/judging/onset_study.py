"""Onset error of predicted touch over any set of recorded hands, as ``haptics fidelity onset`` reports it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.judging.onset import onset_statistics
from haptics.judging.onset_experiment import SitePath, onset_experiment
from haptics.scene.hand_files.load import load_hand
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.motion import accepted
from haptics.time import NS_PER_MS, seconds_to_ns
from haptics.units import in_range, one_of

SUFFIXES = (".json", ".json.gz", ".json.lz", ".jsonl", ".ldj")
SHORTEST = 20
"""A track of fewer poses has no touch far enough from its edges to be judged."""


def onset_study(
    hands: Sequence[str],
    folder: Path | None,
    objects: int,
    latencies_s: Sequence[float],
    seed: int,
    side: str = "auto",
) -> list[dict[str, Any]]:
    """The onset error of the decider over all tracks of all hands, with that of ``hold`` beside it.

    :param hands: recordings or shipped names; where there is no folder either, the shipped hand.
    :param folder: all files in it with one of ``SUFFIXES`` are added; None: no folder.
    :param objects: spread for each track, 1 to 2000.
    :param latencies_s: from the sampling of a frame to its arrival, 0 to 0.1 s each.
    :param seed: of the objects' shapes and places.
    :param side: of the hands to take, ``left`` or ``right``; ``auto`` is both.
    :return: a row for each latency: ``latency_ms``, and the keys of ``onset_statistics``.
    :raises InputError: a hand, folder or number that cannot be used, or no track long enough.
    """
    in_range("objects", objects, 1, 2000)
    for latency_s in latencies_s:
        in_range("latency", latency_s * 1e3, 0.0, 100.0, "ms")
    found = list(hands)
    if folder is not None:
        found += sorted(str(path) for pattern in SUFFIXES for path in folder.glob(f"*{pattern}"))
        if not folder.is_dir():
            raise InputError(f"folder = {folder}: there is no such folder; expected one of recorded hands")
        if not found:
            raise InputError(f"folder {folder} holds no *{', *'.join(SUFFIXES)}; expected a folder of recorded hands")
    recordings = [load_hand(hand) for hand in found or ["synthetic"]]
    sides = SIDES if one_of("side", side, ("auto", *SIDES)) == "auto" else (side,)
    tracks = [accepted(track) for recording in recordings for track in recording.tracks if track.side in sides]
    paths = [SitePath.of(track) for track in tracks if track is not None and len(track) >= SHORTEST]
    if not paths:
        of_side = "" if side == "auto" else f" of the {side} hand"
        raise InputError(f"no track{of_side} of {SHORTEST} poses or more in {', '.join(r.source for r in recordings)}")
    latencies_ns = [seconds_to_ns(latency_s) for latency_s in latencies_s]
    onsets = onset_experiment(paths, latencies_ns, objects, seed)
    return [{"latency_ms": latency_ns / NS_PER_MS, **onset_statistics(onsets[latency_ns])} for latency_ns in latencies_ns]
