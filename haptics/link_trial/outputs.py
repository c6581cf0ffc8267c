"""What rules about outputs do again and again: put some on, see that all are off, and what state a board is in."""

from __future__ import annotations

from haptics.link.clock import signed_ticks
from haptics.link.messages import COIL_CHANNELS, Board, State, Status
from haptics.link_trial.raw_host import TICKS_PER_MS, NotApplicable, RawHost, need

_MS = [20] * COIL_CHANNELS
_VOLTS, _FREQUENCY_DHZ = 200, 500


def state_of(host: RawHost) -> State:
    """State in the board's next telemetry.

    :param host: a host that has met the board.
    :return: the state.
    """
    return State(host.telemetry().state)


def need_state(host: RawHost, *states: State, when: str) -> None:
    """Require the board to be in one of some states.

    :param host: a host that has met the board.
    :param states: those allowed.
    :param when: what happened before, for the message.
    :raises Broken: it is in another state.
    """
    state = state_of(host)
    need(state in states, f"{state.name.lower()} {when}; expected {' or '.join(one.name.lower() for one in states)}")


def need_off(host: RawHost, when: str) -> None:
    """Require that nothing is energised, as far as the port shows it.

    :param host: a host that has met the board.
    :param when: what happened before, for the message.
    :raises Broken: something is.
    """
    if host.observed is not None:
        energised = host.observed.energised()
        need(not energised, f"channels {energised} energised {when}")


def energise(host: RawHost) -> None:
    """Put outputs on a moment from now, and queue others behind them.

    :param host: a host whose board is armed.
    :raises Broken: a command is refused, or nothing goes on.
    """
    if host.board == Board.TACTILES:
        start = host.tick_in(4)
        host.expect("pulse", start, 0b011, 0b001, [200] * COIL_CHANNELS)
        for ms in (30, 60, 130, 250):
            host.expect("pulse", (start + ms * TICKS_PER_MS) % 2**32, 0b100, 0, _MS)
    else:
        mask = fitted(host)
        start = host.tick_in(4)
        host.expect("drive", start, mask, _VOLTS, _FREQUENCY_DHZ, 400)
        host.expect("piezo", start, 0b11, 300)
        for ms in (150, 250):
            host.expect("drive", (start + ms * TICKS_PER_MS) % 2**32, mask, _VOLTS, 2 * _FREQUENCY_DHZ, 300)
            host.expect("piezo", (start + 2 * ms * TICKS_PER_MS) % 2**32, 0b100, 50)
    while signed_ticks(host.tick(), start) < 3 * TICKS_PER_MS:
        host.live(0.5)
    if host.observed is not None:
        need(bool(host.observed.energised()), "nothing was energised though it was commanded")


def fitted(host: RawHost) -> int:
    """An output that has a brake, as the self test found.

    :param host: a host that has met a brake controller.
    :return: mask with its bit.
    :raises NotApplicable: there is none.
    """
    for channel, picofarad in enumerate(host.telemetry().capacitance):
        if picofarad:
            return 1 << channel
    raise NotApplicable("no brake is fitted")


def stays_off(host: RawHost, ms: float = 350) -> None:
    """Require that no output goes on by itself while the host lives.

    :param host: a host that has met the board.
    :param ms: how long to watch (ms).
    :raises Broken: one goes on, or is on.
    """
    mark = len(host.edges)
    host.wait_out(ms)
    on = [edge for edge in host.edges[mark:] if edge.drive]
    need(not on, f"{on[0].kind if on else ''} {on[0].channel if on else ''} went on by itself")
    need_off(host, "by themselves")


def armed_brake(host: RawHost) -> tuple[int, int]:
    """Arm a brake controller.

    :param host: a host that has met it.
    :return: mask and number of an output that has a brake.
    :raises NotApplicable: there is none.
    """
    host.arm()
    mask = fitted(host)
    return mask, mask.bit_length() - 1


def tick_after(tick: int, ms: float) -> int:
    """The tick some time after another.

    :param tick: u32.
    :param ms: how much later (ms).
    :return: u32.
    """
    return (tick + round(ms * TICKS_PER_MS)) % 2**32


def refused(host: RawHost, faults: int = 0) -> None:
    """Require that a command which would energise is answered ``interlock``.

    :param host: a host that has met the board.
    :param faults: mask of latched faults, expected as the reply's detail.
    :raises Broken: the answer is another one.
    """
    name, values = ("pulse", (1, 1, _MS)) if host.board == Board.TACTILES else ("piezo", (1, 5))
    host.expect(name, host.tick_in(20), *values, status=Status.INTERLOCK, detail=faults)
