from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.errors import FileError
from stridecast.formats.numbers import parse_numbers

LINES = range(1, 1_000_000)


def values(text: str) -> list[float]:
    return parse_numbers(text.encode(), path="x.bvh", lines=LINES).values.tolist()


@given(
    st.lists(
        st.one_of(
            st.floats(allow_nan=False, allow_infinity=False).map(repr),
            st.floats(-1e4, 1e4).map("{:.6f}".format),
            st.floats(-1e4, 1e4).map("{:+.17e}".format),
            st.from_regex(
                r"[+-]?([0-9]{1,25}\.?[0-9]{0,25}|\.[0-9]{1,25})([eE][+-]?[0-9]{1,3})?", fullmatch=True
            ).filter(str.isascii),
        )
    )
)
def test_agrees_with_float(words: list[str]):
    read = values(" ".join(words))
    assert len(read) == len(words)
    for got, word in zip(read, words, strict=True):
        want = float(word)
        if abs(want) > 1e-300:
            assert math.isclose(got, want, rel_tol=1e-15), word
        else:
            assert abs(got - want) < 1e-305, word


@given(st.integers(-(10**15) + 1, 10**15 - 1), st.integers(0, 22))
def test_fifteen_digits_are_exact(digits: int, decimals: int):
    word = f"{digits}e-{decimals}"
    assert values(word) == [float(word)]


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("2.83e-014", 2.83e-14),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("-0.0000", 0.0),
        ("1e400", math.inf),
        ("1e-400", 0.0),
        ("1e999999999999999999999", math.inf),
        ("4.9e-324", 5e-324),
        ("123456789012345678901234567890", 1.2345678901234568e29),
        ("0." + "0" * 400 + "1", 0.0),
    ],
)
def test_spellings(word: str, value: float):
    assert values(word) == [pytest.approx(value, rel=1e-15, abs=1e-323)]


@pytest.mark.parametrize(
    "word", ["nan", "NaN", "-nan", "nan(ind)", "inf", "-Infinity", "1.#IND", "-1.#QNAN0", "1.#INF00"]
)
def test_no_numbers_become_nan(word: str):
    assert np.isnan(values(f"1 {word}\n2")).tolist() == [False, True, False]


@given(st.lists(st.sampled_from([" ", "\t", "\n", "\n\n", " \n\t "]), min_size=1, max_size=30))
def test_rows_are_lines(gaps: list[str]):
    text = "".join(f"{k}{gap}" for k, gap in enumerate(gaps))
    numbers = parse_numbers(text.encode(), path="x", lines=LINES)
    rows = [row for row, line in enumerate(text.split("\n")) for _ in line.split()]
    assert numbers.rows.tolist() == rows
    assert numbers.values.tolist() == list(range(len(gaps)))


@pytest.mark.parametrize("text", ["", " ", "\n\n\t"])
def test_nothing_is_nothing(text: str):
    assert values(text) == []


@pytest.mark.parametrize(
    "word",
    [
        "abc",
        "1.2.3",
        "--1",
        "+",
        "-",
        ".",
        "e5",
        "1e",
        "1e+",
        "1_000",
        "0x10",
        "1,5",
        "nano",
        "info",
        "1d5",
        "−1",
        "1-2",
    ],
)
def test_a_bad_word_is_reported_with_its_line(word: str):
    with pytest.raises(FileError) as caught:
        parse_numbers(f"1 2\n\n3 {word} 4\n5".encode(), path="walk.bvh", lines=range(10, 20))
    assert caught.value.line == 12
    assert str(caught.value).startswith(f"walk.bvh:12: a number should stand here, not {word!r}")


def test_decimal_commas_are_explained():
    with pytest.raises(FileError, match="decimals need a point, not a comma"):
        values("1,5")


def test_endless_words_are_cut_in_the_message():
    with pytest.raises(FileError) as caught:
        values("x" * 100_000)
    assert len(str(caught.value)) < 200
