"""lz-string, held against what the original writes: lz-string 1.5.0 on Node made the data of ``ORIGINAL``."""

from __future__ import annotations

import tracemalloc

import pytest
from hypothesis import given, strategies as st

from haptics.errors import InputError
from haptics.scene.hand_files import lz_string
from haptics.scene.hand_files.lz_string import LzString, alphabet_of, bits_of_bytes, bits_of_text, is_lz_bytes

ORIGINAL = [
    (
        '{"frames":[]}',
        "N4IgZgTghgtgpgZxALgNoF0C+Q==",
        "N4IgZgTghgtgpgZxALgNoF0C+Q",
        "ᯡ࠹䂼ࢀ嬥ᠹ戡㠭偎䃞† ",
        "3782206604e0860b60a6067100b80da05d02f900",
    ),
    ("[1,1,1,1,1,1,1,1,1,1]", "NoRgNOkdWQukA===", "NoRgNOkdWQukA", "᭢ᠭᵃ喰嵀 ", "36846034e91d590ba400"),
    (
        '{"a":"é\u1234\U0001f600"}',
        "N4IghiBcIJeCxIheDcAB7IC+Q===",
        "N4IghiBcIJeCxIheDcAB7IC+Q",
        "ᯡࡁ䐫䈩㰶ቁ㰻䀡癠⾰ ",
        "37822086205c209782c4885e0dc001ec80be4000",
    ),
    (
        ' {"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa":0}',
        "AQbwRAhl07fzMAuADAXyA===",
        "AQbwRAhl07fzMAuADAXyA",
        "£㰱Ĭ嵛㾹䁎8ؒ  ",
        "",  # bytes with a blank first look like other bytes, and are not told
    ),
]


def unpacked(packed: str | bytes, piece: int = 7, ask: int = 5) -> str:
    """The text of lz-string data, fed and asked for in small pieces."""
    pieces = iter([packed[at : at + piece] for at in range(0, len(packed), piece)])
    if isinstance(packed, bytes):
        assert is_lz_bytes(packed)
        source = LzString(lambda: bits_of_bytes(next(pieces, b"")))
    else:
        alphabet = alphabet_of(packed)
        assert alphabet is not None
        source = LzString(lambda: bits_of_text(next(pieces, ""), alphabet))
    text = ""
    while part := source.read(ask):
        text += part
    return text.encode("utf-16", "surrogatepass").decode("utf-16")


@pytest.mark.parametrize(("text", "base64", "uri", "utf16", "data"), ORIGINAL)
def test_what_the_original_wrote_is_read_in_every_alphabet(text, base64, uri, utf16, data):
    for packed in (base64, uri, utf16, bytes.fromhex(data)):
        for piece in (1, 7, 1000) if packed else ():
            assert unpacked(packed, piece) == text


def test_lines_of_base64_are_joined():
    assert unpacked("N4IgZgTgh\r\ngtgpgZxALgNoF0C+Q==\n") == '{"frames":[]}'


def test_a_genuine_recording_unpacks_to_json(recordings):
    import json

    text = unpacked((recordings / "finger-tap-54fps.json.lz").read_text(), 4096, 4096)
    frames = json.loads(text)["frames"]
    assert len(frames) == 90  # the schema and 89 frames
    assert frames[0][:2] == ["id", "timestamp"]


@pytest.mark.parametrize("text", ["", "{", "null", "No hands here.", "Nothing, really", "N", "a,b,c", "\ud800"])
def test_other_text_is_not_taken_for_it(text):
    assert alphabet_of(text) is None


@pytest.mark.parametrize("data", [b"", b"7", b"{}", b"\xff\xfe{", b"PK\x03\x04"])
def test_other_bytes_are_not_taken_for_it(data):
    assert not is_lz_bytes(data)


def test_data_that_ends_early_is_refused():
    with pytest.raises(InputError, match="cut short"):
        unpacked(ORIGINAL[0][1][:-6])


def test_a_code_that_names_nothing_is_refused():
    with pytest.raises(InputError, match="code 7 names nothing in a dictionary of 1"):
        LzString(iter(["0011011110111", ""]).__next__).read(10)
    with pytest.raises(InputError, match="code 3 names nothing in a dictionary of 0"):
        LzString(iter(["110" * 20, ""]).__next__).read(10)


def test_a_character_outside_the_alphabet_is_refused():
    with pytest.raises(InputError, match="' ' is not of its alphabet"):
        bits_of_text("N4 g", "base64")
    with pytest.raises(InputError, match="is not of its alphabet"):
        bits_of_text("\x1f", "utf16")


def repeated(codes: int) -> str:
    """Bits of a stream in which each code doubles nothing but grows the entry before by one: the longest text for its length."""
    bits, width, room, entries = "0010000110", 3, 4, 1
    for _ in range(codes):
        bits += f"{entries + 3:0{width}b}"[::-1]
        entries += 1
        room -= 1
        if room == 0:
            room, width = 1 << width, width + 1
    return bits


def test_a_text_far_longer_than_its_data_is_refused_at_the_limit(monkeypatch):
    monkeypatch.setattr(lz_string, "LARGEST_TEXT_CHARS", 1 << 20)
    bits = repeated(8_000)  # 32 million characters out of 12 kB
    tracemalloc.start()
    try:
        source = LzString(iter([bits, ""]).__next__)
        with pytest.raises(InputError, match="longer than the allowed 1024 Ki characters"):
            source.read(4 << 20)
        assert tracemalloc.get_traced_memory()[1] < 8 << 20  # two bytes a character, twice while an array grows
    finally:
        tracemalloc.stop()


def test_a_dictionary_beyond_the_limit_is_refused(monkeypatch):
    monkeypatch.setattr(lz_string, "MAX_ENTRIES", 100)
    with pytest.raises(InputError, match="dictionary is larger"):
        LzString(iter([repeated(200), ""]).__next__).read(1 << 20)


@given(st.text("01", max_size=400))
def test_any_bits_are_read_or_refused(bits):
    source = LzString(iter([bits, ""]).__next__)
    try:
        while source.read(50):
            pass
    except InputError:
        pass
