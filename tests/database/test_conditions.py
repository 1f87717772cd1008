from __future__ import annotations

import string
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stridecast.database.conditions import DEEPEST, LONGEST, fitting
from stridecast.errors import InputError

COLUMNS = {
    "take": np.array(["01_01", "01_02", "walk it", "x"]),
    "speed": np.array([0.5, 1.2, 1.3, 3.0]),
    "style": np.array([-0.9, 0.0, 0.4, -0.2]),
}
ROWS = len(COLUMNS["speed"])
WORDS = ["and", "or", "not", "in", "(", ")", ",", "<", "<=", ">", ">=", "=", "==", "!="]
VALUES = ["speed", "style", "take", "1.2", "-3", "1e2", "'x'", '"01_01"', "nonsense"]


@pytest.mark.parametrize(
    ("condition", "rows"),
    [
        ("speed > 1.2", [2, 3]),
        ("speed>=1.2 and style<0.1", [1, 3]),
        ("speed > 2 or style < -0.5", [0, 3]),
        ("not speed > 1.2", [0, 1]),
        ("not (speed > 1.2 or style = 0)", [0]),
        ("speed < 1 or speed > 1 and style > 0", [0, 2]),  # and binds closer
        ("0.5 < speed <= 1.3", [1, 2]),
        ("1.2 < speed", [2, 3]),
        ("style < speed", [0, 1, 2, 3]),
        ("take = '01_02'", [1]),
        ('take == "walk it"', [2]),
        ("take != 'x'", [0, 1, 2]),
        ("take in ('x', '01_01')", [0, 3]),
        ("take not in ('x')", [0, 1, 2]),
        ("speed in (0.5, 3)", [0, 3]),
        ("speed = 12e-1 AND NOT style > 0", [1]),
        ("style > -.5 and style < +.2", [1, 3]),
        ("1 < 2", [0, 1, 2, 3]),
        ("2 in (1, 3)", []),
        ("1 < 2 < speed", [3]),
    ],
)
def test_conditions_choose_rows(condition, rows):
    assert np.flatnonzero(fitting(condition, COLUMNS)).tolist() == rows


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_conditions_agree_with_numpy(a, b):
    speed, style = COLUMNS["speed"], COLUMNS["style"]
    expected = ((speed > a) & ~(style <= b)) | (speed == style)
    assert (fitting(f"speed > {a!r} and not style <= {b!r} or speed = style", COLUMNS) == expected).all()


@given(st.one_of(st.text(max_size=60), st.text(string.printable, max_size=60)))
def test_any_text_is_a_condition_or_is_refused(text):
    with suppress(InputError):
        rows = fitting(text, COLUMNS)
        assert rows.dtype == bool
        assert rows.shape == (ROWS,)


@given(st.lists(st.sampled_from(WORDS + VALUES), max_size=16).map(" ".join))
def test_words_in_any_order_are_a_condition_or_are_refused(text):
    with suppress(InputError):
        assert fitting(text, COLUMNS).shape == (ROWS,)


@pytest.mark.parametrize(
    "attack",
    [
        "__import__('os').system('touch {file}')",
        "().__class__.__bases__[0].__subclasses__()",
        "speed.__class__",
        "open('{file}', 'w')",
        "eval('1')",
        "[x for x in (1,)]",
        "lambda: 1",
        "speed if 1 else 2",
        "take.__len__() > 1",
        "f'{file}' = take",
        "speed := 3",
        "speed; speed",
        "speed ** 999999999 > 1",
        "speed\x00 > 1",
    ],
)
def test_nothing_is_ever_executed(attack, tmp_path):
    file = tmp_path / "made"
    with pytest.raises(InputError, match="condition"):
        fitting(attack.replace("{file}", str(file)), COLUMNS)
    assert not file.exists()


@pytest.mark.parametrize(
    ("condition", "says"),
    [
        ("sped > 1", "letter 1: there is no column 'sped'; there are take, speed, style"),
        ("speed > fast", "letter 9: there is no column 'fast'.*text is put in quotes: 'fast'"),
        ("speed > 'x'", "letter 7: speed and 'x' cannot be compared: one is text"),
        ("take = 3", "cannot be compared"),
        ("take < 'x'", "text is compared by = and !=, not by <"),
        ("speed", "letter 6: a comparison such as < or = should stand here, not 'the end'"),
        ("", "a number, a text or a column should stand here"),
        ("speed > 1 style < 2", "letter 11: 'and' or 'or' should stand here, not 'style'"),
        ("(speed > 1", "letter 11: a bracket should close here"),
        ("speed > 1)", "letter 10: 'and' or 'or' should stand here"),
        ("speed not > 1", "'in' should stand here"),
        ("speed in 3", "a list in brackets should stand here"),
        ("speed > 1 & style < 2", "letter 11: '&' cannot stand here"),
        ("take = 'x", 'letter 8: "\'" cannot stand here'),
    ],
)
def test_refusals_tell_the_place_and_what_would_be_right(condition, says):
    with pytest.raises(InputError, match=says):
        fitting(condition, COLUMNS)


def test_endless_conditions_are_refused():
    with pytest.raises(InputError, match=f"{LONGEST} letters"):
        fitting("speed > 1 or " * 500 + "speed > 1", COLUMNS)
    for opening in ("(", "not "):
        with pytest.raises(InputError, match=f"more than {DEEPEST} brackets"):
            fitting(opening * 300 + "speed > 1", COLUMNS)
