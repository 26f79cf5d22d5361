"""A camera's pose in the text of a cell's file: everything else in it, comments too, stays as it is."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.ranging.cell_cameras import quaternion_of
from qpsafe.text.lines import key_lines, toml_lines

if TYPE_CHECKING:
    from collections.abc import Sequence

_POSE = (("position",), ("quaternion",), ("look_at",), ("up",))


def pose_lines(pose: NDArray[np.float64], remark: str = "") -> list[str]:
    """Lines of a `[[camera]]` that say where it is.

    Args:
        pose: (4, 4) [m].
        remark: Behind the first one.
    """
    place = ", ".join(f"{x + 0.0:.5f}" for x in pose[:3, 3])
    turn = ", ".join(f"{x + 0.0:.7f}" for x in quaternion_of(pose[:3, :3]))
    return [f"position = [{place}]" + (f"  # {remark}" if remark else ""), f"quaternion = [{turn}]"]


def with_pose(text: str, number: int, pose: NDArray[np.float64], remark: str = "") -> str:
    """The text of a cell's file with another pose of a camera.

    Args:
        text: A file that can be read, with tables under `[[camera]]` headings.
        number: Of the camera, from 0.
        pose: Its pose (4, 4) [m].
        remark: Behind the first line of it.

    Raises:
        ConfigurationError: The camera does not stand under a heading of its own.
    """
    lines, places = toml_lines(text), key_lines(text)
    name = ("camera", number, "name")
    if name not in places:
        raise ConfigurationError("cell", f"camera[{number}]", "not under a heading", "a table under [[camera]]")
    for line in sorted((places[key] for key in places if key[:2] == name[:2] and key[2:] in _POSE), reverse=True):
        del lines[line - 1 : line - 1 + _length(lines[line - 1 :])]
    after = key_lines("\n".join(lines))[name]
    lines[after:after] = pose_lines(pose, remark)
    return "\n".join(lines) + "\n"


def _length(lines: Sequence[str]) -> int:
    """How many lines the value that begins on the first one takes."""
    for count in range(1, len(lines) + 1):
        try:
            tomllib.loads("\n".join(lines[:count]))
        except tomllib.TOMLDecodeError:
            continue
        return count
    return 1
