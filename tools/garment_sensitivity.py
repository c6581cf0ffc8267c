"""How much a garment depends on the numbers that nobody measured: ``python tools/garment_sensitivity.py``.

Changes one number at a time and reports the strain energy of the fully reinforced garment at the end of the motion, and how much
more than it a design stores for its area (thesis 5.6). At level `coarse` the whole table takes about a minute.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

from haptics.cli.program import run_program
from haptics.errors import HapticsError
from haptics.garments.bodies import MOTIONS
from haptics.garments.bodies.anny_body import AnnyBody
from haptics.garments.bodies.capsule import CapsuleBody
from haptics.garments.bodies.posing import FLESH, Flesh
from haptics.garments.design.rating import Unconverged, solved
from haptics.garments.design.topology import SMALLEST_COVERAGE, optimise
from haptics.garments.equilibrium.wearing import wear
from haptics.garments.garment import GARMENTS, LEVELS, cut_garment
from haptics.garments.materials import INTERFACE, Interface, Lame
from haptics.units import in_range, one_of

BODIES = {"capsule": CapsuleBody, "anny": AnnyBody}
NO_BULGE = Flesh(arm_bulge_m=0.0, thigh_bulge_m=0.0)
INTERFACES: Mapping[str, Sequence[float]] = {
    "attachment_n_m3": (1e4, 1e5, 1e6, 1e7),
    "contact_n_m3": (1e7, 1e9),
    "rounding_m": (5e-6, 80e-6),
    "regulariser_n_m3": (30.0, 3000.0),
}
CHANGES = (*INTERFACES, "lame", "bulge", "level")


@dataclass(frozen=True)
class Setting:
    """All that a row depends on.

    :param garment: one of ``GARMENTS``.
    :param motion: one of ``MOTIONS``.
    :param angle_deg: how far, degrees from straight; None takes the motion's default.
    :param body: one of ``BODIES``.
    :param level: one of ``LEVELS``.
    :param coverage: of the design, 0.01 to 1; None makes none.
    :param interface: what holds the garment to the body.
    :param lame: see ``Material.lame_n_m``.
    :param flesh: how far muscles bulge.
    """

    garment: str = "sleeve"
    motion: str = "elbow_flexion"
    angle_deg: float | None = None
    body: str = "capsule"
    level: str = "coarse"
    coverage: float | None = 0.15
    interface: Interface = INTERFACE
    lame: Lame = "plane"
    flesh: Flesh = field(default=FLESH)


@dataclass(frozen=True)
class Row:
    """What one change does.

    :param changed: what was changed, one of ``CHANGES``, or `nothing`.
    :param value: the number in SI units, or the name, that was put in place of the default.
    :param vertices: of the garment.
    :param energy_j: strain energy of the fully reinforced garment, J; None where it has no equilibrium.
    :param density_increase: of the design, no unit; None where none was asked for or found.
    """

    changed: str
    value: float | str
    vertices: int
    energy_j: float | None
    density_increase: float | None


def changes(setting: Setting, names: Sequence[str]) -> Iterator[tuple[str, float | str, Setting]]:
    """The setting as it is, then with one number changed.

    :param setting: what is changed.
    :param names: of ``CHANGES``.
    :return: yields the number's name, its value, the setting.
    """
    yield "nothing", "", setting
    for name in names:
        if name in INTERFACES:
            for value in INTERFACES[name]:
                yield name, value, replace(setting, interface=setting.interface.with_values(**{name: value}))
        elif name == "lame":
            yield name, "thesis", replace(setting, lame="thesis")
        elif name == "bulge":
            yield name, "none", replace(setting, flesh=NO_BULGE)
        else:
            for level in LEVELS:
                if level not in (setting.level, "reference"):
                    yield name, level, replace(setting, level=level)


def row(changed: str, value: float | str, setting: Setting) -> Row:
    """Wear the fully reinforced garment, and design.

    :param changed: see ``Row``.
    :param value: see ``Row``.
    :param setting: what is worn, and how.
    :return: energy and density; None, with a message on stderr, where there is no equilibrium.
    :raises InputError: a body that is not installed, a garment that cannot be cut.
    """
    body = BODIES[setting.body](flesh=setting.flesh)
    worn = wear(
        body,
        cut_garment(body, setting.garment, setting.level),
        MOTIONS[setting.motion],
        setting.angle_deg,
        interface=setting.interface,
        lame=setting.lame,
    ).simulation
    energy_j = density = None
    try:
        energy_j = solved(worn, worn.designable).energy_j
        density = optimise(worn, setting.coverage).final.density if setting.coverage else None
    except Unconverged as error:
        print(f"{changed} {value}: {error}", file=sys.stderr)
    return Row(changed, value, len(worn.rest.vertices_m), energy_j, density)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="What a garment's energy and its design's density owe to assumed numbers.")
    parser.add_argument("--garment", default="sleeve", help=f"{', '.join(GARMENTS)} [default: %(default)s]")
    parser.add_argument("--motion", default="elbow_flexion", help=f"{', '.join(MOTIONS)} [default: %(default)s]")
    parser.add_argument("--angle-deg", type=float, help="of the motion, degrees from straight [default: the motion's]")
    parser.add_argument("--body", default="capsule", help="capsule, or anny (extra `body`) [default: %(default)s]")
    parser.add_argument("--level", default="coarse", help=f"{', '.join(LEVELS)} [default: %(default)s]")
    parser.add_argument("--coverage", type=float, default=0.15, help="of the design, 0.01 to 1 [default: %(default)s]")
    parser.add_argument("--no-design", action="store_true", help="energies only")
    parser.add_argument("--only", default=",".join(CHANGES), help="what to change, separated by commas [default: %(default)s]")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        names = [one_of("only", name, CHANGES) for name in arguments.only.split(",")]
        motion = MOTIONS[one_of("motion", arguments.motion, tuple(MOTIONS))]
        setting = Setting(
            one_of("garment", arguments.garment, GARMENTS),
            motion.name,
            motion.checked_deg(arguments.angle_deg),
            one_of("body", arguments.body, tuple(BODIES)),
            one_of("level", arguments.level, tuple(LEVELS)),
            None if arguments.no_design else in_range("coverage", arguments.coverage, SMALLEST_COVERAGE, 1.0),
        )
        rows = []
        for one in changes(setting, names):
            rows.append(row(*one))
            if not arguments.json:
                _show(rows)
    except HapticsError as error:
        sys.exit(f"garment_sensitivity: {error}")
    if arguments.json:
        settings = {key: getattr(setting, key) for key in ("garment", "motion", "angle_deg", "body", "level", "coverage")}
        print(json.dumps({**settings, "rows": [asdict(one) for one in rows]}, indent=1))


def _show(rows: Sequence[Row]) -> None:
    """The last row, with what it differs from the first by."""
    if len(rows) == 1:
        print(f"{'changed':<18}{'to':>10}{'vertices':>10}{'energy, J':>12}{'':>9}{'density':>9}{'':>9}")
    last, first = rows[-1], rows[0]
    value = last.value if isinstance(last.value, str) else f"{last.value:g}"
    cells = [f"{last.changed:<18}{value:>10}{last.vertices:>10}"]
    for now, then, digits, width in (
        (last.energy_j, first.energy_j, 4, 12),
        (last.density_increase, first.density_increase, 3, 9),
    ):
        cells.append(f"{'-' if now is None else format(now, f'.{digits}g'):>{width}}")
        cells.append(
            f"{'' if len(rows) == 1 or now is None or then is None else format(100 * (now / then - 1), '+.1f') + ' %':>9}"
        )
    print("".join(cells), flush=True)


if __name__ == "__main__":
    run_program(main)
