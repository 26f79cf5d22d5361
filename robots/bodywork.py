"""What the bodies of the bundled robots are made of: convex pieces from a few figures, written into robot.xml.

Each robot's own `build_body.py` lists its pieces; no public mesh is used. A piece is seen (group 2) and, where it says
so, its convex hull also collides (group 3).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Points on a full circle, half as many on small ones; a multiple of 8, so that circles reach their radius on the axes.
SEGMENTS = 32

Points = NDArray[np.float64]
Origin = tuple[float, float, float]


@dataclass(frozen=True)
class Part:
    """One convex piece of a body, or lettering (which has faces of its own).

    Attributes:
        body: Body of robot.xml it belongs to.
        name: Name of the piece within the body.
        points: Corners, (k, 3) [m]; in the base frame at the zero pose where bodies are then parallel to it, else in
            the body's own frame.
        material: Name of a material of the robot.
        collides: Whether its hull also collides.
        faces: Triangles for a piece that is no hull, (f, 3), else None.
    """

    body: str
    name: str
    points: Points
    material: str = "paint"
    collides: bool = False
    faces: NDArray[np.int64] | None = None

    @property
    def label(self) -> str:
        """Name of the mesh and, with a suffix, of its geoms."""
        return f"{self.body}_{self.name}"

    def asset(self, origin: Origin) -> str:
        """The <mesh> element, to 0.1 mm, in the frame of the body whose origin is given in that of the points."""
        local = np.round(self.points - np.array(origin), 4) + 0.0  # no minus zero
        if self.faces is None:
            local = np.unique(local, axis=0)
            return f'<mesh name="{self.label}" vertex="{_numbers(local)}"/>'
        faces = " ".join(str(i) for i in self.faces.ravel())
        return f'<mesh name="{self.label}" inertia="shell" vertex="{_numbers(local)}" face="{faces}"/>'

    def geoms(self) -> list[str]:
        """The <geom> elements."""
        seen = f'<geom class="visual" name="{self.label}" type="mesh" mesh="{self.label}" material="{self.material}"/>'
        hull = f'<geom class="collision" name="{self.label}_hull" type="mesh" mesh="{self.label}"/>'
        return [seen, hull] if self.collides else [seen]


def _numbers(values: Points) -> str:
    return " ".join(f"{value:.4f}".rstrip("0").rstrip(".") for value in values.ravel())


def ring(axis: str, at: float, center: tuple[float, float], radius: float | tuple[float, float]) -> Points:
    """Points of a circle or ellipse in the plane `axis` = `at`.

    Args:
        axis: Normal of the plane, "x", "y" or "z".
        at: Where the plane cuts the axis [m].
        center: The other two coordinates of the centre, in the order x, y, z [m].
        radius: One radius, or one along each of the other two axes [m].
    """
    a, b = (radius, radius) if isinstance(radius, float) else radius
    t = np.linspace(0.0, 2 * np.pi, SEGMENTS if max(a, b) > 0.0235 else SEGMENTS // 2, endpoint=False)
    plane = np.column_stack([center[0] + a * np.cos(t), center[1] + b * np.sin(t)])
    return np.insert(plane, "xyz".index(axis), at, axis=1)


def lathe(axis: str, center: tuple[float, float], *profile: tuple[float, float]) -> Points:
    """A turned piece: circles (place along the axis, radius) about an axis through `center`."""
    return np.vstack([ring(axis, at, center, radius) for at, radius in profile])


def drum(axis: str, center: tuple[float, float], low: float, high: float, radius: float, edge: float = 0.004) -> Points:
    """A cylinder with broken edges."""
    return lathe(axis, center, (low, radius - edge), (low + edge, radius), (high - edge, radius), (high, radius - edge))


def block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], edge: float = 0.006) -> Points:
    """A box with broken edges."""
    low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
    corners = []
    for shrink in np.eye(3, dtype=bool):  # each corner is cut into three: full reach along one axis at a time
        inset = np.where(shrink, 0.0, edge)
        a, b = low + inset, high - inset
        corners += [[(a, b)[i][0], (a, b)[j][1], (a, b)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return np.array(corners)


def slab(low: float, high: float, discs: list[tuple[float, float, float]], edge: float = 0.010) -> Points:
    """A plate between y = low and y = high that wraps discs (x, z, radius), edges broken."""
    pieces = [drum("y", (x, z), low, high, radius, edge) for x, z, radius in discs]
    return np.vstack(pieces)


def dispenser(add: Callable[..., None], body: str = "tool") -> None:
    """A slim dispenser as a tool, in its own frame: mounted at the origin, its needle ends 0.14 m along z.

    Args:
        add: Called with body, name, points, material and whether it collides, for each piece.
        body: Body of robot.xml that it is.
    """
    add(body, "plate", drum("z", (0.0, 0.0), 0.0005, 0.012, 0.025, 0.001), "graphite", True)
    add(
        body,
        "body",
        lathe("z", (0.0, 0.0), (0.012, 0.018), (0.014, 0.020), (0.07, 0.020), (0.08, 0.016)),
        "steel",
        True,
    )
    add(body, "band", drum("z", (0.0, 0.0), 0.03, 0.05, 0.0208, 0.001), "paint", False)
    add(body, "nozzle", lathe("z", (0.0, 0.0), (0.078, 0.014), (0.108, 0.005)), "graphite", True)
    add(body, "needle", lathe("z", (0.0, 0.0), (0.105, 0.0025), (0.134, 0.002), (0.14, 0.0002)), "steel", True)


# Strokes of the letters needed, on a grid 4 wide and 6 high.
STROKES: dict[str, list[tuple[float, float, float, float]]] = {
    "I": [(2, 0, 2, 6)],
    "R": [(0, 0, 0, 6), (0, 6, 3, 6), (0, 3, 3, 3), (3.6, 3.6, 3.6, 5.4), (1.6, 3, 3.8, 0)],
    "B": [(0, 0, 0, 6), (0, 6, 3, 6), (0, 3.1, 3, 3.1), (0, 0, 3, 0), (3.5, 3.7, 3.5, 5.4), (3.7, 0.6, 3.7, 2.5)],
    "1": [(2.2, 0, 2.2, 6), (0.9, 4.7, 2.2, 6)],
    "4": [(3, 0, 3, 6), (0, 1.7, 4, 1.7), (0, 1.7, 3, 6)],
    "0": [(0, 0.7, 0, 5.3), (4, 0.7, 4, 5.3), (0.6, 6, 3.4, 6), (0.6, 0, 3.4, 0)],
    " ": [],
}


def lettering(text: str, origin: Points, along: Points, up: Points, height: float) -> tuple[Points, NDArray[np.int64]]:
    """Letters as thin raised boxes: corners and triangles.

    Args:
        text: What to write.
        origin: Lower left corner of the first letter, on the surface [m].
        along: Unit vector in which the text runs.
        up: Unit vector from the foot to the head of a letter.
        height: Of a letter [m].
    """
    unit, thick = height / 6.0, height / 12.0
    out = np.cross(along, up)
    points: list[Points] = []
    faces: list[list[int]] = []
    box = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6)]
    box += [(1, 3, 5), (3, 7, 5)]
    for place, letter in enumerate(text):
        for x0, y0, x1, y1 in STROKES[letter]:
            a = origin + unit * ((x0 + 5.6 * place) * along + y0 * up)
            b = origin + unit * ((x1 + 5.6 * place) * along + y1 * up)
            d = (b - a) / np.linalg.norm(b - a)
            n = np.cross(out, d)
            first = len(points)
            for face in (-0.001, 0.0008):  # sunk 1 mm, raised 0.8 mm
                for side in (-thick, thick):
                    points += [a - thick * d + side * n + face * out, b + thick * d + side * n + face * out]
            faces += [[first + i for i in triangle] for triangle in box]
    return np.array(points), np.array(faces)


def write_blocks(text: str, pieces: Iterable[Part], origins: Mapping[str, Origin], looks: Mapping[str, str]) -> str:
    """The text of a robot.xml with its marked blocks written anew.

    Args:
        text: The file as it is, with a block "assets" and one for every body.
        pieces: All pieces of the robot.
        origins: Body -> its origin in the frame that its pieces' points are given in [m].
        looks: Material -> attributes of its element.
    """
    pieces = list(pieces)
    materials = [f'<material name="{name}" {look}/>' for name, look in looks.items()]
    blocks = {"assets": materials + [piece.asset(origins[piece.body]) for piece in pieces]}
    for body in origins:
        blocks[body] = [line for piece in pieces if piece.body == body for line in piece.geoms()]
    for name, lines in blocks.items():
        begin, end = f"<!-- body: {name} -->", f"<!-- end body: {name} -->"
        head, rest = text.split(begin)
        _, tail = rest.split(end)
        indent = head[head.rindex("\n") + 1 :]
        text = head + begin + "".join(f"\n{indent}{line}" for line in lines) + f"\n{indent}{end}" + tail
    return text


def rewrite(xml: Path, build: Callable[[str], str], description: str | None) -> int:
    """Command line of a `build_body.py`: rewrite robot.xml, or check it; returns the exit code."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 if robot.xml is out of date")
    arguments = parser.parse_args()
    old = xml.read_text(encoding="utf-8")
    new = build(old)
    if arguments.check:
        print("robot.xml is up to date" if old == new else "robot.xml is out of date: run build_body.py")
        return int(old != new)
    xml.write_text(new, encoding="utf-8")
    return 0
