"""``haptics garment``: find a garment's reinforcement, rate it over a motion, and write what the cutter needs (thesis 5)."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from haptics.cli.show import print_json, print_pairs, print_table
from haptics.cli.typed import Commands

if TYPE_CHECKING:
    from haptics.garments.design.designs import DesignStep
    from haptics.garments.design.topology import Progress
    from haptics.garments.evaluation import Evaluation

app = Commands(help="Design kinesthetic garments, evaluate them, and export them to a cutter.", no_args_is_help=True)
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]
Force = Annotated[bool, typer.Option("--force", help="overwrite files that exist")]
Body = Annotated[str, typer.Option(help="body: capsule, or anny (extra `body`)")]
Phenotype = Annotated[list[str] | None, typer.Option("--phenotype", help="NAME=VALUE of the body's shape; repeat (see `bodies`)")]
_LEVELS = "mesh: coarse (0.5k vertices), draft (1.8k), standard (7k), reference (28k)"
Level = Annotated[str, typer.Option(help=_LEVELS)]
OwnLevel = Annotated[str | None, typer.Option("--level", help=f"{_LEVELS} [default: draft; a mesh file's own]")]
_GARMENTS = "sleeve, knee_sleeve, shirt, long_shirt, shorts, or a mesh drawn around the straight body: .obj .ply .stl"
Units = Annotated[str | None, typer.Option(help="unit of a mesh file: m, dm, cm, mm, in, ft [default: m]")]
Up = Annotated[str | None, typer.Option(help="axis of a mesh file that points up: x, y, z [default: z]")]
Angle = Annotated[float | None, typer.Option(help="angle of the motion from straight, deg [default: the motion's]")]
Solver = Annotated[str | None, typer.Option(help="sparse solver (see `bodies`) [default: the fastest installed]")]
Lame = Annotated[str, typer.Option(help="Lamé constants: plane (plane stress) or thesis (of a solid)")]
Step = Annotated[int | None, typer.Option(help="number of the design in the sequence [default: the one asked for]")]
OfCoverage = Annotated[float | None, typer.Option("--coverage", help="or the design of this coverage, 0 to 1")]


@app.command("design")
def design(
    garment: Annotated[str, typer.Option(help=_GARMENTS)],
    motion: Annotated[str, typer.Option(help="motion that it resists, such as elbow_flexion (see `bodies`)")],
    coverage: Annotated[float, typer.Option(help="share of the designable area that is reinforced, 0.01 to 1")],
    angle_deg: Angle = None,
    level: OwnLevel = None,
    body: Body = "capsule",
    phenotype: Phenotype = None,
    solver: Solver = None,
    lame: Lame = "plane",
    units: Units = None,
    up: Up = None,
    out: Annotated[Path | None, typer.Option(help="folder to write to [default: GARMENT-MOTION-TIME]")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="go on with the designs in --out, or begin where there are none")
    ] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Find the reinforcement that resists a motion best for its area, and rate it beside a hand-drawn line and X."""
    from haptics.errors import InputError
    from haptics.garments.design.job import DesignJob
    from haptics.garments.design_run import run_design

    if resume and (out is None or force):
        raise InputError("--resume goes on with the designs in a folder: pass --out DIR with it, and no --force")
    level = level or level_of(garment)
    worn_by = body, phenotype_of(phenotype)
    job = DesignJob(garment, motion, coverage, angle_deg, level, *worn_by, solver, cast(Any, lame), units, up)
    folder = out or Path(f"{Path(garment).stem}-{motion}-{time.strftime('%Y%m%d-%H%M%S')}")
    with watched(coverage, silent=json) as (progress, say):
        report = run_design(job, folder, resume, force, progress, say, _warn)
    data = report.to_json()
    if json:
        print_json(data)
    else:
        _show_design(data)
    if report.faults:
        raise typer.Exit(1)


@app.command("evaluate")
def evaluate(
    design: Annotated[Path, typer.Argument(help="folder or file of `design`; or a mask: .png .obj .ply .stl .txt .npz")],
    steps: Annotated[int, typer.Option(help="number of parts that the motion is divided into")] = 18,
    motion: Annotated[str | None, typer.Option(help="another motion than the design's; needed with a mask")] = None,
    angle_deg: Angle = None,
    against: Annotated[str | None, typer.Option(help="rate beside: line, x or a mask file, with equal area")] = None,
    step: Step = None,
    coverage: OfCoverage = None,
    garment: Annotated[str | None, typer.Option(help="with a mask: what it is drawn on")] = None,
    body: Annotated[str | None, typer.Option(help="with a mask: the body [default: capsule]")] = None,
    phenotype: Phenotype = None,
    level: Annotated[str | None, typer.Option(help="with a mask: the mesh [default: draft; a mesh file's own]")] = None,
    units: Annotated[
        str | None, typer.Option(help="unit of the mesh files given here: m, dm, cm, mm, in, ft [default: m]")
    ] = None,
    up: Annotated[str | None, typer.Option(help="axis of them that points up: x, y, z [default: z]")] = None,
    picture: Annotated[Path | None, typer.Option(help="also draw energy and torque by angle, PNG (extra `report`)")] = None,
    rrd: Annotated[Path | None, typer.Option(help="also write the motion for rerun (extra `view`)")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Print energy and joint torque of a design at every angle of a motion, and its energy density beside another's."""
    from haptics.errors import InputError
    from haptics.garments.design.job import DesignJob
    from haptics.garments.design.masks import MASKS
    from haptics.garments.evaluation import evaluate_design
    from haptics.garments.garment import refuse_frame
    from haptics.meshes import FORMATS
    from haptics.recording.output import check_outputs
    from haptics.units import one_of

    for option, path, ending in (("picture", picture, ".png"), ("rrd", rrd, ".rrd")):
        if path is not None:
            one_of(f"ending of {option} {path.name}", path.suffix.lower(), (ending,))
    check_outputs({"picture": picture, "rrd": rrd}, force, {"the design": design})
    meshes = [name for name in (str(design), against, garment) if name and Path(name).suffix.lower() in FORMATS]
    if not meshes:
        refuse_frame(against or str(design), units, up)
    job = None
    if design.suffix.lower() in MASKS:
        if garment is None or motion is None:
            raise InputError(f"{design} is a mask, which does not record what is worn; pass --garment and --motion with it")
        frame = (units, up) if garment in meshes else (None, None)
        worn_by = body or "capsule", phenotype_of(phenotype), None, "plane"
        job = DesignJob(garment, motion, 1.0, angle_deg, level or level_of(garment), *worn_by, *frame)
    elif garment or body or level or phenotype:
        raise InputError(
            f"{design} already records its garment and body; pass --garment, --body, --phenotype and --level only with a mask"
        )
    with _busy("following the motion", silent=json):
        found = evaluate_design(design, job, motion, angle_deg, against, steps, step, coverage, units, up, _warn)
        files = _evaluation_files(found, picture, rrd, force)
    if json:
        print_json(found.to_json() | {"files": [str(path) for path in files]})
    else:
        _show_evaluation(found, files)
    if not found.converged:
        raise typer.Exit(1)


@app.command("export")
def export(
    design: Annotated[Path, typer.Argument(help="folder or file of `design`")],
    out: Annotated[Path, typer.Option(help="folder to write to")],
    step: Step = None,
    coverage: OfCoverage = None,
    sheet_width_mm: Annotated[float, typer.Option(help="width of the cutter's sheet, mm")] = 610.0,
    sheet_length_mm: Annotated[float, typer.Option(help="longest sheet, mm")] = 3000.0,
    seam_allowance_mm: Annotated[float, typer.Option(help="added round each piece of cloth, mm")] = 0.0,
    smallest_feature_mm: Annotated[float, typer.Option(help="narrower places are circled, mm")] = 2.0,
    mirrored: Annotated[bool, typer.Option("--mirrored", help="seen from inside, as transfer film is cut")] = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write a design for the cutter (SVG and DXF, millimetres, full size) and for everything else (OBJ, PLY)."""
    from haptics.garments.design.job import open_designs
    from haptics.garments.export import export_design
    from haptics.garments.pattern import PatternOptions

    options = PatternOptions(
        sheet_width_m=sheet_width_mm / 1e3,
        sheet_length_m=sheet_length_mm / 1e3,
        seam_allowance_m=seam_allowance_mm / 1e3,
        smallest_feature_m=smallest_feature_mm / 1e3,
        mirrored=mirrored,
    )
    with _busy("laying the pieces flat", silent=json):
        data = export_design(open_designs(design), out, step, coverage, options, force).to_json()
    if json:
        print_json(data)
        return
    print_table(
        f"pieces of step {data['step']}, {100 * data['coverage']:.1f} % covered",
        ("piece", "cloth, cm²", "reinforcement, cm²", "lengths off, rms", "at most", "narrow places"),
        (
            (
                *(p["name"], p["area_cm2"], p["reinforcement_cm2"]),
                *(f"{100 * p['distortion_rms']:.2f} %", f"{100 * p['distortion_largest']:.1f} %", p["narrow_places"]),
            )
            for p in data["pieces"]
        ),
    )
    print_table(
        "seams",
        ("seam", "pieces", "on the body, cm", "on the pieces, cm"),
        ((s["number"], " to ".join(s["pieces"]), s["length_cm"], s["sides_cm"]) for s in data["seams"]),
    )
    _show_notes(data["notes"])
    print_pairs("reinforcement", {"on the body, cm²": data["reinforced_cm2"], "to cut, cm²": data["cut_cm2"]})
    _show_files(data["files"])


@app.command("bodies")
def bodies(
    export: Annotated[Path | None, typer.Option(help="write a body as .obj, to draw a garment around (metres, z up)")] = None,
    body: Annotated[str | None, typer.Option(help="with --export: capsule, or anny (extra `body`) [default: capsule]")] = None,
    phenotype: Phenotype = None,
    motion: Annotated[str | None, typer.Option(help="with --export: put at the angle of a motion [default: straight]")] = None,
    angle_deg: Angle = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """List bodies, garments, motions, levels, materials and solvers; or write a body to draw around."""
    from haptics.errors import InputError

    if export is not None:
        from haptics.garments.bodies import open_body
        from haptics.garments.export import export_body

        data = export_body(open_body(body or "capsule", phenotype_of(phenotype)), export, motion, angle_deg, force)
        if json:
            print_json(data)
        else:
            print_pairs(
                f"body {data['body']}", {key: data[key] for key in ("pose", "units", "up", "faces", "vertices", "triangles")}
            )
            _show_notes(data["notes"])
            _show_files(data["files"])
        return
    if body or phenotype or motion or angle_deg is not None:
        raise InputError("--body, --phenotype, --motion and --angle-deg choose the body to write; pass them only with --export")
    from haptics.garments.catalogue import catalogue

    found = catalogue()
    if json:
        print_json(found)
        return
    print_table(
        "bodies",
        ("name", "what", "here", "shape by --phenotype NAME=VALUE (low to high, default)"),
        (
            (
                *(b["name"], b["what"], b["get"] or "yes"),
                ", ".join(f"{p['name']} {p['low']:g} to {p['high']:g}, {p['default']:.3g}" for p in b["phenotype"]),
            )
            for b in found["bodies"]
        ),
    )
    print_table("garments", ("name", "openings"), ((g["name"], g["openings"]) for g in found["garments"]))
    print_table(
        "motions (angles from straight)",
        ("name", "default, deg", "allowed, deg", "from", "joints"),
        (
            (m["name"], m["default_deg"], f"{m['smallest_deg']:g} to {m['largest_deg']:g}", m["from"], m["joints"])
            for m in found["motions"]
        ),
    )
    print_table("levels", ("name", "vertices, about"), ((x["name"], x["vertices_about"]) for x in found["levels"]))
    print_table(
        "materials",
        ("of", "name", "value", "unit", "known", "source"),
        ((m["of"], m["name"], m["value"], m["unit"], m["provenance"], m["source"]) for m in found["materials"]),
    )
    print_table(
        "solvers, fastest first",
        ("name", "here", "licence", "to get it"),
        ((s["name"], "yes" if s["installed"] else "no", s["licence"], s["get"]) for s in found["solvers"]),
    )


@app.command("patch")
def patch(
    design: Annotated[str, typer.Option(help="none, full, strip, line or x")],
    coverage: Annotated[float, typer.Option(help="share that is reinforced, 0 to 1; none and full have their own")] = 0.4,
    strain: Annotated[float, typer.Option(help="strain: pull over length, 0 to 2")] = 0.1,
    lame: Lame = "plane",
    angle_deg: Annotated[float, typer.Option(help="angle of a strip or line from the pull, deg")] = 0.0,
    elements: Annotated[int, typer.Option(help="number of triangles, about")] = 4000,
    json: Json = False,
) -> None:
    """Pull a 10 cm square of cloth that is held at two ends: the force, as on the bench (thesis 5.6.1)."""
    from haptics.garments.patch.clamped_patch import pull

    found = pull(design, coverage, strain, cast(Any, lame), angle_deg, elements)
    data = {
        "force_n": found.force_n,
        "elements": found.elements,
        "design": design,
        "coverage": found.coverage,
        "strain": strain,
        "lame": lame,
        "angle_deg": angle_deg,
        "energy_j": found.energy_j,
        "converged": found.converged,
    }
    if json:
        print_json(data)
    else:
        print_pairs("patch between two clamps", data)
    if not found.converged:
        raise typer.Exit(1)


def level_of(garment: str) -> str:
    """The level where none is asked for."""
    from haptics.garments.garment import OWN, mesh_of

    return "draft" if mesh_of(garment) is None else OWN


def phenotype_of(pairs: list[str] | None) -> dict[str, float]:
    from haptics.errors import InputError

    chosen: dict[str, float] = {}
    for pair in pairs or ():
        name, _, value = pair.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number) or name in chosen:
            raise InputError(f"phenotype = {pair!r} is not allowed; allowed: NAME=NUMBER, once for each name, such as height=0.7")
        chosen[name] = number
    return chosen


@contextmanager
def watched(coverage: float, silent: bool) -> Iterator[tuple[Progress | None, Callable[[str], None] | None]]:
    """A bar on standard error: each step's numbers, and what is done besides. Neither where no person looks at it."""
    if silent or not sys.stderr.isatty():
        yield None, None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress as Bar, TextColumn, TimeElapsedColumn

    from haptics.garments.design.topology import steps_about

    about = steps_about(coverage)
    columns = (TextColumn("step {task.completed:.0f} of about {task.total:.0f}"), BarColumn(), TextColumn("{task.description}"))
    with Bar(*columns, TimeElapsedColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=about)

        def progress(number: int, step: DesignStep) -> None:
            what = f"coverage {100 * step.coverage:.1f} %, density × {step.density:.2f}, residual {step.residual_n:.1e} N"
            bar.update(task, completed=number + 1, total=max(about, number + 1), description=what)

        yield progress, lambda what: bar.update(task, description=what)


def _warn(what: str) -> None:
    """Printed before it takes long, to a person as to a program's log: the answer on standard output comes only after it."""
    print(f"note: {what}", file=sys.stderr, flush=True)


def _busy(what: str, silent: bool) -> AbstractContextManager[Any]:
    """Says what is being done on standard error, where a person looks at it."""
    if silent or not sys.stderr.isatty():
        return nullcontext()
    from rich.console import Console

    return Console(stderr=True).status(what)


def _show_design(data: dict[str, Any]) -> None:
    seconds = data["seconds_per_step"]
    print_pairs(
        f"{data['garment']} against {data['motion']} by {data['angle_deg']:g} deg, body {data['body']}",
        {
            "mesh": f"{data['level']}: {data['vertices']} vertices, {data['triangles']} triangles",
            "steps": f"{data['converged_steps']} of {data['steps']} converged",
            "force left over": f"at most {data['largest_residual_n']:.1e} N",
            "coverage": f"{100 * data['coverage']:.2f} % (asked for {100 * data['coverage_asked']:g} %)",
            "energy": f"{data['energy_j']:.4g} J",
            "solver": data["solver"],
            "time a step": "-" if seconds["median"] is None else f"median {seconds['median']:.2f} s, 95 % {seconds['p95']:.2f} s",
        },
    )
    drawn = [(f"drawn {shape}", data[shape]) for shape in ("line", "x")]
    print_table(
        "energy density over that of the fully reinforced garment",
        ("design", "coverage", "reinforced part (5.6)", "whole garment (eq. 6.5)", "place"),
        [
            ("designed", f"{100 * data['coverage']:.2f} %", data["density_increase"], data["density_increase_eq65"], ""),
            *(
                (name, f"{100 * one['coverage']:.2f} %", one["density"], one["density_eq65"], one["place"])
                for name, one in drawn
                if one["density"] is not None
            ),
        ],
    )
    for fault in data["faults"]:
        print(f"fault: {fault}")
    _show_notes(data["notes"])
    _show_files(data["files"])


def _show_evaluation(found: Evaluation, files: list[Path]) -> None:
    rated = [found.rated] if found.against is None else [found.rated, found.against]
    print_pairs("what is worn", {key: value for key, value in found.settings.items()})
    print_table(
        "energy density over that of the fully reinforced garment, at the end of the motion",
        ("design", "coverage", "reinforced part (5.6)", "whole garment (eq. 6.5)", "place"),
        ((r.name, f"{100 * r.coverage:.2f} %", r.density, r.density_eq65, r.place) for r in rated),
    )
    print_table(
        "by angle",
        ("angle, deg", *(f"{r.name}: {what}" for r in rated for what in ("energy, J", "torque, N m"))),
        (
            (float(angle), *(float(v[k]) for r in rated for v in (r.motion.energy_j, r.motion.torque_n_m)))
            for k, angle in enumerate(found.rated.motion.angles_deg)
        ),
    )
    for r in rated:
        for angle, state in zip(r.motion.angles_deg, r.motion.equilibria, strict=True):
            if not state.converged:
                print(f"fault: {r.name} at {angle:g} deg: no equilibrium, {state.residual_n:.2g} N are left over")
    _show_notes(found.notes)
    if files:
        _show_files([str(path) for path in files])


def _evaluation_files(found: Evaluation, picture: Path | None, rrd: Path | None, force: bool) -> list[Path]:
    files = []
    if picture is not None:
        from haptics.garments.views.pictures import draw_motion

        curves = {r.name: r.motion for r in (found.rated, found.against) if r is not None}
        title = f"{found.worn.garment.name}, {found.settings['motion']}, body {found.settings['body']}"
        files.append(draw_motion(curves, title, picture, force))
    if rrd is not None:
        from haptics.garments.views.rrd import write_motion_rrd

        files.append(write_motion_rrd(found.worn, found.rated.motion, rrd, force))
    return files


def _show_notes(notes: Iterable[str]) -> None:
    for note in notes:
        print(f"note: {note}")


def _show_files(files: list[str]) -> None:
    print("\n".join(["files:", *(f"  {path}" for path in files)]))
