"""What an instrument prints that a rig cannot use is quoted, and told from silence; words that are no number are no sample."""

from __future__ import annotations

import pytest

from rigs.coil_current import PulseRecord
from rigs.instruments import Accelerometer, InstrumentSilent, LoadCell, SampleStream, Stage, Thermocouple, stage, stream
from rigs.landings import MEASUREMENTS, set_up

HEADER = b"# thermocouple rate_hz=10 resolution_k=0.0625 unit=degC\r\n"


class Prints:
    """A port behind which these bytes lie; as pyserial's socket://, it says only whether something waits."""

    is_open = True

    def __init__(self, data: bytes):
        self.data = bytearray(data)

    @property
    def in_waiting(self) -> int:
        return int(bool(self.data))

    def read(self, size: int = 1, /) -> bytes:
        taken = bytes(self.data[:size])
        del self.data[:size]
        return taken

    def write(self, data: bytes, /) -> int:
        return len(data)

    def close(self) -> None:
        pass


@pytest.fixture
def listen(monkeypatch):
    def to(data: bytes, kind: type[SampleStream] | type[Stage] = Thermocouple):
        for module in (stream, stage):
            monkeypatch.setattr(module, "open_port", lambda url, baud: Prints(data))
        one = kind("/dev/ttyACM9")
        one.poll(0)
        return one

    return to


@pytest.mark.parametrize(
    ("printed", "seen"),
    [
        (b"", "not one byte came"),
        (b"\xf8\x80\x00\xff" * 8, "32 bytes came without an end of line, beginning with b'\\xf8\\x80\\x00\\xff"),
        (b"ets Jan  8 2013\r\nInitializing... DONE.\r\nInternal Temp = 24.50\r\nC = 25.25\r\n", "'C = 25.25'; expected 'COUNT"),
        (b"25.25\r\n25.31\r\n", "'25.31'; expected 'COUNT TEMPERATURE_C', such as '7 25.5'"),
        (b"7 25,2500\r\n8 25,3125\r\n", "'8 25,3125' (a decimal comma?"),
        (b"2026-01-01,25.25,24.5\r\n", "'2026-01-01,25.25,24.5'"),
        (b'{"temperature_c": 25.25}\r\n', "'{\"temperature_c\": 25.25}'"),
        (b"7 25.25 24.5\r\n", "'7 25.25 24.5'"),
    ],
    ids=["silent", "noise", "labelled", "without a count", "decimal comma", "csv", "json", "too many values"],
)
def test_lines_that_are_no_samples_are_quoted_and_silence_is_called_silence(listen, printed, seen):
    one = listen(printed)
    assert one.count == 0
    assert seen in one.seen()
    with pytest.raises(InstrumentSilent) as caught:
        one.samples()
    assert seen in str(caught.value)
    if printed:
        assert "not one byte" not in str(caught.value)


def test_samples_without_a_header_and_a_header_without_samples_are_told_apart(listen):
    assert "does not answer '?'" in listen(b"7 25.25\r\n").seen()
    said = listen(HEADER + b"twenty-five\r\n").seen()
    assert "identifies itself" in said
    assert "'twenty-five'" in said


@pytest.mark.parametrize("word", [b"NAN", b"nan", b"inf", b"-inf", b"ovf", b"25,5"])
def test_a_word_that_is_no_finite_number_is_never_a_sample(listen, word):
    one = listen(HEADER + b"1 25.0\r\n2 " + word + b"\r\n3 25.5\r\n")
    assert [values for _, values in one.fresh()] == [(25.0,), (25.5,)]
    assert len(one.faults) + one.bad_lines == 1


def test_a_load_cell_says_what_it_would_read(listen):
    assert "'1.5 N'; expected 'COUNT FORCE_N', such as '7 21550'" in listen(b"1.5 N\r\n", LoadCell).seen()


def test_a_stage_that_speaks_something_else_is_quoted(listen):
    assert "not one byte" in listen(b"", Stage).seen()
    assert "'Marlin 2.0 ready'; expected GRBL's" in listen(b"Marlin 2.0 ready\r\n", Stage).seen()


def test_the_wrong_instrument_is_quoted_too(listen):
    with pytest.raises(ValueError, match=r"is a loadcell \(it prints '# loadcell rate_hz=80'\); expected a thermocouple"):
        listen(b"# loadcell rate_hz=80\r\n")


ACCELEROMETER = b"# accelerometer rate_hz=3200 range_g=16 g_per_count=0.00390625 bandwidth_hz=1600\r\n"


def test_a_set_up_is_six_measurements_and_none_at_all_of_a_silent_accelerometer(listen):
    pulses = PulseRecord.of([0], 10e-3, [(5_000_000, 3.6, 5.0)])
    lines = b"".join(b"%d %d\r\n" % (number, 4095 if number == 9 else 2) for number in range(20) if number not in (3, 4))
    found = set_up(listen(ACCELEROMETER + lines + b"20 open\r\n", Accelerometer), 0.01, pulses)
    assert list(found) == [name for name in MEASUREMENTS if name != "landing_dip"]
    values = {name: one.value for name, one in found.items()}
    assert values == {
        "noise_g": 0.01,
        "sample_rate_hz": 3200.0,
        "lost_share": pytest.approx(2 / 21),  # of 0 to 20; the last one came, though as a word
        "clipped": 1.0,
        "supply_v": 5.0,
        "current_a": 3.6,
    }
    with pytest.raises(InstrumentSilent, match="it identifies itself, but prints no sample"):
        set_up(listen(ACCELEROMETER, Accelerometer), 0.01, pulses)
