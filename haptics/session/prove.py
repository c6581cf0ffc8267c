"""A plan proved: a hand played through the planned run and through an all-reference run, and the two compared."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from haptics.errors import InputError
from haptics.judging.proof import Played, Proof, compare
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene
from haptics.session.session import Session

ALL_REFERENCE = {"latch": "reference", "brake": "reference"}


def prove_plan(scene: str, hand: str, configuration: Configuration, options: RunOptions) -> Proof:
    """Run twice, in virtual time, and compare.

    :param scene: a shipped scene's name, or a file.
    :param hand: a shipped motion's name, or a file.
    :param configuration: of the glove.
    :param options: of the run; its levels and tolerance are those under proof.
    :return: what differs, and whether anybody could notice.
    :raises InputError: a scene, hand or option that cannot be used, or real time, in which no two runs are alike.
    """
    if options.realtime or options.port_tactiles or options.port_brake:
        raise InputError("a plan is proved on the simulated glove in virtual time; leave out realtime and ports")
    planned, report, planned_s = _run(scene, hand, configuration, options)
    reference, _, reference_s = _run(scene, hand, configuration, replace(options, levels=ALL_REFERENCE))
    rows = compare(_played(planned, configuration), _played(reference, configuration), options.tolerance_jnd)
    levels = {row["model"]: row["level"] for row in report["plan"]}
    return Proof(report["scene"], hand, options.tolerance_jnd, levels, rows, planned_s, reference_s)


def _run(scene: str, hand: str, configuration: Configuration, options: RunOptions) -> tuple[Session, dict[str, Any], float]:
    sessions: list[Session] = []
    began = time.process_time()
    report = run_scene(scene, hand, configuration, replace(options, record=False, watch=sessions.append))
    return sessions[0], report, time.process_time() - began


def _played(session: Session, configuration: Configuration) -> Played:
    array, brakes, brake = session.devices.tactiles, session.devices.brakes, configuration.brake
    asked = None if array is None else [(r.site, r.kind, r.played, r.reason) for r in session.results]
    if brakes is None:
        return Played(session.truth, asked, None)
    fingers = ("index", "thumb")
    driven = tuple((name, brake.amplitude_v if name in fingers else brake.clutch_amplitude_v) for name in brakes.channels)
    return Played(session.truth, asked, driven)
