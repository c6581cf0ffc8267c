"""The C headers of the firmware core, made from the message table and the physics' parameters: one truth, two languages.

``python -m firmware_models.cores.c_headers`` writes ``core/protocol.h`` and ``core/constants.h``; with ``--check`` it writes
nothing and exits 1 where a file is not what it would write.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from haptics.link import messages
from haptics.link.messages import MESSAGES, Board, Fault, Message, State, Status
from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.parameters import BRAKE, MAX_VOLTS, capacitance_f
from haptics.physics.latch.parameters import LATCH, LONGEST_PULSE_S, NOMINAL_VOLTS
from haptics.physics.thermal.one_node import THERMAL

CORE = Path(__file__).parents[1] / "firmware" / "core"
_BYTES = {"u8": 1, "u16": 2, "u32": 4, "char": 1}
_COIL_CURRENT_MA = 12_000  # a setting
_HEAT_SHIFT = 12
_RESISTANCE_SPREAD_OHM = 0.1  # thesis 3.4.3


@dataclass(frozen=True)
class Constant:
    """One line of a header.

    :ivar name: of the macro.
    :ivar value: a whole number, not below 0.
    :ivar unit: for the comment; "ticks" makes it 32 bits wide. Empty: none.
    :ivar source: section of the thesis, page of the documentation, or a word on what it is; may be empty.
    """

    name: str
    value: int
    unit: str
    source: str


def protocol_header() -> str:
    """``protocol.h``: types, sizes and field offsets of all messages, and the numbers both sides must agree on.

    :return: the file's text.
    """
    host = [m for m in MESSAGES if m.sender == "host"]
    numbers = (
        Constant("PROTOCOL_VERSION", messages.PROTOCOL_VERSION, "", ""),
        Constant("SCHEMA_HASH", messages.schema_hash(), "", "of the table, checked in the handshake"),
        Constant("TICK_HZ", messages.TICK_HZ, "Hz", ""),
        Constant("TICKS_PER_MS", messages.TICK_HZ // 1000, "ticks", ""),
        Constant("DURATION_TICKS", messages.DURATION_UNIT_US * messages.TICKS_PER_US, "ticks", "unit of a pulse's duration"),
        Constant("COIL_CHANNELS", messages.COIL_CHANNELS, "", ""),
        Constant("BRAKE_CHANNELS", messages.BRAKE_CHANNELS, "", ""),
        Constant("LIMITS", messages.LIMITS, "", "of identity and configure"),
        Constant("HEAT_UNIT_MS", messages.HEAT_UNIT_MS, "ms", "of a coil's on-time account, in telemetry"),
        Constant("MAX_PAYLOAD", messages.MAX_PAYLOAD, "bytes", ""),
        Constant("LONGEST_HOST_PAYLOAD", max(_size(m) for m in host), "bytes", "of those a host sends"),
        Constant("REMEMBERED_REPLIES", messages.REMEMBERED_REPLIES, "", ""),
    )
    parts = [_lines(numbers), *(_enum(kind) for kind in (Board, Status, State, Fault)), _accepted(host)]
    parts += [_message(m) for m in MESSAGES]
    return _file("PROTOCOL_H", "The wire protocol in numbers; docs/reference/protocol.md documents them.", parts)


def constants_header() -> str:
    """``constants.h``: limits as built, thresholds of the guards, and what the hardware is made of.

    :return: the file's text.
    """
    page = "docs/reference/protocol.md"
    worst_coil_ma = math.ceil(1e3 * NOMINAL_VOLTS / (LATCH.resistance_ohm - _RESISTANCE_SPREAD_OHM))
    nominal_f = capacitance_f(BRAKE.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
    heat_step_s = -THERMAL.tau_s * math.log1p(-(2.0**-_HEAT_SHIFT))
    both = (
        Constant("DEAD_MAN_MS", 100, "ms", page),
        Constant("DEAD_MAN_TICKS", _ticks(100e-3), "ticks", "the same"),
        Constant("FAR_TICKS", messages.TICK_HZ, "ticks", f"1 s, {page}"),
        Constant("TELEMETRY_TICKS", _ticks(20e-3), "ticks", f"20 ms, {page}"),
    )
    coils = (
        Constant("LONGEST_PULSE", round(LONGEST_PULSE_S * 1e6) // messages.DURATION_UNIT_US, "50 us", "thesis 3.4.3"),
        Constant("COIL_CURRENT_MA", _COIL_CURRENT_MA, "mA", "a setting: all coils together"),
        Constant("WORST_COIL_MA", worst_coil_ma, "mA", "5 V on 1.38 - 0.1 ohm, thesis 3.4.3"),
        Constant("COILS_AT_ONCE", _COIL_CURRENT_MA // worst_coil_ma, "", "coil current over the worst coil's"),
        Constant("PULSE_QUEUE", 64, "pulses", "a setting"),
        Constant("MIN_SUPPLY_MV", 3000, "mV", "a setting"),
        Constant("ON_TIME_MS", 2500, "ms", f"of account: 30.4 K on a nominal tactor, {page}"),
        Constant("HEAT_SHIFT", _HEAT_SHIFT, "", "an account loses 2^-12 of itself each"),
        Constant("HEAT_STEP_TICKS", _ticks(heat_step_s), "ticks", f"a time constant of {THERMAL.tau_s:g} s, thesis 3.5.2"),
        Constant("WARM_MS", 100, "ms", f"of account, more than which is noted, {page}"),
        Constant("COOLED_MS", 50, "ms", "of account, less than which the note is taken back: a setting"),
        Constant("NO_CURRENT_MA", 200, "mA", "a coil draws 3400 or more, the sense resolves 64"),
        Constant("COIL_CURRENT_TICKS", _ticks(2e-3), "ticks", f"2 ms, {page}"),
    )
    brake = (
        Constant("MAX_V", round(MAX_VOLTS), "V", "thesis 4.7.3"),
        Constant("SUPPLY_CURRENT_UA", round(DRIVE.supply_current_a * 1e6), "uA", "thesis 4.4.3"),
        Constant("MAX_DHZ", round(DRIVE.bridge_hz * 10), "0.1 Hz", "thesis 4.4.3"),
        Constant("MIN_DHZ", 5, "0.1 Hz", f"a reversal each second, {page}"),
        Constant("LONGEST_TTL_MS", 2000, "ms", "a setting"),
        Constant("DRIVE_QUEUE", 8, "drives", page),
        Constant("BURST_QUEUE", 8, "piezo bursts", page),
        Constant("NOMINAL_PF", round(nominal_f * 1e12), "pF", "a sound brake, thesis 4.4 and 4.7.1"),
        Constant("STRAY_PF", round(DRIVE.stray_f * 1e12), "pF", "wiring and bridge, assumed"),
        Constant("BLEEDER_MOHM", round(DRIVE.bleeder_ohm * 1e-6), "Mohm", "across the supply, assumed"),
        Constant("OUTPUT_OHM", round(DRIVE.output_resistance_ohm), "ohm", "optocouplers and wiring, assumed"),
        Constant("LONGEST_CLAMP_TICKS", _ticks(DRIVE.clamp_s), "ticks", f"1 ms, {page}"),
        Constant("RESTART_TICKS", _ticks(2e-3), "ticks", f"2 ms shorted before another wave, {page}"),
        Constant("STORED_CHARGE_NC", 45_000, "nC", f"45 uC, {page}"),
        Constant("OVER_VOLTAGE_PERCENT", 5, "% above the setpoint", page),
        Constant("OVER_CURRENT_UA", 550, "uA", page),
        Constant("OVER_CURRENT_TICKS", _ticks(1e-3), "ticks", f"1 ms, {page}"),
        Constant("LEAK_UA", 50, "uA beyond the bleeder", "hold phase only; a starting threshold"),
        Constant("DROP_V", 100, "V in 1 ms", "uncommanded, hold phase only; a starting threshold"),
        Constant("DISCHARGED_V", 60, "V", page),
        Constant("DISCHARGE_TICKS", _ticks(5e-3), "ticks", "5 ms for all to be below it; a starting threshold"),
        Constant("TOUCHABLE_DV", 424, "0.1 V", f"arming needs less everywhere, {page}"),
        Constant("SELF_TEST_V", 40, "V", page),
        Constant("NO_RISE_TICKS", _ticks(1e-3), "ticks", f"1 ms without a rise is a short, {page}"),
    )
    parts = [f"/* {title} */\n{_lines(rows)}" for title, rows in (("Both boards", both), ("Coils", coils), ("Brakes", brake))]
    return _file("CONSTANTS_H", "Limits as built, thresholds, hardware.", parts)


def headers() -> dict[Path, str]:
    """Every generated file.

    :return: text by path.
    """
    return {CORE / "protocol.h": protocol_header(), CORE / "constants.h": constants_header()}


def main(arguments: list[str] | None = None) -> int:
    """Write the headers, or with ``--check`` compare them.

    :param arguments: of the command line; None takes those of the process.
    :return: exit code: 1 if ``--check`` found a header out of date.
    """
    name = "python -m firmware_models.cores.c_headers"
    parser = argparse.ArgumentParser(prog=name, description="C headers of the firmware core")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a header is out of date")
    check = parser.parse_args(arguments).check
    stale = [path for path, text in headers().items() if not path.is_file() or path.read_text() != text]
    for path in stale:
        if check:
            print(f"{path} is out of date: run python -m firmware_models.cores.c_headers")
        else:
            path.write_text(headers()[path])
            print(f"wrote {path}")
    return 1 if check and stale else 0


def _ticks(time_s: float) -> int:
    return round(time_s * messages.TICK_HZ)


def _size(message: Message) -> int:
    return messages.payload_size(message.name)


def _literal(constant: Constant) -> str:
    """Unsigned; of 32 bits, neither more nor less, what a 16-bit ``int`` cannot hold, and ticks, whose products it could not."""
    wide = constant.value >= 1 << 16 or constant.unit == "ticks"
    return f"UINT32_C({constant.value})" if wide else f"{constant.value}u"


def _lines(constants: tuple[Constant, ...]) -> str:
    def comment(c: Constant) -> str:
        return f" /* {': '.join(word for word in (c.unit, c.source) if word)} */" if c.unit or c.source else ""

    return "\n".join(f"#define {c.name} {_literal(c)}{comment(c)}" for c in constants)


def _enum(kind: type[IntEnum]) -> str:
    prefix = kind.__name__.upper()
    members = "\n".join(f"    {prefix}_{member.name} = {member.value}," for member in kind)
    return f"enum {{ /* {kind.__name__.lower()} */\n{members}\n}};"


def _message(message: Message) -> str:
    """Type, payload size, and the offset of each field in the payload."""
    name = message.name.upper()
    lines = [
        f"/* {message.sender}: {message.name} */",
        f"#define MESSAGE_{name} {message.type:#04x}u",
        f"#define {name}_SIZE {_size(message)}u",
    ]
    at = 0
    for field in message.fields:
        shape = f"{field.code} x {field.count}" if field.count > 1 else field.code
        lines.append(f"#define AT_{name}_{field.name.upper()} {at}u /* {shape}{f', {field.unit}' if field.unit else ''} */")
        at += field.count * _BYTES[field.code]
    return "\n".join(lines)


def _accepted(host: list[Message]) -> str:
    """What each board takes from a host, as initialisers: sizes by type from 1 on, and the commands that lie beyond those."""
    both = {m.type: m for m in host if len(m.boards) == len(Board)}
    common = [both[type_] for type_ in range(1, len(both) + 1) if type_ in both]
    own = {board: [m for m in host if board in m.boards and m not in common] for board in Board}
    rows = max(map(len, own.values()))
    sizes = ", \\\n    ".join(f"[MESSAGE_{m.name.upper()}] = {m.name.upper()}_SIZE" for m in common)
    lines = [
        "/* what a host sends: payload sizes by type, from 1 on; the commands beyond those, {type, size} */",
        f"#define COMMON_SIZES {{ \\\n    {sizes}, \\\n}}",
        f"#define OWN_COMMANDS {rows}u",
    ]
    for board, messages_of in own.items():
        filled = messages_of + messages_of[-1:] * (rows - len(messages_of))  # a row twice is found once
        pairs = ", ".join(f"{{MESSAGE_{m.name.upper()}, {m.name.upper()}_SIZE}}" for m in filled)
        lines.append(f"#define {board.name}_COMMANDS {{{pairs}}}")
    return "\n".join(lines)


def _file(guard: str, title: str, parts: list[str]) -> str:
    note = f"/* {title}\n * Generated by python -m firmware_models.cores.c_headers: do not edit. */"
    return "\n\n".join([f"{note}\n#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>", *parts, "#endif"]) + "\n"


if __name__ == "__main__":
    raise SystemExit(main())
