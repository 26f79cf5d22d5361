"""Pairs as people's programs write them: read as they were meant, or refused with what is wrong; never otherwise."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.sharp import SharpCurve
from qpsafe.sensing.skin.calibration import fit_curve, implausible
from qpsafe.sensing.skin.pairs_file import read_pairs

DISTANCES = {"m": 1, "cm": 100, "mm": 1000}
VOLTAGES = {"V": 1, "mV": 1000}
SHAPES = ("{0}", "{0} [{1}]", "{0}_{1}", "{0} ({1})", "{0}/{1}", "{0} {1}", "{0} in {1}", " {0}  [ {1} ] ")
names = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters="#"), min_size=1, max_size=8)
tables = st.lists(st.tuples(names, st.integers(1, 5000), st.integers(0, 5000)), min_size=1, max_size=5)  # mm, mV


@st.composite
def files(draw: Any) -> tuple[list[tuple[str, float, float]], str, str, str]:
    """A table, its text, its encoding and its delimiter."""
    table, delimiter = draw(tables), draw(st.sampled_from(",;\t|"))
    decimal = draw(st.sampled_from(".,"))
    units = draw(st.sampled_from(list(DISTANCES))), draw(st.sampled_from(list(VOLTAGES)))
    shapes = [draw(st.sampled_from(SHAPES[1 if unit not in ("m", "V") else 0 :])) for unit in units]
    heading = {
        "spot": draw(st.sampled_from(("spot", "Spot", "SPOT"))),
        "distance": shapes[0].format("distance", units[0]),
        "voltage": shapes[1].format("Voltage", units[1]),
        "note": "remark",
    }
    order = draw(st.permutations(list(heading)))
    rows = [[heading[name] for name in order]]
    for spot, mm, mv in table:
        numbers = f"{mm * DISTANCES[units[0]] / 1000:.6f}", f"{mv * VOLTAGES[units[1]] / 1000:.6f}"
        cells = {"spot": spot, "note": draw(st.sampled_from(("", "7", "a b")))}
        cells |= dict(zip(("distance", "voltage"), (text.replace(".", decimal) for text in numbers), strict=True))
        rows.append([cells[name] for name in order])
    out = io.StringIO()
    quoting = draw(st.sampled_from((csv.QUOTE_MINIMAL, csv.QUOTE_ALL)))
    end = draw(st.sampled_from(("\n", "\r\n", "\r")))
    csv.writer(out, delimiter=delimiter, quoting=quoting, lineterminator=end).writerows(rows)
    head = draw(st.sampled_from(("", f"sep={delimiter}{end}", f"# by, a; logger{end}{end}")))
    code = draw(st.sampled_from(("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32")))
    if head and code in ("utf-16-le", "utf-16-be"):
        head = ""  # without a mark the first letter tells
    pairs = [(spot, mm / 1000, mv / 1000) for spot, mm, mv in table]
    return pairs, head + out.getvalue(), code, delimiter


@settings(max_examples=some(13, of=80))
@given(files())
def test_what_was_meant_is_read(tmp_path_factory: Any, file: Any) -> None:
    pairs, text, code, _ = file
    path = tmp_path_factory.getbasetemp() / "pairs.csv"
    path.write_bytes(text.encode(code))
    found = read_pairs(path)
    assert [spot for spot, _, _ in found] == [spot for spot, _, _ in pairs]
    assert [numbers for _, *numbers in found] == [pytest.approx(numbers, abs=1e-9) for _, *numbers in pairs]


@settings(max_examples=some(13, of=80))
@given(files(), st.data())
def test_what_is_damaged_is_read_or_refused_by_name(tmp_path_factory: Any, file: Any, data: Any) -> None:
    _, text, code, _ = file
    content = bytearray(text.encode(code))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        piece = data.draw(st.binary(max_size=3) | st.sampled_from((b",", b";", b'"', b"\n", b"\0", b"1e999", b"-")))
        content[at : at + data.draw(st.integers(0, 3))] = piece
    path = tmp_path_factory.getbasetemp() / "pairs.csv"
    path.write_bytes(bytes(content))
    try:
        found = read_pairs(path)
    except qpsafe.ConfigurationError:
        return
    assert found
    assert all(0.0 < d <= 5.0 and 0.0 <= v <= 5.0 for _, d, v in found)


@given(st.integers(100, 990), st.integers(100, 999))
def test_a_decimal_comma_between_commas_is_never_read_as_two_numbers(tmp_path_factory: Any, d: int, v: int) -> None:
    path = tmp_path_factory.getbasetemp() / "pairs.csv"
    path.write_text(f"spot,distance_cm,voltage_V\ns1,{d / 10},{v / 100}\n".replace(".", ","))
    with pytest.raises(qpsafe.ConfigurationError, match="decimal comma"):
        read_pairs(path)


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("spot;abstand;voltage", "semicolons between 3 columns; distance is missing"),
        ("20\t2.5", "tabs between 2 columns; spot is missing, distance is missing, voltage is missing"),
        ("spot|distance|voltage|voltage_mV", "voltage is there 2 times"),
        ("spot,distance [ft],voltage", "commas between 3 columns; distance is missing"),
        ("nothing of the kind", "no delimiter"),
    ],
)
def test_the_delimiter_found_and_the_columns_missing_are_named(tmp_path: Path, heading: str, said: str) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text(f"# a logger\n{heading}\n")
    with pytest.raises(qpsafe.ConfigurationError, match="line 2") as caught:
        read_pairs(path)
    assert said in caught.value.expected


@settings(max_examples=some(12, of=30))
@given(
    st.floats(0.95, 1.05),
    st.sampled_from([(1.0, 1.0, None), (3.2808, 1.0, "feet"), (1.0, 0.66, "3.3 V?"), (1.0, 5.0 / 3.3, "5 V?")]),
)
def test_numbers_in_other_units_are_named(gain: float, unit: tuple[float, float, str | None]) -> None:
    """Units of the sensor may differ by a twentieth; what is off by a unit is said, with a guess."""
    by, volts, guess = unit
    d = np.linspace(0.2, 0.8, 41) / min(by, 1.5)
    fit = fit_curve("a", by * d, volts * SharpCurve(0.7 * gain).voltage(d))
    odd = implausible(fit)
    assert odd is None if guess is None else guess in str(odd)
