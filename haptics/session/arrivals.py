"""When the poses of a recorded motion reach a loop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.recording import HandRecording
from haptics.time import NS_PER_MS, seconds_to_ns

GONE_NS = 15 * NS_PER_MS
"""A tracker that loses a hand reports it with its next frame, about this much later."""


def arrivals_of(
    frames: tuple[HandFrame, ...], recording: HandRecording, start_ns: int, latency_ns: int
) -> Iterator[tuple[int, HandFrame | None]]:
    """When each pose reaches the loop.

    :param frames: of one side, their times from the start of the motion.
    :param recording: they are of.
    :param start_ns: when the motion begins, ns on the glove's clock.
    :param latency_ns: from sampling to arrival, ns.
    :return: arrival (ns on the glove's clock) and the pose, stamped on that clock; None where the tracker reports the hand gone.
    """
    for frame, following in zip(frames, (*frames[1:], None), strict=True):
        sampled_ns = start_ns + frame.time_ns
        yield sampled_ns + latency_ns, replace(frame, time_ns=sampled_ns)
        ends_ns = seconds_to_ns(recording.duration_s) if following is None else following.time_ns
        changes = following is None or following.track_id != frame.track_id
        if changes and ends_ns - frame.time_ns > 2 * GONE_NS:
            yield sampled_ns + latency_ns + GONE_NS, None
