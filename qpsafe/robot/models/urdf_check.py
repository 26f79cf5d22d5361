"""What can be wrong with a URDF file, found before a reader that would say only that it is invalid."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from qpsafe.errors import RobotFileError
from qpsafe.robot.models.collada import Head, head_of, said_of

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_TURN_OR_SLIDE = ("revolute", "continuous", "prismatic")
_VERSIONS = ("1.0", "1.1", "1.2")
_LARGEST_AXIS = 1e9  # beyond its inverse and this no length of a vector is sure
# what the reader takes for a number; Python would take 1_0 and other alphabets' digits too
_NUMBER = re.compile(r"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE)


def check_urdf(path: Path, root: Element) -> list[str]:
    """Check names, tree, numbers and mesh files of a URDF; that nothing of xacro is left in it.

    Written in the element as the reader wants it, which leaves out a whole link's shapes or mass otherwise: blanks in
    numbers, the whole paths of meshes, and the version, where a capsule or a quaternion needs it.

    Returns:
        Notes on what is doubtful.

    Raises:
        RobotFileError: Names the element that is wrong.
    """
    _check_expanded(path, root)
    if not root.get("name"):
        raise RobotFileError(path, "robot: name", root.get("name"), "a name")
    _check_version(path, root)
    links = _named(path, root, "link")
    joints = _named(path, root, "joint")
    if not links:
        raise RobotFileError(path, "link", None, "at least one <link>")
    if "universe" in links:
        raise RobotFileError(path, "link universe: name", "universe", "another name: that is the world's")
    _check_tree(path, links, joints)
    for name, joint in joints.items():
        _check_joint(path, f"joint {name}", joint, joints)
    empty: list[str] = []
    heads: dict[str, Head] = {}
    for name, link in links.items():
        if not _check_inertia(path, f"link {name}", link):
            empty.append(name)
        heads |= _check_shapes(path, f"link {name}", link)
    moved = {joint.find("child").get("link") for joint in joints.values() if joint.get("type") != "fixed"}  # type: ignore[union-attr]
    empty = [name for name in empty if name in moved]
    notes = said_of(heads)
    if empty:
        notes.append(f"no mass or inertia is given for what moves: {', '.join(empty)} (only simulations need it)")
    return notes


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


def _check_version(path: Path, root: Element) -> None:
    """Check the version, and make it the one that capsules and quaternions need."""
    version = root.get("version")
    if version is not None and version.strip() not in _VERSIONS:
        raise RobotFileError(path, "robot: version", version, "one of " + ", ".join(_VERSIONS))
    if root.find("link/collision/geometry/capsule") is not None or any(o.get("quat_xyzw") for o in root.iter("origin")):
        root.set("version", _VERSIONS[-1])


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
        largest = np.abs(_numbers(path, f"{where}: axis", axis, "xyz", 3)).max()
        if kind in _TURN_OR_SLIDE and not 1.0 / _LARGEST_AXIS < largest < _LARGEST_AXIS:
            expected = "a direction: its largest number above 1e-9 and below 1e9, best of length 1"
            raise RobotFileError(path, f"{where}: axis", axis.get("xyz"), expected)
    _check_origin(path, where, joint)
    for tag, keys in _FIGURES.items():
        for element in joint.findall(tag):
            for key, needed in keys.items():
                if needed or element.get(key) is not None:
                    _numbers(path, f"{where}: {tag} {key}", element, key, 1)
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
        low, high = (
            0.0 if limit.get(key) is None else _numbers(path, f"{where}: limit {key}", limit, key, 1)[0]
            for key in ("lower", "upper")
        )
        if not low <= high:
            raise RobotFileError(path, f"{where}: limit lower", float(low), f"at most upper = {float(high)!r}")
    if limit is not None:
        for key in ("velocity", "effort"):
            text = limit.get(key)
            if text is not None and _numbers(path, f"{where}: limit {key}", limit, key, 1, finite=False)[0] < 0.0:
                raise RobotFileError(path, f"{where}: limit {key}", text, "a number >= 0")


def _check_origin(path: Path, where: str, element: Element) -> None:
    origin = element.find("origin")
    if origin is None:
        return
    for key in ("xyz", "rpy"):
        if origin.get(key) is not None:
            _numbers(path, f"{where}: origin {key}", origin, key, 3)
    text = origin.get("quat_xyzw")
    if text is not None and (origin.get("rpy") is not None or not text.strip()):
        raise RobotFileError(path, f"{where}: origin quat_xyzw", text, "four numbers, and no rpy beside them")
    if (
        text is not None
        and not abs(np.linalg.norm(_numbers(path, f"{where}: origin quat_xyzw", origin, "quat_xyzw", 4)) - 1.0) < 1e-3
    ):
        raise RobotFileError(path, f"{where}: origin quat_xyzw", text, "a quaternion of length 1")


def _check_inertia(path: Path, where: str, link: Element) -> bool:
    """Whether the link has a mass and an inertia that a body can have."""
    inertial = link.find("inertial")
    if inertial is None:
        return False
    _check_origin(path, f"{where}: inertial", inertial)
    element = inertial.find("mass")
    mass = float(_numbers(path, f"{where}: mass", element, "value", 1)[0])
    if mass < 0.0:
        raise RobotFileError(path, f"{where}: mass", mass, "a mass >= 0 [kg]")
    element = inertial.find("inertia")
    if element is None:
        raise RobotFileError(path, f"{where}: inertia", None, "an <inertia>, since there is an <inertial>")
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (float(_numbers(path, f"{where}: inertia {k}", element, k, 1)[0]) for k in keys)
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments[0] < -1e-9 * max(1.0, moments[2]):
        found = [round(float(m), 9) for m in moments]
        raise RobotFileError(path, f"{where}: inertia", found, "principal moments >= 0 [kg m²]")
    return mass > 0.0 and bool(moments[2] > 0.0)


_SHAPES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "capsule": {"radius": 1, "length": 1}}
_SHAPES |= {"sphere": {"radius": 1}, "mesh": {}}


def _check_shapes(path: Path, where: str, link: Element) -> dict[str, Head]:
    """What its meshes state at their heads, by name."""
    heads: dict[str, Head] = {}
    for collision in link.iterfind("collision"):
        _check_origin(path, f"{where}: collision", collision)
        geometry = collision.find("geometry")
        shape = None if geometry is None or len(geometry) == 0 else geometry[0]
        if shape is None or shape.tag not in _SHAPES:
            found = None if shape is None else shape.tag
            raise RobotFileError(path, f"{where}: collision geometry", found, "one of " + ", ".join(_SHAPES))
        for key, count in _SHAPES[shape.tag].items():
            if not (_numbers(path, f"{where}: collision {shape.tag} {key}", shape, key, count) > 0.0).all():
                raise RobotFileError(path, f"{where}: collision {shape.tag} {key}", shape.get(key), "more than 0 [m]")
        if shape.tag == "mesh":
            place = _check_mesh(path, f"{where}: collision mesh", shape)
            heads[place.name] = head_of(path, f"{where}: collision mesh", place)
    return heads


def _check_mesh(path: Path, where: str, mesh: Element) -> Path:
    """The file of a mesh, by its whole path from now on: it is read later, maybe from another working directory."""
    name = mesh.get("filename")
    if not name:
        raise RobotFileError(path, where, name, "a file name")
    # os.path, unlike Path, takes no offence at what cannot be a name
    found = next((place for place in _places(path, name) if os.path.isfile(place)), None)
    if found is None:
        expected = "a file that is there; looked for it beside the file, and package:// in the folders above it"
        raise RobotFileError(path, where, name, expected)
    if mesh.get("scale") is not None and not (_numbers(path, f"{where} scale", mesh, "scale", 3) != 0.0).all():
        raise RobotFileError(path, f"{where} scale", mesh.get("scale"), "three numbers, none of them 0")
    mesh.set("filename", str(found.absolute()))
    return found


def _places(path: Path, name: str) -> Iterator[Path]:
    if name.startswith("package://"):
        for folder in package_folders(path):
            yield Path(folder) / name.removeprefix("package://")
    else:
        yield path.parent / name.removeprefix("file://")


def _numbers(
    path: Path, key: str, element: Element | None, attribute: str, count: int, finite: bool = True
) -> np.ndarray:
    """The numbers of an attribute, which has single blanks between them from now on: the reader knows no other."""
    text = None if element is None else element.get(attribute)
    words = (text or "").split()
    values = np.array([float(word) for word in words if _NUMBER.fullmatch(word)])
    read = len(words) == count == len(values) and (np.isfinite(values).all() if finite else not np.isnan(values).any())
    if element is None or not read:
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise RobotFileError(path, key, text, what)
    element.set(attribute, " ".join(words))
    return values
