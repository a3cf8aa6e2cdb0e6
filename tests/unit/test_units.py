"""Quantities: text and numbers in, SI floats out."""

import math
import subprocess
import sys

import numpy as np
import pytest

from cesim.errors import InputError, number, percent, show
from cesim.units import to_si


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("45 rpm", "rad/s", 45.0 * math.pi / 30.0),
        ("-35 kV", "V", -35e3),
        ("0.9 mm", "m", 0.9e-3),
        ("1.1 mm", "m", 1.1e-3),
        ("30 deg", "rad", math.pi / 6.0),
        ("30°", "rad", math.pi / 6.0),
        ("120 kg/h", "kg/s", 120.0 / 3600.0),
        ("5000 1/s", "1/s", 5000.0),
        ("5 kHz", "1/s", 5000.0),
        ("8.96 g/cm3", "kg/m3", 8960.0),
        ("8.96 g/cm**3", "kg/m3", 8960.0),
        ("1 mA/m²", "A/m2", 1e-3),
        ("413 kV/m", "V/m", 413e3),
        ("25 µm", "m", 25e-6),
        ("30 %", "", 0.3),
        ("0.5", "", 0.5),
        ("1e-3 s", "s", 1e-3),
        (".5m", "m", 0.5),
    ],
)
def test_text_with_a_unit_becomes_an_si_number(text, unit, expected):
    assert to_si(text, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("text", ["1.1 mm", "0.9 mm", "0.7 mm", "3.3 mm", "123.456 mm"])
def test_millimetres_are_exact_to_the_last_bit(text):
    assert to_si(text, "m") == float(f"{text.split()[0]}e-3")


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2.0), np.int64(2), np.float64(2.0)])
def test_plain_numbers_are_si(value):
    result = to_si(value, "m")
    assert result == 2.0
    assert type(result) is float


@pytest.mark.parametrize(
    "value",
    [
        None, True, np.True_, 1j, b"1 m", [1.0], np.array(1.0), np.array([1.0, 2.0]), object(), math.nan, math.inf,
        -math.inf, 10**400, -(10**5000), "", "m", "one m", "0,9 m", "1.5.5 m", "nan m", "inf m", "1e400 m", "1_0 m",
        "1 m; import os", "__import__('os')", "9**9**9**9", "1 m**99999999", "1 m**9**9**9**9**9",
        "1 (m^9)^9^9^9", "1 m" + "m" * 10_000,
        "1 m\x00", "1", "1 furlongs_per_zeit", "1 kg", "1 m/s", "20 degC", "3 dB",
    ],
    ids=show,
)  # fmt: skip
def test_what_is_no_length_is_refused(value):
    with pytest.raises(InputError) as caught:
        to_si(value, "m")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(("text", "unit"), [("50 Hz", "rad/s"), ("50 rpm", "Hz"), ("30 deg", ""), ("0.5", "rad")])
def test_an_angle_is_no_pure_number(text, unit):
    with pytest.raises(InputError):
        to_si(text, unit)


def test_the_range_is_named_in_the_error():
    with pytest.raises(InputError) as caught:
        to_si(1e9, "rad/s", -1000, 1000)
    assert str(caught.value) == "is 1e9 rad/s, outside [-1000, 1000] rad/s"
    assert caught.value.value == 1e9
    assert caught.value.unit == "rad/s"
    assert caught.value.allowed == "[-1000, 1000] rad/s"
    assert to_si(1000, "rad/s", -1000, 1000) == 1000.0


def test_every_value_can_be_shown_in_one_short_line():
    class Bad:
        def __repr__(self):
            raise RuntimeError

    for value in (10**5000, "x" * 1000, "a\nb", Bad(), np.zeros((50, 50)), [0] * 1000):
        assert len(show(value)) <= 60
        assert "\n" not in show(value)
    assert [number(x) for x in (1e9, 1e-7, 0.25, -1e10)] == ["1e9", "1e-7", "0.25", "-1e10"]


def test_pint_is_imported_only_when_text_is_read():
    code = (
        "import sys, cesim.scenes\n"
        "scene = cesim.scenes.reference_machine()\n"
        "assert 'pint' not in sys.modules\n"
        "scene.drum.speed = '45 rpm'\n"
        "assert 'pint' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0213, "2.1 %"),
        (0.213, "21 %"),
        (0.994, "99 %"),
        (1.0, "100 %"),
        (12.34, "1234 %"),
        (3e-15, "3e-13 %"),
        (0, "0 %"),
    ],
)
def test_a_share_of_all_is_100_percent_and_no_power_of_ten(share, text):
    assert percent(share) == text
