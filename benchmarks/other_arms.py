"""Arms in URDF as other people write them: six and seven axes, fixed frames, with shapes and without."""

from __future__ import annotations

from pathlib import Path

# origin of each joint in the one before [m, rad], its axis, and effort: an arm like a UR5e, and one with a seventh axis
SIX = (
    ((0.0, 0.0, 0.1625), (0.0, 0.0, 0.0), (0, 0, 1), 150.0),
    ((0.0, 0.138, 0.0), (0.0, 1.5708, 0.0), (0, 1, 0), 150.0),
    ((0.0, -0.131, 0.425), (0.0, 0.0, 0.0), (0, 1, 0), 150.0),
    ((0.0, 0.0, 0.392), (0.0, 1.5708, 0.0), (0, 1, 0), 28.0),
    ((0.0, 0.127, 0.0), (0.0, 0.0, 0.0), (0, 0, 1), 28.0),
    ((0.0, 0.0, 0.1), (0.0, 0.0, 0.0), (0, 1, 0), 28.0),
)
SEVEN = (
    ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0), (0, 0, 1), 180.0),
    ((0.0, 0.0, 0.19), (0.0, 0.0, 0.0), (0, 1, 0), 180.0),
    ((0.0, 0.0, 0.21), (0.0, 0.0, 0.0), (0, 0, 1), 100.0),
    ((0.0, 0.0, 0.19), (0.0, 0.0, 0.0), (0, -1, 0), 100.0),
    ((0.0, 0.0, 0.21), (0.0, 0.0, 0.0), (0, 0, 1), 60.0),
    ((0.0, 0.0, 0.19), (0.0, 0.0, 0.0), (0, 1, 0), 40.0),
    ((0.0, 0.0, 0.08), (0.0, 0.0, 0.0), (0, 0, 1), 20.0),
)


def write_arm(
    folder: Path, axes: tuple = SIX, *, shapes: bool = True, masses: bool = True, efforts: bool = True, slides: int = -1
) -> Path:
    """A URDF file; `slides` is the number of a joint that slides instead."""
    links, joints, parent = '<link name="world"/><link name="base_link">', "", "base_link"
    links += _shape((0, 0, 0), (0, 0, 0.06), 0.07, shapes) + "</link>"
    joints += _fixed("stand", "world", "base_link", (0, 0, 0))
    for i, (xyz, rpy, axis, effort) in enumerate(axes, 1):
        # the link reaches to the next joint
        end = axes[i][0] if i < len(axes) else (0.0, 0.0, 0.05)
        inertial = (
            f'<inertial><origin xyz="{_words(0.5 * x for x in end)}"/><mass value="{4.0 / i:g}"/>'
            '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        width = 0.055 if i < 4 else 0.035
        links += f'<link name="link_{i}">{inertial * masses}{_shape((0, 0, 0), end, width, shapes)}</link>'
        kind = "prismatic" if i == slides else "revolute"
        low, high = (-0.1, 0.3) if i == slides else (-2.8, 2.8)
        power = effort if efforts else 0
        joints += (
            f'<joint name="axis_{i}" type="{kind}"><parent link="{parent}"/><child link="link_{i}"/>'
            f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/><axis xyz="{_words(axis)}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="2.5" effort="{power}"/></joint>'
        )
        parent = f"link_{i}"
    turned = axes[-1][2]
    links += '<link name="flange"/><link name="tool"/>'
    joints += _fixed("to_flange", parent, "flange", (0, 0, 0))
    joints += _fixed("to_tool", "flange", "tool", tuple(0.09 * x for x in turned))
    path = folder / f"arm{len(axes)}.urdf"
    path.write_text(f'<robot name="arm{len(axes)}">{links}{joints}</robot>')
    return path


def _shape(start: tuple, end: tuple, radius: float, wanted: bool) -> str:
    """Balls at both ends of a link and a box between, so that neighbours overlap as castings do."""
    if not wanted:
        return ""
    places = [[a + share * (b - a) for a, b in zip(start, end, strict=True)] for share in (0.0, 0.35, 0.7)]
    sphere = f'<geometry><sphere radius="{radius}"/></geometry>'
    return "".join(f'<collision><origin xyz="{_words(p)}"/>{sphere}</collision>' for p in places)


def _fixed(name: str, parent: str, child: str, xyz: tuple) -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_words(xyz)}"/></joint>'
    )


def _words(values: object) -> str:
    return " ".join(f"{float(value):g}" for value in values)  # type: ignore[attr-defined]
