"""A rig run on one device or several, and all that is left of it: recordings, pictures, one page, plain data."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from haptics.cli.show import plain
from haptics.ends import end_workers, shield_tracker
from haptics.errors import InputError
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS
from haptics.link.port_url import is_simulated
from haptics.link.ports import check_board_port
from haptics.recording.output import check_outputs, make_folder, refuse_existing, replacing
from haptics.session.recorder import provenance
from haptics.units import in_range, whole_number
from rigs.bench import BenchOptions
from rigs.catalogue import rig
from rigs.comparison import Row, compare
from rigs.report import Block, Page, png_bytes, render_page
from rigs.report.page import Table
from rigs.result import Plot, Quantity, RigResult, readable, series

MAX_DEVICES = 1000


@dataclass(frozen=True)
class Characterisation:
    """The result of one rig on one or more devices.

    :param rig: name of the rig.
    :param port: URL of the board.
    :param level: level of the simulated board's models; None is the board's default.
    :param seed: of the first device.
    :param results: one for each device.
    :param quantities: of the only device, or mean and scatter over the devices without a fault.
    :param rows: published numbers beside ``quantities``; empty where there are none.
    :param files: everything that was written.
    """

    rig: str
    port: str
    level: str | None
    seed: int
    results: tuple[RigResult, ...]
    quantities: Mapping[str, Quantity]
    rows: tuple[Row, ...]
    files: tuple[Path, ...] = ()

    @property
    def sound(self) -> bool:
        """Every device was measured without a fault and within the rig's limits."""
        return all(result.sound for result in self.results)

    def to_json(self) -> dict[str, Any]:
        """Plain data: each quantity and ``..._sd``, then the rest; nulls where a fault forbade a fit.

        :return: keys as ``haptics characterize --json`` prints them; SI units.
        """
        first = self.results[0]
        quantities = dict(self.quantities)
        data: dict[str, Any] = {"rig": self.rig, "port": self.port, "level": self.level, "seed": self.seed}
        data["devices"] = len(self.results)
        for name, quantity in quantities.items():
            data[name], data[f"{name}_sd"] = quantity.value, quantity.sd
        if not quantities:
            data |= {name: None for name in rig(self.rig).PUBLISHED}
        if len(self.results) == 1:
            data |= first.details
        chi2 = [result.reduced_chi2 for result in self.results if result.reduced_chi2 is not None]
        data["chi2_reduced"] = float(np.mean(chi2)) if chi2 else None
        data["faults"] = [
            {"device": k, "what": fault.what, "why": fault.why}
            for k, result in enumerate(self.results)
            for fault in result.faults
        ]
        data["measured"] = [
            {
                "device": k,
                "name": one.measurement.name,
                "value": one.value,
                "unit": one.measurement.unit,
                "low": one.measurement.low,
                "high": one.measurement.high,
                "within": one.within,
            }
            for k, result in enumerate(self.results)
            for one in result.measured
        ]
        if len(self.results) > 1:
            data["each"] = [
                {name: {"value": q.value, "sd": q.sd, "unit": q.unit} for name, q in result.quantities.items()}
                for result in self.results
            ]
        data["published"] = [row.to_json() for row in self.rows]
        data["notes"] = list(dict.fromkeys(note for result in self.results for note in result.notes))
        data["files"] = [str(path) for path in self.files]
        return data


def characterize(
    name: str,
    options: BenchOptions,
    devices: int = 1,
    out: Path | None = None,
    executor: Executor | None = None,
) -> Characterisation:
    """Run a rig and write its results.

    :param name: of the rig.
    :param options: where it runs; ``record`` is set here.
    :param devices: simulated ones, each a board of its own with seeds from ``options.seed`` on, run side by side in processes;
        the instruments of a real bench sit on one device.
    :param out: folder to write to, made if need be; None writes nothing.
    :param executor: what runs several devices; a pool of processes if None.
    :return: all results, with the files that were written.
    :raises InputError: an unknown rig, a port of another board, several devices on hardware, or a file that exists.
    :raises HapticsError: the bench failed; whatever was recorded is in ``out``, marked incomplete.
    """
    chosen = rig(name)
    if options.port is not None:
        check_board_port(options.port, chosen.BOARD)
    devices = int(in_range("devices", devices, 1, MAX_DEVICES))
    if devices > 1 and not is_simulated(options.board_url(chosen.BOARD)):
        raise InputError(
            f"devices = {devices} is not allowed on hardware, where the instruments sit on one device; "
            "for the next, move them and choose another --channel"
        )
    channels = COIL_CHANNELS if chosen.BOARD == "tactiles" else BRAKE_CHANNELS
    whole_number("channel", options.channel, 0, channels - 1)
    if out is not None:
        _make_folder(out, name, options.force)
    jobs = [_job(name, options, out, k, devices) for k in range(devices)]
    results = (chosen.run(jobs[0]),) if devices == 1 else run_jobs([(name, job) for job in jobs], executor, options.progress)
    done = gathered(name, options, results)
    if out is None:
        return done
    options.progress(f"{name}: writing")
    files = [path for path in sorted(out.glob(f"{name}*.h5"))]
    return replace(done, files=tuple(files + _write(done, out, options.force)))


def gathered(name: str, options: BenchOptions, results: tuple[RigResult, ...]) -> Characterisation:
    """Results of one or several devices together, beside the published numbers.

    :param name: of the rig.
    :param options: what the rig ran with.
    :param results: one for each device, at least one.
    :return: the results together, with no files yet.
    """
    chosen = rig(name)
    quantities = results[0].quantities if len(results) == 1 else _over_devices(results)
    rows = tuple(compare(chosen.PUBLISHED, quantities)) if quantities else ()
    return Characterisation(name, options.board_url(chosen.BOARD), options.level, options.seed, results, quantities, rows)


def run_one(name: str, options: BenchOptions) -> RigResult:
    """One rig on one device; a function with a name, so that another process can run it.

    :param name: of the rig.
    :param options: where it runs.
    :return: its result.
    """
    return rig(name).run(options)


def run_jobs(
    jobs: Sequence[tuple[str, BenchOptions]], executor: Executor | None, progress: Callable[[str], None]
) -> tuple[RigResult, ...]:
    """Rigs by name, each on its own bench, side by side; results in the order of the jobs.

    :param jobs: name of a rig and its options, one for each run.
    :param executor: a pool of processes if None.
    :param progress: called with each job; the benches themselves report nothing.
    :return: results in the order of ``jobs``.
    :raises HapticsError: a bench failed; jobs that have not begun are left out.
    """
    if executor is None:
        shield_tracker()
    pool = executor or ProcessPoolExecutor(mp_context=get_context("spawn"))
    try:
        futures = [pool.submit(run_one, name, replace(job, progress=BenchOptions().progress)) for name, job in jobs]
        results = []
        for (name, _), future in zip(jobs, futures, strict=True):
            progress(f"{name}, {len(results) + 1} of {len(jobs)}")
            results.append(future.result())
        return tuple(results)
    except KeyboardInterrupt:
        if executor is None:  # who was asked to end is us; each bench keeps what it has recorded
            end_workers()
        raise
    finally:
        if executor is None:
            pool.shutdown(cancel_futures=True)


def summary_blocks(done: Characterisation) -> list[Block]:
    """The parts of a page about one characterisation.

    :param done: what to show.
    :return: two blocks: results with tables, then curves.
    """
    faults = [f"{fault.what}: {fault.why}" for result in done.results for fault in result.faults]
    tables = []
    if done.rows:
        tables.append(published_table(done.rows))
    if done.quantities:
        head = ("quantity", "value", "standard deviation")
        rows = [(name, readable(one.value, one.unit), readable(one.sd, one.unit, 2)) for name, one in done.quantities.items()]
        what = "measured" if len(done.results) == 1 else f"mean and scatter of {len(done.results)} devices"
        tables.append(Table(what, head, rows))
    if len(done.results) == 1 and done.results[0].measured:
        rows = [
            (
                m.measurement.meaning,
                readable(m.value, m.measurement.unit),
                f"{readable(m.measurement.low, m.measurement.unit)} to {readable(m.measurement.high, m.measurement.unit)}",
                _kept(m.within),
            )
            for m in done.results[0].measured
        ]
        tables.append(Table("limits of the set-up", ("what", "value", "allowed", "kept"), rows))
    notes = list(dict.fromkeys(note for result in done.results for note in result.notes))
    plots = [*_device_plots(done), *done.results[0].plots]
    return [Block("Result", notes, faults, tables), Block("Curves", plots=plots)]


def published_table(rows: Sequence[Row]) -> Table:
    """Rows of a comparison as a table for the page.

    :param rows: of the comparison.
    :return: a table with a line for each row.
    """
    head = ("quantity", "section", "published", "ours", "role", "verdict", "why")
    return Table("against the source", head, [row.cells() for row in rows])


def _job(name: str, options: BenchOptions, out: Path | None, k: int, devices: int) -> BenchOptions:
    stem = name if devices == 1 else f"{name}-{k}"
    record = None if out is None else out / f"{stem}.h5"
    return replace(options, seed=options.seed + k, record=record)


def _over_devices(results: Sequence[RigResult]) -> dict[str, Quantity]:
    """Mean and standard deviation over the devices that have a value."""
    found: dict[str, list[Quantity]] = {}
    for result in results:
        for name, quantity in result.quantities.items():
            found.setdefault(name, []).append(quantity)
    return {
        name: Quantity(
            float(np.mean([one.value for one in several])),
            float(np.std([one.value for one in several], ddof=1)) if len(several) > 1 else several[0].sd,
            several[0].unit,
        )
        for name, several in found.items()
    }


def _device_plots(done: Characterisation) -> list[Plot]:
    """Each published quantity over the devices."""
    if len(done.results) == 1:
        return []
    plots = []
    for row in done.rows:
        several = [(k, r.quantities[row.name]) for k, r in enumerate(done.results) if row.name in r.quantities]
        k = [number for number, _ in several]
        shown = [series("measured", "measured", k, [q.value for _, q in several], [1.96 * q.sd for _, q in several])]
        if row.published is not None:
            error = [row.tolerance if row.tolerance is not None else 0.0] * len(k)
            shown.append(series("published", "published", k, [row.published] * len(k), error))
        plots.append(
            Plot(
                f"{done.rig}-devices-{row.name}",
                f"{row.quantity}, device by device",
                "device",
                f"{row.name} ({row.unit})",
                tuple(shown),
            )
        )
    return plots


def _write(done: Characterisation, out: Path, force: bool) -> list[Path]:
    name, files = done.rig, []
    for plot in [*_device_plots(done), *done.results[0].plots]:
        with replacing(out / f"{plot.name}.png", force) as partial:
            partial.write_bytes(png_bytes(plot))
        files.append(out / f"{plot.name}.png")
    page = Page(
        f"Characterisation: {name}",
        f"{done.port}, {len(done.results)} device{'s' if len(done.results) > 1 else ''}, "
        + ("no fault seen." if done.sound else "with faults or limits not kept: see below."),
        summary_blocks(done),
        {"rig": name, "port": done.port, "level": done.level or "the board's", "seed": done.seed, **made_with()},
    )
    with replacing(out / f"{name}.html", force) as partial:
        partial.write_text(render_page(page), encoding="utf-8")
    files.append(out / f"{name}.html")
    files.append(out / f"{name}.json")
    with replacing(files[-1], force) as partial:
        data = plain(replace(done, files=tuple(sorted(out.glob(f"{name}*.h5"))) + tuple(files)).to_json())
        partial.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return files


def _make_folder(out: Path, name: str, force: bool) -> None:
    make_folder(out)
    for taken in out.glob(f"{name}*.h5"):
        refuse_existing(taken, force)
    check_outputs({"page": out / f"{name}.html", "data": out / f"{name}.json"}, force)


def made_with() -> dict[str, Any]:
    """Version, commit, interpreter and machine, for the foot of a page.

    :return: ``version``, ``git_commit``, ``python`` and ``machine``.
    """
    made = provenance()
    return {key: made[key] for key in ("version", "git_commit", "python", "machine")}


def _kept(within: bool) -> str:
    return "yes" if within else "no"
