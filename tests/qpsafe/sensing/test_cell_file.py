"""A cell's file gives the obstacles that it describes, or says what is wrong in it and where."""

from pathlib import Path

import numpy as np
import pytest

import qpsafe

GOOD = """
[[box]]
name = "table"
size = [0.8, 1.2, 0.05]
centre = [0.9, 0.0, 0.1]

[[hull]]
name = "ramp"
vertices = [[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.4, 0.0, 0.0], [1.4, 0.4, 0.3]]
"""


def test_boxes_and_hulls(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD)
    table, ramp = qpsafe.load_cell(path)
    assert (table.name, ramp.name) == ("table", "ramp")
    same = qpsafe.Obstacle.box("table", (0.8, 1.2, 0.05), (0.9, 0.0, 0.1))
    assert np.array_equal(table.vertices, same.vertices)
    assert ramp.vertices.shape == (4, 3)
    path.write_text("")
    assert qpsafe.load_cell(path) == ()


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("[[box]]\nname = 1", r"cell\.toml:2: box\[0\]\.name = 1"),
        (GOOD.replace("size", "sise"), r"cell\.toml:2: box\[0\]\.size = 'nothing'"),
        (GOOD.replace("0.05", "inf"), r"cell\.toml:4: box\[0\]\.size\[2\] = inf"),
        (GOOD.replace("0.05", "-0.05"), r"cell\.toml:4: box\[0\]\.size = .*-0\.05"),
        (GOOD.replace("[1.4, 0.4, 0.3]", "[1.4, 0.4, 0.0]"), r"cell\.toml:9: hull\[0\]\.vertices"),
        ("[[box", r"cell\.toml:1: file = .*TOML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, word: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(qpsafe.ConfigurationError, match=word):
        qpsafe.load_cell(path)
    with pytest.raises(qpsafe.ConfigurationError, match="no-such"):
        qpsafe.load_cell(tmp_path / "no-such.toml")
