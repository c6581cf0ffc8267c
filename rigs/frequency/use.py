"""What a burst costs, how often it may come, and what the host's scheduler makes of one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from haptics.physics.thermal.one_node import DEFAULT_LIMIT_K, THERMAL
from haptics.physics.thermal.trains import min_spacing_s
from haptics.time import seconds_to_ns
from rigs.bench import Bench
from rigs.coil_current import POWER_SD
from rigs.fitting import quadrature
from rigs.frequency.trains import LANDS, Played, loud_samples
from rigs.instruments import Samples
from rigs.landings import traces
from rigs.result import Quantity

EVERY_S = 5.0
"""Bursts of 50 ms at 200 Hz may come so often on average (thesis 3.5.2)."""
SHAPE_SD = 0.006
"""Of a burst's energy as a share: what the current does between the phases at which telemetry meets it. It rises at each pulse
(15 of 2000 us), and a pin that moves takes up to 5 % for a part of the time (assumed: a third of the two together)."""
BURST_CYCLES = 10
_EDGE_S = 0.1e-3
_SCHEDULED_S = 0.5
_APART_S = 3e-3


def burst_use(played: Played, seen: list[tuple[int, float, float]]) -> dict[str, Quantity]:
    """Energy of one burst from the current that telemetry met in it; from it mean power and rise of one burst each ``EVERY_S``,
    and the minimum spacing under the default limit. ``c`` is the published one: the thermal rig measures the actuator's own.

    :param played: bursts of one rate.
    :param seen: time (ns), current (A), volts of telemetry that saw the coil on.
    :return: ``burst_energy_j``, ``burst_power_w``, ``burst_rise_k``, ``min_burst_interval_s``; empty if telemetry met fewer than
        2 bursts.
    """
    train = played.train
    power_w: list[float] = []
    for start_ns in played.starts_ns:
        in_burst = [
            current_a * volts
            for time_ns, current_a, volts in seen
            if 0.0 <= (time_ns - start_ns) / 1e9 < train.length_s
            and _inside(((time_ns - start_ns) / 1e9) % (1.0 / train.rate_hz), train.toward_s, train.back_at_s, train.back_s)
        ]
        if in_burst:
            power_w.append(float(np.mean(in_burst)))
    if len(power_w) < 2:
        return {}
    # Telemetry meets one burst at one phase of its cycles: bursts are the independent samples, not messages.
    mean_w = float(np.mean(power_w))
    share_sd = quadrature((float(np.std(power_w, ddof=1)) / math.sqrt(len(power_w)) / mean_w, POWER_SD, SHAPE_SD))
    energy_j = mean_w * train.on_s
    rise_k = THERMAL.c_k_per_w * energy_j / EVERY_S
    c_sd = THERMAL.c_sd_k_per_w / THERMAL.c_k_per_w
    spacing_s = min_spacing_s(energy_j, DEFAULT_LIMIT_K, THERMAL)
    with_c = quadrature((share_sd, c_sd))
    return {
        "burst_energy_j": Quantity(energy_j, energy_j * share_sd, "J"),
        "burst_power_w": Quantity(energy_j / EVERY_S, energy_j / EVERY_S * share_sd, "W"),
        "burst_rise_k": Quantity(rise_k, rise_k * with_c, "K"),
        "min_burst_interval_s": Quantity(spacing_s, spacing_s * with_c, "s"),
    }


def scheduled(bench: Bench) -> dict[str, Any]:
    """Ask the host's scheduler for one burst of 200 Hz; its answer, and when it began.

    :param bench: armed, with a tactor board.
    :return: ``begin_ns``, ``cycles``, ``played`` and the ``reason`` of a refusal.
    """
    tactiles = bench.glove.tactiles
    assert tactiles is not None  # a bench with a tactor board
    site = tactiles.sites[bench.options.channel]
    tactiles.take_results()
    begin_ns = bench.now_ns
    tactiles.burst(site, BURST_CYCLES, begin_ns)
    while bench.now_ns < begin_ns + seconds_to_ns(_SCHEDULED_S):
        bench.wait(1e-3)  # the driver has to be served as often as in a session
    results = [one for one in tactiles.take_results() if one.kind == "burst"]
    return {
        "begin_ns": begin_ns,
        "cycles": BURST_CYCLES,
        "played": all(one.played for one in results) and bool(results),
        "reason": next((one.reason for one in results if one.reason is not None), None),
    }


def felt_scheduled(samples: Samples, burst: dict[str, Any]) -> dict[str, Any]:
    """The same with the landings that were felt: how many, and their rate.

    :param samples: of the accelerometer, g.
    :param burst: what ``scheduled`` returned.
    :return: the same without ``begin_ns``, with ``landings`` and ``rate_hz`` (None below 3 landings).
    """
    (trace,) = traces(samples, [burst["begin_ns"]], _SCHEDULED_S)
    onsets_s: list[float] = []
    start = int(np.searchsorted(trace.after_s, 0.0))
    loud = loud_samples(trace, LANDS * float(np.abs(trace.g).max()), start, len(trace.g))
    for after_s in trace.after_s[start:][loud]:
        if not onsets_s or after_s - onsets_s[-1] > _APART_S:
            onsets_s.append(float(after_s))
    rate_hz = None
    if len(onsets_s) >= 3:
        rate_hz = 1.0 / float(np.polyfit(np.arange(len(onsets_s)), onsets_s, 1)[0])
    return {key: value for key, value in burst.items() if key != "begin_ns"} | {"landings": len(onsets_s), "rate_hz": rate_hz}


def _inside(phase_s: float, toward_s: float, back_at_s: float, back_s: float) -> bool:
    """Well inside one of a cycle's two pulses."""
    return _EDGE_S < phase_s < toward_s - _EDGE_S or back_at_s + _EDGE_S < phase_s < back_at_s + back_s - _EDGE_S
