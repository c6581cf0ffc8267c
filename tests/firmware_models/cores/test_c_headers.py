"""The generated headers are up to date, and a C compiler reads out of them what Python's table has."""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from firmware_models.cores import c_headers
from haptics.link.messages import BY_NAME, MESSAGES, Fault, State, Status, layout, schema_hash


def test_the_headers_in_the_tree_are_what_the_generator_writes() -> None:
    for path, text in c_headers.headers().items():
        assert path.read_text() == text, f"{path.name} is out of date: run python -m firmware_models.cores.c_headers"


def test_check_tells_a_changed_header_and_writes_nothing(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(c_headers, "CORE", tmp_path)
    assert c_headers.main(["--check"]) == 1
    assert list(tmp_path.iterdir()) == []
    assert c_headers.main([]) == 0
    assert c_headers.main(["--check"]) == 0
    changed = tmp_path / "protocol.h"
    changed.write_text(changed.read_text().replace("PROTOCOL_VERSION 1u", "PROTOCOL_VERSION 2u"))
    assert c_headers.main(["--check"]) == 1
    assert "protocol.h is out of date" in capsys.readouterr().out


def evaluated(expressions: list[str], folder: Path) -> list[int]:
    """What a C compiler makes of these."""
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("no C compiler: cc is not installed")
    lines = "".join(f'printf("%llu\\n", (unsigned long long)({e}));' for e in expressions)
    source = folder / "numbers.c"
    source.write_text(
        f'#include <stdio.h>\n#include "protocol.h"\n#include "constants.h"\nint main(void) {{ {lines} return 0; }}\n'
    )
    subprocess.run(
        [cc, "-std=c99", "-Wall", "-Werror", f"-I{c_headers.CORE}", str(source), "-o", str(folder / "numbers")], check=True
    )
    return [int(line) for line in subprocess.run([folder / "numbers"], check=True, capture_output=True, text=True).stdout.split()]


def test_types_sizes_and_offsets_are_those_of_the_structs(tmp_path) -> None:
    expected: dict[str, int] = {}
    for message in MESSAGES:
        name = message.name.upper()
        expected[f"MESSAGE_{name}"] = message.type
        expected[f"{name}_SIZE"] = layout(message.name)[0].size
        sizes = {"u8": "B", "u16": "H", "u32": "I", "char": "s"}
        for index, field in enumerate(message.fields):
            before = "".join(f"{f.count}{sizes[f.code]}" for f in message.fields[:index])
            expected[f"AT_{name}_{field.name.upper()}"] = struct.calcsize("<" + before)
    for kind in (Status, State, Fault):
        expected |= {f"{kind.__name__.upper()}_{member.name}": member.value for member in kind}
    expected |= {"SCHEMA_HASH": schema_hash(), "LONGEST_HOST_PAYLOAD": layout("pulse")[0].size}
    assert evaluated(list(expected), tmp_path) == list(expected.values())


def test_what_the_hardware_is_made_of_comes_out_as_published(tmp_path) -> None:
    """5 V on 1.28 ohm is 3906.25 mA (thesis 3.4.3); 3.4 e0 11 cm2 / 13 um is 2547.2 pF (thesis 4.7.1); 10 ms, 500 uA, 1500 V."""
    published = {
        "WORST_COIL_MA": 3907,
        "COILS_AT_ONCE": 3,
        "NOMINAL_PF": 2547,
        "LONGEST_PULSE * DURATION_TICKS": 20_000,
        "SUPPLY_CURRENT_UA": 500,
        "MAX_V": 1500,
        "DEAD_MAN_TICKS": 200_000,
        "BLEEDER_MOHM": 500,
    }
    assert evaluated(list(published), tmp_path) == list(published.values())


def test_every_message_of_the_table_is_there() -> None:
    text = c_headers.protocol_header()
    assert all(f"#define MESSAGE_{name.upper()} " in text for name in BY_NAME)
