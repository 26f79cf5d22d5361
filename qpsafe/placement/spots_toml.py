"""Writing a placement as the `spots.toml`, or the file of arrays, that the controller loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from qpsafe.placement.candidates import Candidates
from qpsafe.text.json_text import json_text
from qpsafe.text.whole_file import whole_file


def spots_toml(candidates: Candidates, chosen: Sequence[int], remark: str) -> str:
    """The text of a `spots.toml` with the chosen nodes, base to tip.

    Positions are rounded to 0.01 mm and directions to 1e-7: the loader makes them unit vectors again.

    Args:
        candidates: The nodes.
        chosen: Those that carry a spot.
        remark: How the placement came about, for people.
    """
    nodes, sensor = candidates.nodes, candidates.sensor
    lines = [f"# {line}" for line in wrap(remark, 118)]
    lines += [
        "",
        f"sensor = {json_text(sensor.name)}",
        f"range_min = {sensor.range_min!r}    # [m]",
        f"range_max = {sensor.range_max!r}    # [m]",
    ]
    angle = repr(round(float(np.rad2deg(sensor.field_of_view)), 9))
    if sensor.is_array:
        lines += [
            f"field_of_view = {angle} # [deg] from edge to edge",
            f"zones = {list(sensor.zones)} # rows, columns",
            f"rate = {sensor.rate!r} # [Hz]",
            f"sigma = {sensor.sigma!r} # [m] of a reading",
        ]
    else:
        lines.append(f"field_of_view = {angle} # [deg] full angle of the cone it sees")
    for i in sorted(int(i) for i in chosen):
        lines += [
            "",
            "[[spot]]",
            f"name = {json_text(nodes.names[i])}",
            f"link = {int(nodes.links[i]) + 1}",
            f"frame = {json_text(nodes.frames[i])}",
            f"position = {_vector(nodes.positions[i], 5)}",
            f"direction = {_vector(nodes.directions[i], 7)}",
        ]
    return "\n".join(lines) + "\n"


def write_spots(path: Path, candidates: Candidates, chosen: Sequence[int], remark: str) -> None:
    """Write `spots_toml` whole or not at all.

    Args:
        path: The file.
        candidates: All nodes.
        chosen: Which of them carry a spot.
        remark: First comment in the file.
    """
    with whole_file(path) as part:
        part.write_text(spots_toml(candidates, chosen, remark), encoding="utf-8")


def _vector(values: np.ndarray, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(x), digits) + 0.0:.{digits}f}" for x in values) + "]"
