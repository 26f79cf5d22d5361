"""What can be wrong with a URDF file, found before a reader that would say only that it is invalid."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from qpsafe.errors import RobotFileError

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_TURN_OR_SLIDE = ("revolute", "continuous", "prismatic")


def check_urdf(path: Path, root: Element) -> list[str]:
    """Check names, tree, numbers and mesh files of a URDF; that nothing of xacro is left in it.

    Returns:
        Notes on what is doubtful.

    Raises:
        RobotFileError: Names the element that is wrong.
    """
    _check_expanded(path, root)
    if not root.get("name"):
        raise RobotFileError(path, "robot: name", root.get("name"), "a name")
    links = _named(path, root, "link")
    joints = _named(path, root, "joint")
    if not links:
        raise RobotFileError(path, "link", None, "at least one <link>")
    _check_tree(path, links, joints)
    for name, joint in joints.items():
        _check_joint(path, f"joint {name}", joint, joints)
    empty = []
    for name, link in links.items():
        if not _check_inertia(path, f"link {name}", link):
            empty.append(name)
        _check_shapes(path, f"link {name}", link)
    moved = {joint.find("child").get("link") for joint in joints.values() if joint.get("type") != "fixed"}  # type: ignore[union-attr]
    empty = [name for name in empty if name in moved]
    if empty:
        return [f"no mass or inertia is given for what moves: {', '.join(empty)} (only simulations need it)"]
    return []


def package_folders(path: Path) -> list[str]:
    """Folders in which package:// addresses of a URDF are looked up: those above it, and ROS's own."""
    found = [str(folder) for folder in path.resolve().parents]
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            found += [entry, str(Path(entry) / "share")]
    return found


def _check_expanded(path: Path, root: Element) -> None:
    """Refuse what xacro should have replaced: the reader would leave it out without a word."""
    run = f"plain URDF: run xacro first (xacro {path.name} > plain.urdf)"
    for element in root.iter():
        tag = element.tag if isinstance(element.tag, str) else ""
        space, _, local = tag.rpartition("}")
        if "xacro" in space:
            raise RobotFileError(path, f"<xacro:{local}>", element.get("name") or element.get("filename"), run)
        for key, text in (*element.attrib.items(), ("text", element.text or "")):
            if "${" in text or "$(" in text:
                where = f"<{tag}> {element.get('name', '')}".strip()
                raise RobotFileError(path, f"{where}: {key}", text.strip(), run)


def _named(path: Path, root: Element, tag: str) -> dict[str, Element]:
    result: dict[str, Element] = {}
    for i, element in enumerate(root.findall(tag)):
        name = element.get("name")
        if not name:
            raise RobotFileError(path, f"{tag} number {i + 1}: name", name, "a name")
        if name in result:
            raise RobotFileError(path, f"{tag} {name}: name", name, f"a name of its own: another {tag} has it too")
        result[name] = element
    return result


def _check_tree(path: Path, links: dict[str, Element], joints: dict[str, Element]) -> None:
    parents: dict[str, tuple[str, str]] = {}  # child link -> (parent link, joint)
    for name, joint in joints.items():
        ends: list[str] = []
        for role in ("parent", "child"):
            element = joint.find(role)
            end = None if element is None else element.get("link")
            if end is None or end not in links:
                raise RobotFileError(path, f"joint {name}: {role}", end, "a link of the file: " + ", ".join(links))
            ends.append(end)
        parent, child = ends
        if child in parents:
            expected = f"a link without a parent: joint {parents[child][1]} already carries it"
            raise RobotFileError(path, f"joint {name}: child", child, expected)
        parents[child] = (parent, name)
    for start in links:
        seen, link = [start], start
        while link in parents:
            link, by = parents[link]
            if link in seen:
                loop = " -> ".join(reversed([*seen[seen.index(link) :], link]))
                expected = f"a tree, but these links form a loop: {loop}"
                raise RobotFileError(path, f"joint {by}: parent", link, expected)
            seen.append(link)
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        expected = f"one tree, but nothing joins these links: {', '.join(roots)}"
        raise RobotFileError(path, f"link {roots[1]}", roots[1], expected)


# of each element of a joint: keys that are numbers, and whether they must be there
_FIGURES = {
    "dynamics": {"damping": False, "friction": False},
    "safety_controller": {
        "k_velocity": True,
        "k_position": False,
        "soft_lower_limit": False,
        "soft_upper_limit": False,
    },
    "calibration": {"rising": False, "falling": False, "reference_position": False},
    "mimic": {"multiplier": False, "offset": False},
}


def _check_joint(path: Path, where: str, joint: Element, joints: dict[str, Element]) -> None:
    kind = joint.get("type")
    if kind not in JOINT_TYPES:
        raise RobotFileError(path, f"{where}: type", kind, "one of " + ", ".join(JOINT_TYPES))
    axis = joint.find("axis")
    if axis is not None:
        values = _numbers(path, f"{where}: axis", axis.get("xyz"), 3)
        if kind in _TURN_OR_SLIDE and not np.linalg.norm(values) > 1e-9:
            raise RobotFileError(path, f"{where}: axis", axis.get("xyz"), "a direction, not three zeros")
    _check_origin(path, where, joint)
    for tag, keys in _FIGURES.items():
        for element in joint.findall(tag):
            for key, needed in keys.items():
                if needed or element.get(key) is not None:
                    _numbers(path, f"{where}: {tag} {key}", element.get(key), 1)
            if tag == "dynamics" and not set(keys) & set(element.keys()):
                raise RobotFileError(path, f"{where}: dynamics", None, "damping or friction")
            source = joints.get(element.get("joint", ""))
            if tag == "mimic" and (source is None or source is joint or source.get("type") not in _TURN_OR_SLIDE):
                expected = "another revolute, continuous or prismatic joint of the file"
                raise RobotFileError(path, f"{where}: mimic joint", element.get("joint"), expected)
    limit = joint.find("limit")
    if kind in ("revolute", "prismatic"):
        if limit is None:
            raise RobotFileError(path, f"{where}: limit", None, f"a <limit>: the joint is {kind}")
        low, high = (_numbers(path, f"{where}: limit {key}", limit.get(key, "0"), 1)[0] for key in ("lower", "upper"))
        if not low <= high:
            raise RobotFileError(path, f"{where}: limit lower", float(low), f"at most upper = {float(high)!r}")
    if limit is not None:
        for key in ("velocity", "effort"):
            text = limit.get(key)
            if text is not None and _numbers(path, f"{where}: limit {key}", text, 1, finite=False)[0] < 0.0:
                raise RobotFileError(path, f"{where}: limit {key}", text, "a number >= 0")


def _check_origin(path: Path, where: str, element: Element) -> None:
    origin = element.find("origin")
    for key in ("xyz", "rpy"):
        if origin is not None and origin.get(key) is not None:
            _numbers(path, f"{where}: origin {key}", origin.get(key), 3)


def _check_inertia(path: Path, where: str, link: Element) -> bool:
    """Whether the link has a mass and an inertia that a body can have."""
    inertial = link.find("inertial")
    if inertial is None:
        return False
    _check_origin(path, f"{where}: inertial", inertial)
    element = inertial.find("mass")
    mass = float(_numbers(path, f"{where}: mass", None if element is None else element.get("value"), 1)[0])
    if mass < 0.0:
        raise RobotFileError(path, f"{where}: mass", mass, "a mass >= 0 [kg]")
    element = inertial.find("inertia")
    if element is None:
        raise RobotFileError(path, f"{where}: inertia", None, "an <inertia>, since there is an <inertial>")
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (float(_numbers(path, f"{where}: inertia {k}", element.get(k), 1)[0]) for k in keys)
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments[0] < -1e-9 * max(1.0, moments[2]):
        found = [round(float(m), 9) for m in moments]
        raise RobotFileError(path, f"{where}: inertia", found, "principal moments >= 0 [kg m²]")
    return mass > 0.0 and bool(moments[2] > 0.0)


_SHAPES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "capsule": {"radius": 1, "length": 1}}
_SHAPES |= {"sphere": {"radius": 1}, "mesh": {}}


def _check_shapes(path: Path, where: str, link: Element) -> None:
    for collision in link.iterfind("collision"):
        _check_origin(path, f"{where}: collision", collision)
        geometry = collision.find("geometry")
        shape = None if geometry is None or len(geometry) == 0 else geometry[0]
        if shape is None or shape.tag not in _SHAPES:
            found = None if shape is None else shape.tag
            raise RobotFileError(path, f"{where}: collision geometry", found, "one of " + ", ".join(_SHAPES))
        for key, count in _SHAPES[shape.tag].items():
            if not (_numbers(path, f"{where}: collision {shape.tag} {key}", shape.get(key), count) > 0.0).all():
                raise RobotFileError(path, f"{where}: collision {shape.tag} {key}", shape.get(key), "more than 0 [m]")
        if shape.tag == "mesh":
            _check_mesh(path, f"{where}: collision mesh", shape)


def _check_mesh(path: Path, where: str, mesh: Element) -> None:
    name = mesh.get("filename")
    if not name:
        raise RobotFileError(path, where, name, "a file name")
    if not any(place.is_file() for place in _places(path, name)):
        expected = "a file that is there; looked for it beside the file, and package:// in the folders above it"
        raise RobotFileError(path, where, name, expected)
    if mesh.get("scale") is not None and not (_numbers(path, f"{where} scale", mesh.get("scale"), 3) != 0.0).all():
        raise RobotFileError(path, f"{where} scale", mesh.get("scale"), "three numbers, none of them 0")


def _places(path: Path, name: str) -> Iterator[Path]:
    if name.startswith("package://"):
        for folder in package_folders(path):
            yield Path(folder) / name.removeprefix("package://")
    else:
        yield path.parent / name.removeprefix("file://")


def _numbers(path: Path, key: str, text: str | None, count: int, finite: bool = True) -> np.ndarray:
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or (not np.isfinite(values).all() if finite else np.isnan(values).any()):
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise RobotFileError(path, key, text, what)
    return values
