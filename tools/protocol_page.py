"""Bring the protocol page up to date with the message table: ``python tools/protocol_page.py [--check]``.

Writes into ``docs/reference/protocol.md`` what follows from ``haptics/link/messages.py`` and the example of each message:
the rows of the two message tables, the schema hash and the golden frames. The last column of a row that exists is kept; a new row
gets ``reply``, or the message's meaning where a board sends it. With ``--check`` nothing is written, and exit code 1 means that
the page is out of date.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from haptics.link.messages import MESSAGES, Field, Message, payload_size, schema_hash
from haptics.link_trial.examples import EXAMPLES, example_frame, example_payload

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "protocol.md"
_ROW = re.compile(r"^\| 0x[0-9a-f]{2} \| (\w+) \|.*\| ([^|]*) \|$", re.M)
_TABLE = r"(\| type \| name \| boards \| payload \| fields \| {last} \|\n\|[- |]*\|\n)(?:\| 0x.*\n)*"


def field_text(field: Field) -> str:
    """A field as the page writes it.

    :param field: of the message table.
    :return: such as ``duration u8 × 15 in 50 µs``.
    """
    count = f" × {field.count}" if field.count > 1 else ""
    unit = re.sub(r"\bu(?=[sA]\b)", "µ", field.unit)
    return f"{field.name} {field.code}{count}{' in' if unit[:1].isdigit() else ''} {unit}".rstrip()


def row(message: Message, last: str) -> str:
    """A line of a message table.

    :param message: of the message table.
    :param last: the last column.
    :return: the line, with its line feed.
    """
    boards = "both" if len(message.boards) == 2 else message.boards[0].name.lower()
    fields = ", ".join(map(field_text, message.fields)) or "none"
    return f"| {message.type:#04x} | {message.name} | {boards} | {payload_size(message.name)} | {fields} | {last} |\n"


def golden(message: Message) -> str:
    """A line of the golden frames.

    :param message: of the message table; it has an example.
    :return: name, type and number, payload, wire bytes.
    """
    head = bytes((message.type, EXAMPLES[message.name].seq))
    parts = (message.name, head.hex(" "), example_payload(message.name).hex(" "), example_frame(message.name).hex(" "))
    return " | ".join(parts)


def up_to_date(page: str) -> str:
    """The page with its derived parts written anew.

    :param page: text of the page.
    :return: the same text where nothing has changed.
    """
    kept = dict(_ROW.findall(page))
    for sender, last in (("host", "answer"), ("board", "sent")):
        new = {"host": lambda _: "reply", "board": lambda m: m.meaning}[sender]
        rows = "".join(row(m, kept.get(m.name) or new(m)) for m in MESSAGES if m.sender == sender)
        page = re.sub(_TABLE.format(last=last), lambda found, rows=rows: found[1] + rows, page)
    page = re.sub(r"It is 0x[0-9A-F]{8}\.", f"It is 0x{schema_hash():08X}.", page)
    missing = [message.name for message in MESSAGES if message.name not in EXAMPLES]
    if missing:
        raise SystemExit(f"no example of {', '.join(missing)}: add one to haptics/link_trial/examples.py")
    frames = "\n".join(map(golden, MESSAGES))
    return re.sub(r"```golden\n.*?```", lambda _: f"```golden\n{frames}\n```", page, flags=re.S)


def main(arguments: list[str]) -> int:
    """Write the page, or with ``--check`` compare it.

    :param arguments: of the command line.
    :return: exit code.
    """
    if set(arguments) - {"--check"}:
        print(__doc__)
        return 2
    text = PAGE.read_text(encoding="utf-8")
    new = up_to_date(text)
    if new == text:
        return 0
    if "--check" in arguments:
        print(f"{PAGE} is out of date: run make protocol")
        return 1
    PAGE.write_text(new, encoding="utf-8")
    print(f"wrote {PAGE}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
