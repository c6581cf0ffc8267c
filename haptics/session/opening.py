"""Ports opened, links made, drivers built: what a glove's devices consist of, from its configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.errors import InputError
from haptics.link.connection import Link
from haptics.link.limits import Wanted, kept_stricter, stricter
from haptics.link.messages import DURATION_UNIT_US, Board
from haptics.link.port_url import is_simulated, query_of, with_defaults
from haptics.link.ports import BytePort, check_board_port, open_port
from haptics.link.session import LinkSession
from haptics.scheduling import CoilHeat, CoilLimits, ThermalBudget
from haptics.session.configuration import COUNTED_COIL_A, BrakeConfiguration, TactilesConfiguration
from haptics.units import a_callable, an_instance, one_of

PARTS: dict[str, type] = {"tactiles": TactilesConfiguration, "brake": BrakeConfiguration}
"""The boards that a glove may have, and what each is configured with."""
HANDOVER_S = 100e-6
"""Pause between two pulses that share a coil or its share of the current: more than a clock estimate moves between them."""
WireTap = Callable[[str, int, bool, bytes], None]


class Opening:
    """How the boards of one glove are opened.

    :param tactiles: configuration of the array, or None to leave it out.
    :param brake: configuration of the brake controller, or None to leave it out.
    :param realtime: see ``Devices``.
    :param seed: likewise.
    :param simulate: likewise.
    :param wire_tap: likewise.
    :param limit_pulses: likewise.
    :raises InputError: something else in place of these, or one port for both boards.

    :ivar parts: configurations by board.
    """

    def __init__(
        self,
        tactiles: TactilesConfiguration | None,
        brake: BrakeConfiguration | None,
        realtime: bool,
        seed: int,
        simulate: Mapping[str, Mapping[str, object]] | None,
        wire_tap: WireTap | None,
        limit_pulses: bool,
    ):
        self._realtime, self._seed, self._wire_tap, self._limit_pulses = realtime, seed, wire_tap, limit_pulses
        self._simulate = _checked_keys({} if simulate is None else simulate)
        if wire_tap is not None:
            a_callable("wire_tap", wire_tap, "port name, time, direction and bytes")
        self.parts: dict[str, TactilesConfiguration | BrakeConfiguration] = {}
        for name, part in {"tactiles": tactiles, "brake": brake}.items():
            if part is not None:
                an_instance(name, part, PARTS[name], "a part of haptics.load_configuration's answer, or None")
                check_board_port(part.port, name, f"{name} port")
                self.parts[name] = part
        if tactiles is not None and brake is not None and tactiles.port == brake.port:
            raise InputError(f"brake port = {brake.port!r} is the tactiles port, too; expected a port for each board")

    def link(self, name: str) -> tuple[Link, Callable[[], BytePort]]:
        """Open a board's port.

        :param name: of the board.
        :return: the link, not started, and what opens its port again.
        :raises InputError: a real port in virtual time.
        :raises LinkError: a port that cannot be used.
        """
        part = self.parts[name]
        url = self._url(name, part)

        def again() -> BytePort:
            return open_port(url, part.baud)

        port = again()
        if not self._realtime and query_of(url).get("clock") != "virtual":
            port.close()
            raise InputError(
                f"port = {part.port!r} asks for the real clock; in virtual time (without --realtime) expected clock=virtual"
            )
        tap, board, wanted = self._wire_tap, Board[name.upper()], self._wanted_limits(part)

        def tapped(time_ns: int, direction: str, data: bytes) -> None:
            if tap is not None:
                tap(name, time_ns, direction == "out", data)

        def limits(identity: Any) -> tuple[int, ...]:
            return stricter(board, wanted, identity.limits)

        return Link(port, LinkSession(board, part.port, limits=limits, baud=part.baud, tap=tapped)), again

    def notes(self, name: str, link: Link) -> list[str]:
        """Where a board was built stricter than the configuration, or still keeps what another host configured.

        :param name: of the board.
        :param link: ready.
        :return: sentences for people.
        """
        kept = kept_stricter(Board[name.upper()], self._wanted_limits(self.parts[name]), link.identity.limits)
        return [f"{name}: the board holds a stricter limit: {text}" for text in kept]

    def tactiles(self, link: Link) -> tuple[TactilesDriver, list[CoilHeat], list[str]]:
        """The array, held to the stricter of configuration and board, so that no legal request is refused by the board.

        :param link: ready.
        :return: its driver, what the heat account of each coil goes by, and notes for people.
        """
        part = self.parts["tactiles"]
        assert isinstance(part, TactilesConfiguration)
        longest, current_ma, _, _, on_time_ms = self._limits("tactiles", link)
        coils, notes = [part.coil_heat(site) for site in part.sites], []
        limits_k = [min(part.rise_limit_k, coil.limit_k(on_time_ms / 1000)) for coil in coils]
        if self._limit_pulses and min(limits_k) < part.rise_limit_k * (1 - 1e-3):
            site = part.sites[limits_k.index(min(limits_k))]
            notes.append(
                f"tactiles: {on_time_ms} ms of on-time, the board's limit, hold {site} to {min(limits_k):.1f} K "
                f"({part.rise_limit_k:g} K configured)"
            )
        budgets = [ThermalBudget(coil.parameters, limit_k) for coil, limit_k in zip(coils, limits_k, strict=True)]
        limits = CoilLimits(
            current_ma / 1000,
            max(part.coil_current_a, COUNTED_COIL_A),
            tuple(coil.power_w for coil in coils),
            HANDOVER_S,
        )
        contact_s = min(part.contact_pulse_s, longest * DURATION_UNIT_US / 1e6)  # the longest may be that of another stroke
        return TactilesDriver(link, part.sites, limits, budgets, contact_s), coils, notes

    def brakes(self, link: Link) -> BrakeDriver:
        """The brakes, likewise.

        :param link: ready.
        :return: their driver.
        """
        part = self.parts["brake"]
        assert isinstance(part, BrakeConfiguration)
        amplitude_v, _, frequency_dhz, ttl_ms, _ = self._limits("brake", link)
        frequency_hz = min(part.frequency_hz, frequency_dhz / 10)
        ttl_s = min(part.ttl_s, ttl_ms / 1000)
        return BrakeDriver(link, part.channels, frequency_hz, ttl_s, amplitude_v, frequency_dhz / 10)

    def _url(self, name: str, part: TactilesConfiguration | BrakeConfiguration) -> str:
        defaults: dict[str, object] = {"clock": "real" if self._realtime else "virtual", "seed": self._seed}
        if part.port.startswith(f"sim://{name}"):
            defaults |= self._simulate.get(name, {})
        url = with_defaults(part.port, **defaults)
        if not self._realtime and not is_simulated(url):
            raise InputError(
                f"port = {part.port!r} is hardware, which runs in real time (--realtime, or haptics.open without clock); "
                "expected a sim://… port in virtual time"
            )
        return url

    def _wanted_limits(self, part: TactilesConfiguration | BrakeConfiguration) -> Wanted:
        if isinstance(part, TactilesConfiguration):
            return part.board_limits(of_pulses=self._limit_pulses)
        return part.board_limits()

    def _limits(self, name: str, link: Link) -> tuple[int, ...]:
        """What holds: of each limit the stricter of configuration and board."""
        return stricter(Board[name.upper()], self._wanted_limits(self.parts[name]), link.identity.limits)


def _checked_keys(simulate: object) -> Mapping[str, Mapping[str, object]]:
    """Query keys for simulated boards.

    :raises InputError: not by a board's name, or not keys and values.
    """
    an_instance("simulate", simulate, Mapping, "from a board's name to query keys and their values")
    for name, keys in simulate.items():  # type: ignore[attr-defined]
        one_of("simulate", name, tuple(PARTS))
        an_instance(f"simulate of {name}", keys, Mapping, "from query keys to values")
    return simulate  # type: ignore[return-value]
