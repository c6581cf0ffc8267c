"""What one device makes felt when a host commands it by what it believes: each quantity's value, and how far it is off.

An error is the value less what the host believes (or in per cent of it). Where a host believes nothing (strength of an impact,
a contact that never comes) the value is compared with that of the nominal device, or with none at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from haptics.fidelity.notice import NOTICES, force_notice
from haptics.physics.latch.recoil import RECOIL, recoil_m_s2
from haptics.physics.thermal.one_node import DEFAULT_LIMIT_K
from haptics.units import STANDARD_GRAVITY_M_S2
from rigs.tolerance import brake
from rigs.tolerance.calibration import Host, published_host
from rigs.tolerance.draws import NOMINAL_DEVICE, Device
from rigs.tolerance.heat import THREE_HERTZ, TWO_HERTZ, Body, peak_rise_k, played, use_rise_k
from rigs.tolerance.pin import Pin, pin

FORCES_N = (1.0, 4.0, 10.0)
"""Commanded forces: light, middle, firm."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """One thing that is felt.

    :param name: for people.
    :param unit: of its error.
    :param value_unit: of the thing itself.
    :param jnd: just noticeable error, in ``unit``; 0 where any is noticed.
    :param jnd_source: provenance and source of ``jnd``.
    :param why: what a calibration can do about it.
    """

    name: str
    unit: str
    value_unit: str
    jnd: float
    jnd_source: str
    why: str


_LEAD = (
    "its travel on the bench would set its lead, but today all actuators share one (session.device_leads); "
    "what the skin does to it stays"
)
_STRENGTH = "volts and length of a contact pulse are fixed, so the host has nothing to set"
_HEAT = "tau, c and power of each actuator go into its heat account (glove.toml, tactiles.calibration)"
_FORCE = "k and threshold of each brake give the volts for a force (glove.toml); the bench's own error stays"
_ENGAGE = "capacitance and law of each brake give its time to charge; supply current and contact lag are not measured"


def _notice(name: str, unit: str, value_unit: str, observable: str, why: str) -> Quantity:
    row = NOTICES[observable]
    return Quantity(name, unit, value_unit, row.threshold, f"{row.provenance}: {row.source}", why)


def _force(force_n: float) -> Quantity:
    row = force_notice("index", published_host().volts_for(force_n))
    return Quantity(f"force for {force_n:g} N", "%", "N", row.threshold, f"{row.provenance}: {row.source}", _FORCE)


@cache
def quantities() -> tuple[Quantity, ...]:
    """All that is felt, in the order of ``felt``.

    :return: the same for every device.
    """
    return (
        _notice("arrival on the skin", "ms", "ms", "arrival time", _LEAD),
        _notice("arrival back", "ms", "ms", "arrival time", _LEAD),
        _notice("contact fails", "share", "share", "wrong final state", f"a pin that cannot hold cannot be made to; {_STRENGTH}"),
        _notice("impact on the skin", "%", "m/s", "impact speed", _STRENGTH),
        _notice("recoil of the release", "%", "g", "impact speed", _STRENGTH),
        _notice(f"warmth, {TWO_HERTZ.name}", "K", "K", "temperature", _HEAT),
        _notice("warmth, 44 a minute", "K", "K", "temperature", _HEAT),
        _notice(f"above the limit, {TWO_HERTZ.name}", "K", "K", "temperature", _HEAT),
        _notice(f"above the limit, {THREE_HERTZ.name}", "K", "K", "temperature", _HEAT),
        _notice(f"denied needlessly, {TWO_HERTZ.name}", "share", "share", "wrong final state", _HEAT),
        _notice(f"denied needlessly, {THREE_HERTZ.name}", "share", "share", "wrong final state", _HEAT),
        *(_force(force_n) for force_n in FORCES_N),
        _notice("brake closes to 90 %", "ms", "ms", "response time", _ENGAGE),
        _notice(
            "brake felt by a closing hand", "ms", "ms", "response time", "slack is how the strips are put on, each time anew"
        ),
        _notice("brake lets go", "ms", "ms", "release time", "the contact's lag is not measured, and the host cannot hasten it"),
    )


@dataclass(frozen=True, slots=True)
class Felt:
    """One quantity of one device; nan where there is nothing to feel.

    :param value: in the quantity's ``value_unit``.
    :param error: in the quantity's ``unit``.
    """

    value: float
    error: float


def felt(device: Device, host: Host) -> tuple[Felt, ...]:
    """Every quantity of one device under one host.

    :param device: as it really is.
    :param host: what the host assumes of it.
    :return: in the order of ``quantities``.
    """
    own = pin(device.latch, device.coil_supply_v)
    body = Body(device.thermal, own.power_w)
    return (*_moved(device, host), *_warmed(body, host.body), *_braked(device, host))


def _moved(device: Device, host: Host) -> tuple[Felt, ...]:
    own, nominal = pin(device.latch, device.coil_supply_v), _nominal_pin()
    fails = float(not (own.out.switched and own.back.switched))
    speed = own.back.impact_m_s / nominal.back.impact_m_s
    recoil_g = recoil_m_s2(0.0, relative_speed=speed, extrapolate=True) / STANDARD_GRAVITY_M_S2 if own.back.switched else math.nan
    return (
        _off(own.out.arrival_s * 1e3, host.out_s * 1e3),
        _off(own.back.arrival_s * 1e3, host.back_s * 1e3),
        Felt(fails, fails),
        _percent_off(own.out.impact_m_s, nominal.out.impact_m_s),
        _percent_off(recoil_g, RECOIL.peak_g),
    )


def _warmed(body: Body, believed: Body) -> tuple[Felt, ...]:
    as_played = [played(train, body, believed) for train in (TWO_HERTZ, THREE_HERTZ)]
    as_deserved = [played(train, body, body) for train in (TWO_HERTZ, THREE_HERTZ)]
    above = [max(0.0, one.peak_k - DEFAULT_LIMIT_K) for one in as_played]
    denied = [
        max(0, fair.contacts - one.contacts) / train.contacts
        for train, one, fair in zip((TWO_HERTZ, THREE_HERTZ), as_played, as_deserved, strict=True)
    ]
    return (
        _off(peak_rise_k(TWO_HERTZ, body), peak_rise_k(TWO_HERTZ, believed)),
        _off(use_rise_k(body), use_rise_k(believed)),
        *(Felt(value, value) for value in (*above, *denied)),
    )


def _braked(device: Device, host: Host) -> tuple[Felt, ...]:
    gain = device.volts_gain
    forces = [_percent_off(device.brake.full_force_n(0, gain * host.volts_for(force_n)), force_n) for force_n in FORCES_N]
    volts = host.volts_for(brake.TIMED_FORCE_N)
    own, believed = brake.times(device.brake, gain * volts), brake.times(host.brake, volts)
    return (
        *forces,
        _off(own.engage_s * 1e3, believed.engage_s * 1e3),
        _off(own.felt_s * 1e3, believed.felt_s * 1e3),
        _off(own.release_s * 1e3, believed.release_s * 1e3),
    )


@cache
def _nominal_pin() -> Pin:
    return pin(NOMINAL_DEVICE.latch, NOMINAL_DEVICE.coil_supply_v)


def _off(value: float, believed: float) -> Felt:
    return Felt(value, value - believed)


def _percent_off(value: float, believed: float) -> Felt:
    return Felt(value, 100.0 * (value / believed - 1.0))
