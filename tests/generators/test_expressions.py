import math

import pytest

from fgf_warp.errors import ConfigError
from generators.planning.expressions import Expression


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2 * S_w", 6.0),
        ("-H ** 2 + 1", 0.75),
        ("7 // 2 + 7 % 4", 6.0),
        ("sqrt(S_w) * log(10) / log10(100)", math.sqrt(3) * math.log(10) / 2),
        ("max(H, S_w, 1) - min(1, 2) + abs(H)", 2.5),
        ("cos(pi) + sin(0) + exp(0)", 0.0),
        ("S_w if H < 0 else 1", 3.0),
        ("1 if look == 'dim' and not 0 < H <= 1 else 2", 2.0),
    ],
)
def test_numbers(text, expected):
    found = Expression(text).number({"H": -0.5, "S_w": 3.0, "look": "bright"})
    assert type(found) is float
    assert found == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("H < 0 or L > 1", True),
        ("H > 0 and L > 1", False),
        ("not H > 0", True),
        ("-1 < H < 0 < L", True),
        ("H != H", False),
    ],
)
def test_conditions(text, expected):
    assert Expression(text).holds({"H": -0.5, "L": 2.0}) is expected


def test_names_are_those_of_axes():
    assert Expression("sqrt(H) * pi if g > 0 else max(L, 1)").names == {"H", "g", "L"}


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__",
        "[x for x in (1,)]",
        "lambda: 1",
        "H[0]",
        "open('x')",
        "f'{H}'",
        "True",
        "1j",
        "H := 1",
        "max(key=H)",
        "(yield)",
        "1; 2",
        "import os",
        "",
        "(" * 500 + "1" + ")" * 500,
        "H < 0 " * 400,
    ],
)
def test_what_is_no_expression_is_refused(text):
    with pytest.raises(ConfigError, match="accepted: "):
        Expression(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 / (H + 0.5)", "has no value"),
        ("log(H)", "has no value"),
        ("9 ** 9 ** 9 ** 9", "has no value"),
        ("look * 2", "look is no number"),
        ("'%99999999s' % H", "is no number"),
        ("1 if H else 2", "H is neither true nor false"),
        ("look < 1", "has no value"),
        ("H < 0", "is True; accepted: a finite number"),
        ("1e308 * 10", "is inf; accepted: a finite number"),
        ("look", "is bright; accepted"),
    ],
)
def test_what_has_no_number_is_refused(text, message):
    with pytest.raises(ConfigError, match=message):
        Expression(text).number({"H": -0.5, "look": "bright"})


def test_a_sum_of_many_terms_has_a_value_and_of_too_many_is_refused():
    assert Expression("+".join(["H"] * 90)).number({"H": -0.5}) == -45
    for deep in ("+".join(["H"] * 200), "-" * 200 + "H", "not " * 200 + "(H < 0)", "max(" * 110 + "H" + ")" * 110):
        with pytest.raises(ConfigError, match=r"accepted: at most 100 operations|an expression of axes"):
            Expression(deep)


def test_a_condition_must_be_true_or_false():
    with pytest.raises(ConfigError, match=r"is -0\.5; accepted: a comparison"):
        Expression("H").holds({"H": -0.5})
