"""A glove for scripts: ``haptics.open``, plain calls, and off again however the script ends."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from haptics.devices import TactilesDriver
from haptics.errors import InputError
from haptics.session.configuration import BrakeConfiguration, load_configuration
from haptics.session.glove import TICK_NS, Glove
from haptics.time import NS_PER_S, seconds_to_ns
from haptics.units import in_range


@dataclass(frozen=True, slots=True)
class GloveState:
    """What the host knows of the glove now.

    ``rise_k`` is an upper bound of each actuator's rise, and ``headroom_k`` a lower bound of the room under its limit: an
    actuator without calibration is booked as the warmest within tolerance (``docs/explanation/heat.md``). ``notes``: limits that
    a board holds tighter than configured, coils that started warm.
    """

    time_ns: int
    rise_k: dict[str, float]
    headroom_k: dict[str, float]
    pins_out: tuple[str, ...]
    volts: dict[str, float]
    capacitance_pf: dict[str, int]
    armed: tuple[str, ...]
    faults: tuple[str, ...]
    notes: tuple[str, ...] = ()


class OpenGlove:
    """A glove for scripts: plain calls, in the background's real time or in stepped virtual time.

    Use as a context manager; leaving it by any way goes off.
    """

    def __init__(self, glove: Glove, brake: BrakeConfiguration):
        self._glove, self._brake = glove, brake
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="glove", daemon=True) if glove.realtime else None

    def __enter__(self) -> OpenGlove:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _serve(self) -> None:
        while not self._closing.wait(TICK_NS / NS_PER_S):
            with self._lock:
                self._glove.follow(self._glove.now_ns())
                self._glove.tick(self._glove.now_ns())

    def arm(self) -> None:
        """Arm every board.

        :raises HapticsError: a board would not.
        """
        with self._lock:
            self._glove.arm()

    def contact(self, site: str) -> None:
        """The pin of a site comes out and stays.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._lock:
            self._array().contact(site, self._glove.now_ns())

    def release(self, site: str) -> None:
        """The pin of a site goes back.

        :raises InputError: no such site, or this glove has no array.
        """
        with self._lock:
            self._array().release(site, self._glove.now_ns())

    def pulse(self, site: str, count: int = 1, rate_hz: float = 50.0) -> None:
        """``count`` pulses at ``rate_hz`` (1 to 100 Hz); each may be denied by heat or current, and :meth:`results` says so.

        :raises InputError: no such site, a count outside 1 to 1000, or a rate outside its range.
        """
        in_range("rate_hz", rate_hz, 1.0, 100.0, "Hz")
        in_range("count", count, 1, 1000)
        with self._lock:
            now_ns = self._glove.now_ns()
            self._array().train(site, count, seconds_to_ns(1.0 / rate_hz), now_ns)

    def brake(self, name: str, force_n: float | None = None, volts: float | None = None, ttl_s: float = 0.2) -> float:
        """Hold a brake for ``ttl_s``, by force (volts from the fitted law) or by volts; returns the volts.

        :raises InputError: neither or both given, out of range, unknown brake, or this glove has no brakes.
        """
        if (force_n is None) == (volts is None):
            raise InputError(f"force_n = {force_n}, volts = {volts}; allowed: exactly one of them")
        if self._glove.brakes is None:
            raise InputError("this glove has no brake controller; allowed: open it with brake=…")
        if force_n is not None:
            law, overlap_m2 = self._brake.law(name)
            volts = law.volts_for(force_n, overlap_m2)
        assert volts is not None
        with self._lock:
            self._glove.brakes.engage(name, volts, self._glove.now_ns(), ttl_s=ttl_s)
        return volts

    def results(self) -> list[Any]:
        """What became of the pulses asked for, since the last call."""
        with self._lock:
            return [] if self._glove.tactiles is None else self._glove.tactiles.take_results()

    def state(self) -> GloveState:
        """Temperatures, pins, volts, faults."""
        with self._lock:
            return glove_state(self._glove)

    def advance(self, seconds: float) -> None:
        """Let virtual time pass.

        :raises InputError: the glove runs in real time.
        """
        self._glove.step_to(self._glove.now_ns() + seconds_to_ns(seconds))

    def off(self) -> None:
        """Pins withdrawn, volts zero, disarmed."""
        with self._lock:
            self._glove.off()

    def close(self) -> None:
        """Go off and close the ports."""
        self._closing.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        try:
            self._glove.off()
        finally:
            self._glove.close()

    def _array(self) -> TactilesDriver:
        if self._glove.tactiles is None:
            raise InputError("this glove has no tactor array; allowed: open it with tactiles=…")
        return self._glove.tactiles


def glove_state(glove: Glove) -> GloveState:
    """A snapshot of what the host knows."""
    now_ns = glove.now_ns()
    array, brake = glove.tactiles, glove.brakes
    brake_says = glove.telemetry.get("brake")
    names: Sequence[str] = () if brake is None else brake.channels
    return GloveState(
        time_ns=now_ns,
        rise_k={} if array is None else dict(zip(array.sites, array.rises_k(now_ns), strict=True)),
        headroom_k={} if array is None else dict(zip(array.sites, array.headrooms_k(now_ns), strict=True)),
        pins_out=() if array is None else tuple(s for s, out in zip(array.sites, array.pins_out(), strict=True) if out),
        volts={} if brake_says is None else dict(zip(names, brake_says.output, strict=False)),
        capacitance_pf={} if brake_says is None else dict(zip(names, brake_says.capacitance, strict=False)),
        armed=tuple(name for name, link in glove.links.items() if link.armed),
        faults=tuple(glove.faults),
        notes=tuple(glove.notes),
    )


def open(
    config: str | None = None,
    *,
    tactiles: str | None = None,
    brake: str | None = None,
    clock: str = "real",
    seed: int = 1,
) -> OpenGlove:
    """Open a glove: by configuration file, or by naming ports; what is named by neither is left out.

    :param clock: ``real``, or ``virtual`` to step simulated boards with ``advance``.
    :raises HapticsError: a file, port or board that cannot be used.
    """
    configuration = load_configuration(config)
    parts: dict[str, Any] = {"tactiles": configuration.tactiles, "brake": configuration.brake}
    for name, url in (("tactiles", tactiles), ("brake", brake)):
        if url is not None:
            parts[name] = parts[name].model_copy(update={"port": url})
        elif config is None and (tactiles or brake):
            parts[name] = None
    if clock not in ("real", "virtual"):
        raise InputError(f"clock = {clock!r} is not allowed; allowed: real, virtual")
    return OpenGlove(Glove(parts["tactiles"], parts["brake"], realtime=clock == "real", seed=seed), configuration.brake)
