"""A robot's cell as a small TOML file: what stands there by plan, and is no danger.

[[box]]
name = "table"
size = [0.8, 1.2, 0.05]      # full edges, m
centre = [0.9, 0.0, 0.1]     # robot base frame, m

[[hull]]
name = "ramp"
vertices = [[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.4, 0.0, 0.0], [1.4, 0.4, 0.3]]   # at least four, m

Its `[[camera]]` tables say what looks at the cell; `qpsafe.ranging.cell_cameras.load_cameras` reads them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from qpsafe.errors import ConfigurationError
from qpsafe.robot.robot_file.parameter_tables import Number
from qpsafe.sensing.camera_table import KINDS, CameraTable
from qpsafe.sensing.hulls import Obstacle
from qpsafe.text.toml_text import Keys, TomlText

_Vector = tuple[Number, Number, Number]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Box(_Table):
    name: str
    size: _Vector
    centre: _Vector

    def obstacle(self) -> Obstacle:
        return Obstacle.box(self.name, self.size, self.centre)


class _Hull(_Table):
    name: str
    vertices: tuple[_Vector, ...]

    def obstacle(self) -> Obstacle:
        return Obstacle(self.name, np.array(self.vertices))


class CellFile(_Table):
    """Contents of a cell's file."""

    box: tuple[_Box, ...] = ()
    hull: tuple[_Hull, ...] = ()
    camera: tuple[CameraTable, ...] = ()


def read_cell(path: str | Path) -> tuple[TomlText, CellFile]:
    """The text of a cell's file, and what it says.

    Raises:
        ConfigurationError: Names file, line, key and value of what is wrong.
    """
    if not isinstance(path, str | Path):
        raise ConfigurationError("cell", "path", path, "the path of a TOML file")
    text = TomlText.read(Path(path))
    return text, text.checked(CellFile, _is_key)


def _is_key(before: Keys, key: str | int) -> bool:
    """pydantic names the kind of a camera between its number and its key."""
    return not (key in KINDS and len(before) == 2 and before[0] == "camera")


def load_cell(path: str | Path) -> tuple[Obstacle, ...]:
    """Known obstacles from a file, for `SafetyController(known=...)`; its cameras are none.

    Raises:
        ConfigurationError: Names file, line, key and value of what is wrong.
    """
    text, content = read_cell(path)
    found = []
    kinds: tuple[tuple[str, tuple[_Box | _Hull, ...]], ...] = (("box", content.box), ("hull", content.hull))
    for kind, items in kinds:
        for k, item in enumerate(items):
            try:
                found.append(item.obstacle())
            except ConfigurationError as problem:
                raise text.wrong((kind, k, problem.key), problem.value, problem.expected) from None
    return tuple(found)
