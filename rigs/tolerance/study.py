"""Many devices drawn and felt, before and after a bench has calibrated them, on a pool of processes."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from haptics.ends import end_workers, shield_tracker
from haptics.units import in_range
from rigs.tolerance.calibration import NOISES, BenchUncertainty, calibrated_host, published_host
from rigs.tolerance.draws import MAX_SPREAD, NAMES, NOMINAL_DEVICE, VARIED, Varied, checked_names, device
from rigs.tolerance.felt import felt, quantities
from rigs.tolerance.summary import FeltRow, felt_row

Floats = NDArray[np.float64]
CHUNK = 100
"""Devices that a process is handed at a time: one to two seconds of work."""
MAX_DEVICES = 1_000_000


@dataclass(frozen=True)
class ToleranceReport:
    """What was drawn, and its consequences.

    :param devices: how many.
    :param seed: of all draws.
    :param spread: factor on the half widths.
    :param calibration: uncertainty of the bench.
    :param parameters: those that varied, each by ``spread`` times its half width.
    :param felt: one row for each quantity.
    """

    devices: int
    seed: int
    spread: float
    calibration: BenchUncertainty
    parameters: tuple[Varied, ...]
    felt: tuple[FeltRow, ...]


def tolerance_study(
    devices: int = 400,
    seed: int = 1,
    *,
    spread: float = 1.0,
    calibration: BenchUncertainty = BenchUncertainty(),
    only: Sequence[str] | None = None,
    executor: Executor | None = None,
    progress: Callable[[str], None] | None = None,
) -> ToleranceReport:
    """The spread of what is felt over ``devices`` devices, and what is left of it once a bench has measured each.

    Every device has a random stream of its own (``SeedSequence.spawn``), so the result depends on the arguments alone, not on
    who computes which part. Without ``executor`` processes are started afresh (``spawn``), as many as there are cores; a script
    must then be importable (``if __name__ == "__main__"``). An interruption gives up what has not begun.

    :param devices: 2 to a million.
    :param seed: 0 to 2^63.
    :param spread: of the half widths, 0 to 2.
    :param calibration: what the bench's own reports are uncertain by.
    :param only: names of the parameters that vary, all others nominal; everything if None. The same device draws the same number
        for a parameter, whichever others vary.
    :param executor: any; it is left open.
    :param progress: called with the number of devices done.
    :return: the same for the same arguments, whatever the executor.
    :raises InputError: a number outside its range, or a name that does not vary.
    """
    count = int(in_range("devices", devices, 2, MAX_DEVICES))
    seed = int(in_range("seed", seed, 0, 2**63))
    in_range("spread", spread, 0.0, MAX_SPREAD)
    names = checked_names(only)
    seeds = SeedSequence(seed).spawn(count)
    chunks = [seeds[first : first + CHUNK] for first in range(0, count, CHUNK)]
    if executor is None:
        with process_pool() as pool:
            played = _gather(pool, chunks, spread, calibration, names, progress)
    else:
        played = _gather(executor, chunks, spread, calibration, names, progress)
    shifts, before, after = (np.concatenate(parts) for parts in zip(*played, strict=True))
    nominal = felt(NOMINAL_DEVICE, published_host())
    varied = [k for k, name in enumerate(NAMES) if name in names]
    return ToleranceReport(
        devices=count,
        seed=seed,
        spread=float(spread),
        calibration=calibration,
        parameters=tuple(VARIED[k] for k in varied),
        felt=tuple(
            felt_row(quantity, one.value, before[:, k], after[:, k], {NAMES[j]: shifts[:, j] for j in varied})
            for k, (quantity, one) in enumerate(zip(quantities(), nominal, strict=True))
        ),
    )


def process_pool(workers: int | None = None) -> AbstractContextManager[Executor]:
    """Fresh processes; None: one a core. They leave an interruption to the one who started them, who ends them then.

    :param workers: 1 to 256; None starts one for each core.
    :return: a context manager that ends the processes.
    :raises InputError: ``workers`` outside 1 to 256.
    """
    if workers is not None:
        workers = int(in_range("workers", workers, 1, 256))
    return _pool(workers)


@contextmanager
def _pool(workers: int | None) -> Iterator[Executor]:
    shield_tracker()
    with ProcessPoolExecutor(workers, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        try:
            yield pool
        except KeyboardInterrupt:
            end_workers()
            raise


def play(
    seeds: Sequence[SeedSequence], spread: float, calibration: BenchUncertainty, names: tuple[str, ...]
) -> tuple[Floats, Floats, Floats]:
    """One chunk: shifts (devices, parameters), and errors (devices, quantities) before and after calibration.

    :param seeds: one for each device.
    :param spread: factor on the half widths.
    :param calibration: uncertainty of the bench.
    :param names: of the parameters that vary.
    :return: shifts (devices, parameters), errors before and after calibration (devices, quantities).
    """
    chosen = np.array([name in names for name in NAMES])
    shifts, before, after = [], [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        shift = rng.uniform(-1.0, 1.0, len(VARIED)) * chosen
        one = device(shift.tolist(), spread)
        host = calibrated_host(one, calibration, rng.standard_normal(NOISES).tolist())
        shifts.append(shift)
        before.append([f.error for f in felt(one, published_host())])
        after.append([f.error for f in felt(one, host)])
    return np.array(shifts), np.array(before), np.array(after)


def _gather(
    executor: Executor,
    chunks: list[list[SeedSequence]],
    spread: float,
    calibration: BenchUncertainty,
    names: tuple[str, ...],
    progress: Callable[[str], None] | None,
) -> list[tuple[Floats, Floats, Floats]]:
    """All chunks, in their order."""
    futures = [executor.submit(play, chunk, spread, calibration, names) for chunk in chunks]
    total, played = sum(map(len, chunks)), []
    try:
        for future in futures:
            played.append(future.result())
            if progress is not None:
                progress(f"{sum(len(shifts) for shifts, _, _ in played)} of {total} devices")
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return played
