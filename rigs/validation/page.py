"""A validation as one page and one JSON file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from haptics.cli.show import plain
from haptics.recording.output import check_outputs, make_folder, replacing
from rigs.characterize import made_with, published_table, summary_blocks
from rigs.judge import Judgement
from rigs.reference import contradictions
from rigs.report import Block, Page, render_page
from rigs.report.page import Table
from rigs.result import readable
from rigs.validation.validate import Validation

_FILES = ("validation.html", "validation.json")


def refuse_taken(out: Path, force: bool) -> None:
    """Make the folder, and refuse to write over what is there.

    :param out: folder for page and data.
    :param force: overwrite files that exist.
    :raises InputError: a file exists and ``force`` is not given, or no folder can be made.
    """
    make_folder(out)
    check_outputs({name: out / name for name in _FILES}, force)


def write_validation(found: Validation, out: Path, force: bool) -> list[Path]:
    """``validation.html`` and ``validation.json`` in a folder.

    :param found: to write.
    :param out: folder, made if need be.
    :param force: overwrite files that exist.
    :return: the page, then the data.
    :raises InputError: as ``refuse_taken``.
    """
    refuse_taken(out, force)
    page, data = (out / name for name in _FILES)
    with replacing(page, force) as partial:
        partial.write_text(render_page(validation_page(found)), encoding="utf-8")
    with replacing(data, force) as partial:
        partial.write_text(json.dumps(plain(found.to_json()), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return [page, data]


def validation_page(found: Validation) -> Page:
    """The table, the curves of each rig, the judge, and where the source disagrees with itself.

    :param found: to show.
    :return: the page, not yet rendered.
    """
    counts = Table("rows by role and verdict", ("role and verdict", "rows"), list(found.counts.items()))
    warnings = [f"{row.quantity}: {row.why}" for row in found.rows if row.fails]
    blocks = [Block("Published against ours", (), warnings, [counts, published_table(found.rows)])]
    for done in found.characterisations:
        first, curves = summary_blocks(done)
        blocks.append(Block(f"Rig: {done.rig}", first.text, first.warnings, first.tables, curves.plots))
    if found.judgements is None:
        blocks.append(Block("ngspice", ["There is no ngspice on this machine: models were not compared with circuits."]))
    else:
        blocks.append(Block("ngspice", tables=[judge_table(found.judgements)]))
    head = ("where", "what follows", "used here")
    rows = [(", ".join(p.section for p in one.written), one.follows, one.used_here) for one in contradictions()]
    blocks.append(Block("Where the source disagrees with itself", tables=[Table("contradictions", head, rows)]))
    verdict = "Every validation row agrees, or the source contradicts itself there." if found.sound else "Not everything agrees."
    return Page("Validation", verdict, blocks, made_with())


def judge_table(judgements: Sequence[Judgement]) -> Table:
    """The comparison with ngspice as a table.

    :param judgements: of all cases.
    :return: a line for each.
    """
    head = ("circuit", "quantity", "rms error", "worst error", "allowed", "verdict")
    rows = [
        (
            one.case,
            one.quantity,
            *(readable(error, one.unit, 3) for error in (one.error_rms, one.error_worst, one.allowed)),
            "agrees" if one.agrees else "differs",
        )
        for one in judgements
    ]
    return Table("models against ngspice", head, rows)
