"""Write the URDF of an arm that nothing was tuned on: python benchmarks/made_up_arm.py FILE.urdf.

Six joints, 1.3 m from its first axis to its wrist, of cylinders and boxes, with masses and torques: the size of a
welding robot, which none of the bundled robots has. It states what a maker's URDF states and no more: no home posture,
no accelerations, no sensors.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

Vector = tuple[float, float, float]

SOLID = 900.0  # castings with motors in them, over the volume of their outline [kg/m³]


class Axis(NamedTuple):
    """A joint and the link that it moves.

    Attributes:
        xyz: Origin in the link before [m].
        axis: It turns about.
        lower, upper: Limits [rad].
        velocity, effort: Largest [rad/s], [N m].
        to: Where the link's rod ends, in its frame [m].
        radius: Of the rod [m].
    """

    xyz: Vector
    axis: Vector
    lower: float
    upper: float
    velocity: float
    effort: float
    to: Vector
    radius: float


AXES = (
    Axis((0.0, 0.0, 0.40), (0.0, 0.0, 1.0), -2.9, 2.9, 3.4, 900.0, (0.12, 0.0, 0.0), 0.11),
    Axis((0.12, 0.0, 0.0), (0.0, 1.0, 0.0), -1.6, 2.4, 3.1, 900.0, (0.0, 0.0, 0.58), 0.085),
    Axis((0.0, 0.0, 0.58), (0.0, 1.0, 0.0), -3.2, 1.4, 3.4, 450.0, (0.16, 0.0, 0.10), 0.075),
    Axis((0.16, 0.0, 0.10), (1.0, 0.0, 0.0), -3.4, 3.4, 5.9, 90.0, (0.34, 0.0, 0.0), 0.06),
    Axis((0.44, 0.0, 0.0), (0.0, 1.0, 0.0), -2.1, 2.1, 5.9, 60.0, (0.05, 0.0, 0.0), 0.045),
    Axis((0.10, 0.0, 0.0), (1.0, 0.0, 0.0), -6.0, 6.0, 8.0, 40.0, (0.02, 0.0, 0.0), 0.04),
)
FOOT = (0.36, 0.36, 0.26)  # of the foot, a box [m]
TIP = 0.14  # of the tool before the last joint [m]


def arm_urdf() -> str:
    """The text of the file."""
    root = ElementTree.Element("robot", name="made_up_arm")
    base = ElementTree.SubElement(root, "link", name="base_link")
    _shape(base, "box", {"size": _words(FOOT)}, (0.0, 0.0, FOOT[2] / 2.0))
    parent = "base_link"
    for number, axis in enumerate(AXES, 1):
        name = f"link_{number}"
        _link(root, name, axis)
        joint = _joint(root, f"joint_{number}", "revolute", (parent, name), axis.xyz)
        ElementTree.SubElement(joint, "axis", xyz=_words(axis.axis))
        said = {"lower": axis.lower, "upper": axis.upper, "velocity": axis.velocity, "effort": axis.effort}
        ElementTree.SubElement(joint, "limit", {key: f"{value:g}" for key, value in said.items()})
        parent = name
    ElementTree.SubElement(root, "link", name="tool0")
    _joint(root, "flange", "fixed", (parent, "tool0"), (TIP, 0.0, 0.0), "0 1.570796 0")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _link(root: ElementTree.Element, name: str, axis: Axis) -> None:
    """A rod with round ends, as heavy as its outline filled with `SOLID`."""
    link = ElementTree.SubElement(root, "link", name=name)
    length = sum(x * x for x in axis.to) ** 0.5
    middle = tuple(0.5 * x for x in axis.to)
    mass = SOLID * 3.141593 * axis.radius**2 * (length + axis.radius)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_words(middle))
    ElementTree.SubElement(inertial, "mass", value=f"{mass:.4g}")
    about = mass * (length**2 / 12.0 + axis.radius**2 / 4.0)
    said = dict.fromkeys(("ixx", "iyy", "izz"), f"{about:.4g}") | dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    ElementTree.SubElement(inertial, "inertia", said)
    for end in ((0.0, 0.0, 0.0), axis.to):
        _shape(link, "sphere", {"radius": f"{axis.radius:g}"}, end)
    turned = "0 0 0" if axis.to[0] == 0.0 else f"0 {_pitch(axis.to):.6f} 0"
    _shape(link, "cylinder", {"radius": f"{axis.radius:g}", "length": f"{length:.6g}"}, middle, turned)


def _pitch(to: Vector) -> float:
    """Angle about y that lays the z axis along a way in the xz plane [rad]."""
    from math import atan2

    return atan2(to[0], to[2])


def _shape(link: ElementTree.Element, kind: str, said: dict[str, str], xyz: Vector, rpy: str = "0 0 0") -> None:
    for role in ("visual", "collision"):
        part = ElementTree.SubElement(link, role)
        ElementTree.SubElement(part, "origin", xyz=_words(xyz), rpy=rpy)
        ElementTree.SubElement(ElementTree.SubElement(part, "geometry"), kind, said)


def _joint(
    root: ElementTree.Element, name: str, kind: str, links: tuple[str, str], xyz: Vector, rpy: str = "0 0 0"
) -> ElementTree.Element:
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=links[0])
    ElementTree.SubElement(joint, "child", link=links[1])
    ElementTree.SubElement(joint, "origin", xyz=_words(xyz), rpy=rpy)
    return joint


def _words(values: Vector) -> str:
    return " ".join(f"{value:g}" for value in values)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(arm_urdf(), encoding="utf-8")
