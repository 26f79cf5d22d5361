"""The unit and the upward axis that a COLLADA file (.dae) states at its head; pinocchio reads neither.

The unit is applied here, as the format wants it and as RViz and Gazebo do. The axis is not, and is noted where it is
another than z: RViz, MoveIt and pinocchio leave it out too, so the poses in public URDFs were made for meshes that are
not turned. Where nothing is stated, it is metres.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError, iterparse

from qpsafe.errors import RobotFileError

_NO_AXIS = ("", "Z_UP")


class Head(NamedTuple):
    """What a file states: metres in one of its units, and its upward axis, "" where it states none."""

    metres: float = 1.0
    axis: str = ""


def head_of(path: Path, where: str, mesh: Path) -> Head:
    """What a mesh states at its head; metres and no axis where it is no COLLADA file.

    Args:
        path: The model file, for errors.
        where: What names the mesh in it.
        mesh: The mesh.

    Raises:
        RobotFileError: It is no XML, or its unit is none.
    """
    if mesh.suffix.lower() != ".dae":
        return Head()
    try:
        asset = _asset(mesh)
    except (OSError, ParseError, ValueError) as error:
        raise RobotFileError(path, where, str(mesh), f"a COLLADA file ({error})") from error
    unit = None if asset is None else asset.find("{*}unit")
    text = "1" if unit is None else unit.get("meter", "1")
    try:
        metres = float(text)
    except ValueError:
        metres = math.nan
    if not 0.0 < metres < math.inf:
        raise RobotFileError(path, f"{where}: {mesh.name}: unit meter", text, "a finite number above zero")
    axis = "" if asset is None else asset.findtext("{*}up_axis", "")
    return Head(metres, axis.strip())


def said_of(heads: dict[str, Head]) -> list[str]:
    """Notes on what meshes state that other readers may take differently.

    Args:
        heads: By name of the mesh.
    """
    notes = []
    scaled = [f"{name} ({head.metres:g} m)" for name, head in heads.items() if head.metres != 1.0]
    if scaled:
        notes.append(f"meshes are in the unit that they state, which not every reader applies: {', '.join(scaled)}")
    turned = [f"{name} ({head.axis})" for name, head in heads.items() if head.axis not in _NO_AXIS]
    if turned:
        notes.append(f"meshes are not turned to the upward axis that they state, as in RViz: {', '.join(turned)}")
    return notes


def _asset(mesh: Path) -> Element | None:
    """The <asset> of the whole file, its first element; what follows it, the mesh, is not read."""
    depth = 0
    with mesh.open("rb") as file:
        for event, element in iterparse(file, events=("start", "end")):
            depth += 1 if event == "start" else -1
            if event == "end" and depth == 1 and element.tag.rpartition("}")[2] == "asset":
                return element
    return None
