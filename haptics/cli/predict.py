"""``haptics predict``: a bench person's calculator, with uncertainty and validity.

Outside the range where a figure was measured or stated the answer says ``valid: false`` with reasons, or ``extrapolated`` with
what lies outside a fit, and exits 0; nonsense exits 2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from haptics.cli.show import plain, print_json, print_pairs, print_table
from haptics.cli.typed import Commands

if TYPE_CHECKING:
    from haptics.physics.brake.law_choice import LawEvidence

app = Commands(help="Predict heat, switching and recoil of a tactor, and what a brake holds.", no_args_is_help=True)
Json = Annotated[bool, typer.Option("--json", help="print one JSON object")]


@app.command("thermal")
def thermal(
    rate_per_min: Annotated[float | None, typer.Option(help="switches a minute, 1/min")] = None,
    pulse_ms: Annotated[float, typer.Option(help="coil time of one switch, ms")] = 10.0,
    limit_k: Annotated[float | None, typer.Option(help="limit of the temperature rise, K")] = None,
    minutes: Annotated[float | None, typer.Option(help="time from cold to look at, min [default: for ever]")] = None,
    burst_ms: Annotated[float | None, typer.Option(help="length of a burst, ms, instead of single switches")] = None,
    burst_hz: Annotated[float, typer.Option(help="cycles a second within a burst, Hz")] = 200.0,
    every_s: Annotated[float | None, typer.Option(help="time from burst to burst, s")] = None,
    json: Json = False,
) -> None:
    """Predict how warm a nominal tactor gets under a regular train of switches or bursts (thesis 3.5.2).

    A glove takes one that nobody calibrated for the warmest within tolerance, and so denies sooner (docs/explanation/heat.md).
    """
    from haptics.physics.thermal.trains import predict_thermal

    prediction = predict_thermal(
        rate_per_min,
        pulse_s=pulse_ms / 1e3,
        limit_k=limit_k,
        minutes=minutes,
        burst_s=None if burst_ms is None else burst_ms / 1e3,
        burst_hz=burst_hz,
        every_s=every_s,
    )
    _answer("heat of a nominal tactor", plain(prediction), json)


@app.command("latch")
def latch(
    pulse_ms: Annotated[float, typer.Option(help="pulse length, ms")] = 10.0,
    volts: Annotated[float, typer.Option(help="voltage at the coil, V")] = 5.0,
    direction: Annotated[str, typer.Option(help="off-on (toward the skin) or on-off")] = "off-on",
    rise_k: Annotated[float, typer.Option(help="temperature of the coil above the room's, K")] = 0.0,
    level: Annotated[str, typer.Option(help="model level: event, table, dynamic or reference")] = "dynamic",
    json: Json = False,
) -> None:
    """Predict what one pulse does to a tactor: whether it switches, when the pin arrives, what it costs (thesis 3.4.3, 3.4.5)."""
    from haptics.physics.latch.pulse import switch

    outcome = plain(switch(pulse_ms / 1e3, volts, direction, rise_k, level))
    arrival_s = outcome.pop("arrival_s")
    min_s = outcome.pop("min_pulse_s")
    answer = {
        "switched": outcome.pop("switched"),
        "arrival_ms": None if arrival_s is None else arrival_s * 1e3,
        "impact_m_s": outcome.pop("impact_m_s"),
        "energy_j": outcome.pop("energy_j"),
        "min_pulse_ms": None if min_s is None else min_s * 1e3,
        **outcome,
    }
    _answer("one pulse", answer, json)


@app.command("brake")
def brake(
    volts: Annotated[float | None, typer.Option(help="amplitude, V")] = None,
    force_n: Annotated[float | None, typer.Option(help="force wanted, N, instead of volts: predicts the volts")] = None,
    finger: Annotated[str, typer.Option(help="finger whose fit is used: index or thumb")] = "index",
    strips: Annotated[int, typer.Option(help="number of stacked pairs of strips")] = 1,
    overlap_cm2: Annotated[float, typer.Option(help="overlap of the strips, cm²")] = 11.0,
    thickness_um: Annotated[float, typer.Option(help="thickness of the dielectric, µm")] = 13.0,
    hz: Annotated[float, typer.Option(help="frequency of the bipolar square wave, Hz")] = 20.0,
    law: Annotated[str, typer.Option(help="force law: threshold, ideal or closing_gap")] = "threshold",
    level: Annotated[str, typer.Option(help="model level of the pull: static, lagged, dynamic or reference")] = "lagged",
    json: Json = False,
) -> None:
    """Predict force, charge, power and response of an electrostatic brake (thesis 4.4, 4.7)."""
    from haptics.errors import InputError
    from haptics.physics.brake.predict import predict_brake, predict_volts
    from haptics.physics.brake.pull import predicted_pull

    if (volts is None) == (force_n is None):
        raise InputError(f"give either --volts or --force-n; {'neither' if volts is None else 'both'} came")
    geometry: dict[str, Any] = {
        "finger": finger,
        "strips": strips,
        "overlap_m2": overlap_cm2 * 1e-4,
        "thickness_m": thickness_um * 1e-6,
        "frequency_hz": hz,
        "law": law,
    }
    prediction = predict_brake(volts, **geometry) if volts is not None else predict_volts(force_n or 0.0, **geometry)
    pulled = plain(predicted_pull(prediction, level))
    _answer("electrostatic brake", plain(prediction) | pulled, json)


@app.command("recoil")
def recoil(
    surface: Annotated[str, typer.Option(help="what the magnet lands on: bare, silicone or foam")] = "foam",
    relative_speed: Annotated[float, typer.Option(help="impact speed as a multiple of the nominal one")] = 1.0,
    length_ms: Annotated[float, typer.Option(help="length of the sampled envelope, ms")] = 10.0,
    sample_hz: Annotated[float, typer.Option(help="sampling rate, Hz")] = 3200.0,
    json: Json = False,
) -> None:
    """Predict the envelope of the vibration when a pin goes back (thesis 3.5.1)."""
    from haptics.physics.latch.recoil import predict_recoil

    _answer("recoil", plain(predict_recoil(surface, relative_speed, length_ms / 1e3, sample_hz)), json)


@app.command("laws")
def laws(
    finger: Annotated[str, typer.Option(help="finger whose points are used: index or thumb")] = "index", json: Json = False
) -> None:
    """Compare the brake's force laws, fitted to the published points, and print which is the default (thesis 4.7, 4.8)."""
    from haptics.physics.brake.law_choice import SIMPLEST_FIRST, compare_laws, law_evidence

    evidence, comparison = [law_evidence(law, finger) for law in SIMPLEST_FIRST], compare_laws()
    if json:
        print_json({"finger": finger, "laws": evidence, "comparison": comparison})
        return
    for one in evidence:
        print_pairs(f"{one.law}{' (default)' if one.default else ''}, {finger}", _summary(one))
        head = ("amplitude V", "measured, N", "residual, N", "residual, sd", "left out: error, N", "left out: error, sd", "note")
        rows = [
            (at.volts, at.measured_n, at.residual_n, at.residual_sigma, out.error_n, out.error_sigma, out.note)
            for at, out in zip(one.points, one.left_out, strict=True)
        ]
        print_table("published points", head, rows)
    print(comparison.why)


def _summary(one: LawEvidence) -> dict[str, Any]:
    """One law's fit without its points, as pairs for a person."""
    fitted = {name: f"{value:.5g} ± {sd:.2g}" for name, value, sd in zip(one.names, one.values, one.sds, strict=True)}
    covariance = {f"covariance, row {row + 1}": values for row, values in enumerate(one.covariance)}
    keys = ("chi2", "degrees_of_freedom", "reduced_chi2", "p_value", "left_out_rms_n", "left_out_rms_sigma", "shipped_chi2")
    return (
        fitted
        | covariance
        | {key: getattr(one, key) for key in keys}
        | {f"valid: {k}": v for k, v in plain(one.validity).items()}
    )


def _answer(title: str, answer: dict[str, Any], json: bool) -> None:
    if json:
        print_json(answer)
        return
    print_pairs(title, {name: value for name, value in answer.items() if value not in (None, [], ())})
    for reason in answer.get("reasons", ()):
        print(f"not valid: {reason}")
    for departure in answer.get("extrapolated", ()):
        print(f"extrapolated: {departure}")
