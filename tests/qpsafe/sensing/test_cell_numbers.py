"""Every number of a cell's file is one, and every ray of a scanner in it looks its own way."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe

POSE = "position = [1.5, 0.0, 2.6]\nquaternion = [1.0, 0.0, 0.0, 0.0]\n"
SHARED = "range_min = 0.05\nrange_max = 4.0\nrate = 30.0\nsigma = 0.01\nmax_age = 0.5\n"
SCANNER = f"""[[camera]]
name = "s"
kind = "scanner"
angle_min = -90.0
increment = 0.5
rays = 361
{POSE}{SHARED}"""
TABLES = {
    "box": '[[box]]\nname = "t"\nsize = [0.8, 1.2, 0.05]\ncentre = [0.9, 2.0, 0.1]\n',
    "hull": '[[hull]]\nname = "r"\nvertices = [[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.4, 0.0, 0.0], [1.4, 0.4, 0.3]]\n',
    "pixels": '[[camera]]\nname = "d"\nkind = "depth"\nresolution = [64, 48]\nfield_of_view = [90.0, 60.0]\n'
    + f"position = [1.5, 0.0, 2.6]\nlook_at = [0.4, 0.0, 0.3]\nup = [0.0, 0.0, 1.0]\n{SHARED}",
    "intrinsics": '[[camera]]\nname = "i"\nkind = "depth"\nresolution = [64, 48]\n'
    + f"intrinsics = [60.0, 60.0, 31.5, 23.5]\n{POSE}{SHARED}",
    "array": f'[[camera]]\nname = "a"\nkind = "array"\nzones = [8, 8]\nfield_of_view = 45.0\n{POSE}{SHARED}',
    "scanner": SCANNER,
}
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
PLACES = [
    pytest.param(name, match.span(), id=f"{name}-{match.start()}")
    for name, text in TABLES.items()
    for match in NUMBER.finditer(text)
]


def read(text: str, folder: Path) -> tuple[object, ...]:
    path = folder / "cell.toml"
    path.write_text(text)
    return (*qpsafe.load_cell(path), *qpsafe.load_cameras(path))


@pytest.mark.parametrize(("name", "span"), PLACES)
def test_no_boolean_and_no_text_is_a_number(name: str, span: tuple[int, int], tmp_path: Path) -> None:
    text = TABLES[name]
    start, end = span
    line = text.count("\n", 0, start) + 1
    key = text.splitlines()[line - 1].partition(" ")[0]
    for word in ("true", "false", f'"{text[start:end]}"', '"1"'):
        with pytest.raises(qpsafe.ConfigurationError) as refused:
            read(text[:start] + word + text[end:], tmp_path)
        assert refused.value.where == f"{tmp_path / 'cell.toml'}:{line}"
        assert f".{key}" in refused.value.key
        assert refused.value.value == {"true": True, "false": False}.get(word, word.strip('"'))


@pytest.mark.parametrize("name", TABLES)
def test_a_whole_number_is_a_number_too(name: str, tmp_path: Path) -> None:
    """`1` for `1.0`, wherever a number is whole."""
    (said,), (whole,) = (read(text, tmp_path) for text in (TABLES[name], re.sub(r"(?<=\d)\.0\b", "", TABLES[name])))
    assert repr(said) == repr(whole)


def scanner(rays: int, increment: float) -> str:
    return SCANNER.replace("361", f"{rays}").replace("increment = 0.5", f"increment = {increment!r}")


@given(
    st.integers(1, 400) | st.integers(1, 20000),
    st.floats(-45.0, 45.0) | st.floats(-1.0, 1.0) | st.floats(-1e-3, 1e-3) | st.just(0.0),
)
def test_rays_that_coincide_are_refused_and_no_others(
    tmp_path_factory: pytest.TempPathFactory, rays: int, increment: float
) -> None:
    """Rays coincide that are less than a thousandth of a degree apart, or a turn, but for the last and the first."""
    try:
        (sensor,) = read(scanner(rays, increment), tmp_path_factory.getbasetemp())
    except qpsafe.ConfigurationError as refused:
        error = refused
    else:
        error = None
    if error is not None:
        assert error.key == "camera[0].increment"
        assert error.value == increment
        assert rays > 1
        assert abs(increment) < 1e-3 or (rays - 2) * abs(increment) > 360.0
        return
    assert isinstance(sensor, qpsafe.RangeSensor)
    angles = np.sort(np.arange(rays - 1) * increment)  # all but the last
    assert rays == 1 or (np.diff(angles) >= 0.99e-3).all()
    assert angles.max(initial=0.0) - angles.min(initial=0.0) <= 360.0


@pytest.mark.parametrize(
    ("rays", "increment"),
    [(361, 1.0), (1024, 0.3516), (1025, 0.3515625), (1, 0.0), (2, 45.0), (8, -45.0), (1081, 0.25)],
)
def test_scanners_as_they_are_sold_are_read(rays: int, increment: float, tmp_path: Path) -> None:
    assert len(read(scanner(rays, increment), tmp_path)) == 1


@pytest.mark.parametrize(("rays", "increment"), [(181, 0.0), (181, -0.0), (2, 1e-300), (20000, 1e-9), (181, 45.0)])
def test_a_scanner_whose_rays_coincide_is_refused_by_name(rays: int, increment: float, tmp_path: Path) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match=rf"cell\.toml:5: camera\[0\]\.increment = .*{rays} rays"):
        read(scanner(rays, increment), tmp_path)
