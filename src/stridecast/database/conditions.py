"""Conditions as text, such as ``speed > 1.2 and style < 0``: a small language of its own, of which nothing is executed.

::

    condition   = all {"or" all}
    all         = part {"and" part}
    part        = "not" part | "(" condition ")" | comparison
    comparison  = value {("<" | "<=" | ">" | ">=" | "=" | "==" | "!=") value}
                | value ["not"] "in" "(" value {"," value} ")"
    value       = number | 'text' | "text" | name of a column
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from stridecast.errors import InputError

Array = np.ndarray
Columns = Mapping[str, Array]
Rows = Callable[[Columns], Array]
"""Says of each row of a table whether it fits."""

LONGEST = 2000
"""Letters of a condition, at most."""

DEEPEST = 40
"""Brackets and ``not`` inside one another, at most."""

_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<text>'[^']*'|\"[^\"]*\")"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<sign><=|>=|==|!=|<|>|=|\(|\)|,))",
    re.ASCII,
)
_COMPARE: Mapping[str, Callable[[Array, Array], Array]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
    "==": operator.eq,
    "!=": operator.ne,
}
_WORDS = ("and", "or", "not", "in")


def fitting(text: str, columns: Columns) -> Bool[Array, "rows"]:
    """Rows of a table that fit a condition.

    Parameters
    ----------
    text
        The condition.
    columns
        The table: columns of numbers or of text, all of one length.

    Raises
    ------
    InputError
        A condition that cannot be read (the place is told), or that names no column of the table (they are listed).
    """
    if len(text) > LONGEST:
        raise InputError(f"a condition may have {LONGEST} letters, not {len(text)}")
    reader = _Reader(text, columns)
    condition = reader.condition()
    reader.end()
    return condition(columns)


def _opposite(rows: Rows) -> Rows:
    return lambda columns: ~rows(columns)


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    place: int


@dataclass(frozen=True)
class _Value:
    """A value and whether it is text, as it was written."""

    get: Callable[[Columns], Array]
    is_text: bool
    written: str


class _Reader:
    """Reads a condition, from left to right."""

    def __init__(self, text: str, columns: Columns) -> None:
        self.text = text
        self.columns = columns
        self.rows = len(next(iter(columns.values())))
        self.tokens = self._split(text)
        self.next = 0
        self.depth = 0

    def _split(self, text: str) -> list[_Token]:
        out, place = [], 0
        while text[place:].strip():
            found = _TOKEN.match(text, place)
            if found is None or found.lastgroup is None:
                at = place + len(text[place:]) - len(text[place:].lstrip())
                raise self._wrong(f"{text[at]!r} cannot stand here", at)
            kind, word = found.lastgroup, found[found.lastgroup]
            if kind == "name" and word.lower() in _WORDS:
                kind, word = "word", word.lower()
            out.append(_Token(kind, word, found.start(found.lastgroup)))
            place = found.end()
        return out

    def _wrong(self, what: str, place: int) -> InputError:
        return InputError(f"condition {self.text!r}, letter {place + 1}: {what}")

    def _peek(self) -> _Token:
        if self.next < len(self.tokens):
            return self.tokens[self.next]
        return _Token("end", "the end", len(self.text))

    def _take(self, *words: str) -> bool:
        here = self._peek()
        if here.kind in ("word", "sign") and here.text in words:
            self.next += 1
            return True
        return False

    def end(self) -> None:
        here = self._peek()
        if here.kind != "end":
            raise self._wrong(f"'and' or 'or' should stand here, not {here.text!r}", here.place)

    def condition(self) -> Rows:
        parts = [self._all()]
        while self._take("or"):
            parts.append(self._all())
        return parts[0] if len(parts) == 1 else lambda columns: np.any([part(columns) for part in parts], axis=0)

    def _all(self) -> Rows:
        parts = [self._part()]
        while self._take("and"):
            parts.append(self._part())
        return parts[0] if len(parts) == 1 else lambda columns: np.all([part(columns) for part in parts], axis=0)

    def _part(self) -> Rows:
        self.depth += 1
        here = self._peek()
        if self.depth > DEEPEST:
            raise self._wrong(f"more than {DEEPEST} brackets inside one another", here.place)
        if self._take("not"):
            out = _opposite(self._part())
        elif self._take("("):
            out = self.condition()
            self._close()
        else:
            out = self._comparison()
        self.depth -= 1
        return out

    def _close(self) -> None:
        here = self._peek()
        if not self._take(")"):
            raise self._wrong(f"a bracket should close here, not {here.text!r}", here.place)

    def _comparison(self) -> Rows:
        values, signs = [self._value()], []
        excluded = self._take("not")
        if self._take("in"):
            return self._membership(values[0], excluded)
        here = self._peek()
        while not excluded and here.kind == "sign" and here.text in _COMPARE:
            self.next += 1
            signs.append(here.text)
            values.append(self._value())
            self._check(values[-2], here, values[-1])
            here = self._peek()
        if not signs:
            wanted = "'in'" if excluded else "a comparison such as < or ="
            raise self._wrong(f"{wanted} should stand here, not {here.text!r}", here.place)

        def compare(columns: Columns) -> Array:
            got = [value.get(columns) for value in values]
            return np.all([_COMPARE[sign](a, b) for sign, (a, b) in zip(signs, pairwise(got), strict=True)], axis=0)

        return compare

    def _membership(self, value: _Value, excluded: bool) -> Rows:
        here = self._peek()
        if not self._take("("):
            raise self._wrong(f"a list in brackets should stand here, not {here.text!r}", here.place)
        members = [self._value()]
        while self._take(","):
            members.append(self._value())
        self._close()
        for member in members:
            self._check(value, _Token("sign", "=", here.place), member)

        def among(columns: Columns) -> Array:
            inside = np.any([value.get(columns) == member.get(columns) for member in members], axis=0)
            return ~inside if excluded else inside

        return among

    def _check(self, a: _Value, sign: _Token, b: _Value) -> None:
        if a.is_text != b.is_text:
            raise self._wrong(f"{a.written} and {b.written} cannot be compared: one is text", sign.place)
        if a.is_text and sign.text not in ("=", "==", "!="):
            raise self._wrong(f"text is compared by = and !=, not by {sign.text}", sign.place)

    def _value(self) -> _Value:
        here = self._peek()
        if here.kind == "number":
            number = np.full(self.rows, float(here.text))
            value = _Value(lambda _: number, False, here.text)
        elif here.kind == "text":
            text = np.full(self.rows, here.text[1:-1])
            value = _Value(lambda _: text, True, here.text)
        elif here.kind == "name":
            if here.text not in self.columns:
                have = ", ".join(self.columns)
                hint = f"; text is put in quotes: '{here.text}'"
                raise self._wrong(f"there is no column {here.text!r}; there are {have}{hint}", here.place)
            name = here.text
            value = _Value(lambda columns: columns[name], self.columns[name].dtype.kind == "U", name)
        else:
            raise self._wrong(f"a number, a text or a column should stand here, not {here.text!r}", here.place)
        self.next += 1
        return value
