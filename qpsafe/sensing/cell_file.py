"""A robot's cell as a small TOML file: what stands there by plan, and is no danger.

[[box]]
name = "table"
size = [0.8, 1.2, 0.05]      # full edges, m
centre = [0.9, 0.0, 0.1]     # robot base frame, m

[[hull]]
name = "ramp"
vertices = [[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.4, 0.0, 0.0], [1.4, 0.4, 0.3]]   # at least four, m
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpsafe.errors import ConfigurationError
from qpsafe.sensing.hulls import Obstacle

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Vector = tuple[_Finite, _Finite, _Finite]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Box(_Table):
    name: str
    size: _Vector
    centre: _Vector


class _Hull(_Table):
    name: str
    vertices: tuple[_Vector, ...]


class _Cell(_Table):
    box: tuple[_Box, ...] = ()
    hull: tuple[_Hull, ...] = ()


def load_cell(path: str | Path) -> tuple[Obstacle, ...]:
    """Known obstacles from a file, for `SafetyController(known=...)`.

    Raises:
        ConfigurationError: Names what is wrong, and where.
    """
    path = Path(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigurationError(path, "file", path.name, f"a readable TOML file ({error})") from None
    try:
        cell = _Cell.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise ConfigurationError(path, key, first["input"], first["msg"]) from None
    boxes = [Obstacle.box(box.name, box.size, box.centre) for box in cell.box]
    return (*boxes, *(Obstacle(hull.name, np.array(hull.vertices)) for hull in cell.hull))
