"""Which line of a TOML file each table, key and item begins on: TOML's reader keeps no lines, and people need them."""

from __future__ import annotations

import re

Path = tuple[int | str, ...]
_TOKEN = re.compile(
    r"""(?P<comment>\#[^\n]*)
    |(?P<long>\"\"\"(?:\\.|[^\\])*?\"{3,5}|'''.*?'{3,5})
    |(?P<text>"(?:\\.|[^"\\\n])*"|'[^'\n]*')
    |(?P<mark>\[\[|\]\]|[\[\]{},=\n])
    |(?P<word>[^\s\[\]{},=\#"']+)""",
    re.X | re.S,
)
_KEY = re.compile(r"""\s*(?:"((?:\\.|[^"\\])*)"|'([^']*)'|([^.\s"']+))\s*\.?""")


def lines_of(text: str) -> dict[Path, int]:
    """Where a file's parts begin.

    :param text: a TOML file that its reader took.
    :return: line, counted from 1, by path: names of tables and keys, numbers of items, from the outside in.
    """
    return _Lines(text).found


class _Lines:
    """One pass over the tokens. A value is an inline table, an array, or anything else up to the next mark."""

    def __init__(self, text: str):
        self.found: dict[Path, int] = {}
        self._text, self._counts = text, dict[Path, int]()
        self._tokens = [(match.lastgroup, match.group(), match.start()) for match in _TOKEN.finditer(text)]
        self._at = 0
        table: Path = ()
        while self._at < len(self._tokens):
            kind, token, _ = self._tokens[self._at]
            if kind == "comment" or token == "\n":
                self._at += 1
            elif token in ("[", "[["):
                table = self._header(token)
            elif kind in ("word", "text"):
                self._pair(table)
            else:
                self._at += 1

    def _line(self, at: int) -> int:
        return self._text.count("\n", 0, self._tokens[at][2]) + 1

    def _note(self, path: Path, line: int) -> None:
        for length in range(1, len(path) + 1):  # tables that dotted names pass through begin where they are first named
            self.found.setdefault(path[:length], line)

    def _header(self, opening: str) -> Path:
        line, closing = self._line(self._at), "]" * len(opening)
        self._at += 1
        path = self._names(closing)
        self._at += 1
        whole: Path = ()
        for number, name in enumerate(path):
            whole = (*whole, name)
            last = number == len(path) - 1
            if opening == "[[" and last:
                self._counts[whole] = self._counts.get(whole, -1) + 1
            if whole in self._counts:
                whole = (*whole, self._counts[whole])
        self._note(whole, line)
        return whole

    def _names(self, *closing: str) -> Path:
        """Names up to a mark, as they are written: bare, quoted, dotted."""
        begun = self._tokens[self._at][2]
        while self._at < len(self._tokens) and self._tokens[self._at][1] not in closing:
            self._at += 1
        end = self._tokens[self._at][2] if self._at < len(self._tokens) else len(self._text)
        written = self._text[begun:end].strip()
        return tuple(next(part for part in match.groups() if part is not None) for match in _KEY.finditer(written))

    def _pair(self, table: Path) -> None:
        line = self._line(self._at)
        path = (*table, *self._names("=", "\n"))
        self._at += 1
        self._note(path, line)
        self._value(path)

    def _value(self, path: Path) -> None:
        self._pass_by()
        if self._at >= len(self._tokens):
            return
        token = self._tokens[self._at][1]
        if token in ("[", "[["):
            self._array(path)
        elif token == "{":
            self._inline(path)
        else:
            while self._at < len(self._tokens) and self._tokens[self._at][1] not in (",", "\n", "]", "]]", "}"):
                self._at += 1

    def _pass_by(self) -> None:
        while self._at < len(self._tokens) and (self._tokens[self._at][0] == "comment" or self._tokens[self._at][1] == "\n"):
            self._at += 1

    def _split(self) -> None:
        """Of two brackets in a row within an array, each is one of its own."""
        kind, token, start = self._tokens[self._at]
        if token in ("[[", "]]"):
            self._tokens[self._at : self._at + 1] = [(kind, token[0], start), (kind, token[0], start + 1)]

    def _array(self, path: Path) -> None:
        self._split()
        self._at += 1
        number = 0
        while True:
            self._pass_by()
            if self._at >= len(self._tokens):
                return
            self._split()
            token = self._tokens[self._at][1]
            if token == "]":
                self._at += 1
                return
            if token == ",":
                self._at += 1
                continue
            self._note((*path, number), self._line(self._at))
            self._value((*path, number))
            number += 1

    def _inline(self, path: Path) -> None:
        self._at += 1
        while True:
            self._pass_by()
            if self._at >= len(self._tokens):
                return
            token = self._tokens[self._at][1]
            if token == "}":
                self._at += 1
                return
            if token == ",":
                self._at += 1
                continue
            self._pair(path)
