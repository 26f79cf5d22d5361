"""A URDF file as pinocchio reads it: continuous joints bounded, joints held, every frame with a name of its own."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin

from qpsafe.errors import RobotFileError
from qpsafe.robot.joint_choice import HINGE, SLIDE, Coupling, FoundJoint
from qpsafe.robot.models.mjcf import ENDLESS
from qpsafe.robot.models.names import unique_name
from qpsafe.robot.models.urdf_check import check_urdf
from qpsafe.text.words import counted

_KINDS = {"revolute": HINGE, "continuous": HINGE, "prismatic": SLIDE}


class UrdfFile:
    """A URDF file, checked.

    Attributes:
        notes: What is doubtful, in words.
        joints: Its joints, fixed ones not among them.
        endless: Names of those that turn without end.
    """

    def __init__(self, path: Path, root: Element) -> None:
        """Check and prepare.

        Raises:
            RobotFileError: Names the element that is wrong.
        """
        self.notes = tuple(check_urdf(path, root))
        self._path = path
        elements = {joint.get("name", ""): joint for joint in root.findall("joint")}
        self.endless = [name for name, joint in elements.items() if joint.get("type") == "continuous"]
        for element in elements.values():
            _state_limits(element)
        self.joints = _found(elements)
        for parent, tag in [(root, "material"), *((link, "visual") for link in root.findall("link"))]:
            for picture in parent.findall(tag):  # not needed, and a mistake in it would be the whole file's
                parent.remove(picture)
        links = {link.get("name", ""): link for link in root.findall("link")}
        self._meshes = [
            (name, mesh.get("filename", ""))
            for name, link in links.items()
            for mesh in link.iterfind("collision/geometry/mesh")
        ]
        self._parts = {name: _parts(link) for name, link in links.items()}
        taken = {*links, "universe"}
        self._names = {name: unique_name(name, "joint", taken) for name in elements}
        for name, element in elements.items():
            element.set("name", self._names[name])
            mimic = element.find("mimic")
            if mimic is not None:
                element.remove(mimic)
        self._text = ElementTree.tostring(root, encoding="unicode")

    def build(self, held: Mapping[str, float]) -> Any:
        """pinocchio's model without the joints that are held at these values [rad or m].

        Raises:
            RobotFileError: pinocchio cannot read the file.
        """
        full = self._full()
        ids, values = self._held(full, held)
        model = pin.buildReducedModel(full, ids, values) if ids else full
        back = {unique: name for name, unique in self._names.items()}
        for i in range(1, model.njoints):
            model.names[i] = back[model.names[i]]
        return model

    def geometry(self, held: Mapping[str, float]) -> Any:
        """pinocchio's collision geometry for the same model.

        Raises:
            RobotFileError: pinocchio cannot read a mesh, or leaves out a shape.
        """
        full = self._full()
        try:
            geometry = pin.buildGeomFromUrdfString(full, self._text, pin.GeometryType.COLLISION)
        except (ValueError, RuntimeError):
            self._check_meshes()
            raise
        read = Counter(full.frames[item.parentFrame].name for item in geometry.geometryObjects)
        for link, (shapes, _) in self._parts.items():
            if read[link] != shapes:
                expected = f"{counted(shapes, 'shape')}, as in the file; pinocchio reads {read[link]}"
                raise RobotFileError(self._path, f"link {link}: collision", read[link], expected)
        ids, values = self._held(full, held)
        return pin.buildReducedModel(full, geometry, ids, values)[1] if ids else geometry

    def _read(self) -> Any:
        try:
            return pin.buildModelFromXML(self._text)
        except (ValueError, RuntimeError, IndexError) as error:
            expected = f"a model that pinocchio can read ({error})"
            raise RobotFileError(self._path, "file", self._path.name, expected) from error

    def _full(self) -> Any:
        """pinocchio's model of the whole file, with every mass that stands in it."""
        full = self._read()
        links = [frame for frame in full.frames if frame.name in self._parts]
        for joint, inertia in enumerate(full.inertias):
            masses = {link.name: self._parts[link.name][1] for link in links if link.parentJoint == joint}
            mass = sum(masses.values())
            if not abs(inertia.mass - mass) <= 1e-9 * mass:
                named = ", ".join(name for name, own in masses.items() if own > 0.0)
                expected = f"{mass:g} kg, as in the file; pinocchio reads {inertia.mass:g} kg"
                raise RobotFileError(self._path, f"link {named}: mass", inertia.mass, expected)
        return full

    def _check_meshes(self) -> None:
        """Name the mesh that cannot be read."""
        for link, mesh in self._meshes:
            try:
                coal.MeshLoader().load(mesh, np.ones(3))
            except (ValueError, RuntimeError) as error:
                expected = f"a mesh that can be read ({' '.join(str(error).split())})"
                raise RobotFileError(self._path, f"link {link}: collision mesh", mesh, expected) from error

    def _held(self, full: Any, held: Mapping[str, float]) -> tuple[list[int], Any]:
        """pinocchio's numbers of the joints that are held, and a configuration in which they are."""
        values, ids = pin.neutral(full), []
        for name, value in held.items():
            ids.append(full.getJointId(self._names[name]))
            joint = full.joints[ids[-1]]
            if joint.nq == 1:
                values[joint.idx_q] = value
        return ids, values


def _state_limits(joint: Element) -> None:
    """Make a continuous joint a revolute one of many turns; without a <limit> the reader would refuse the whole file.

    What a <limit> leaves out or calls infinite becomes 0, "not stated". That of a joint that is held has no meaning.
    """
    limit = joint.find("limit")
    if joint.get("type") not in _KINDS and limit is not None:
        joint.remove(limit)
        return
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit")
        limit.set("lower", repr(-ENDLESS))
        limit.set("upper", repr(ENDLESS))
    if limit is not None:
        for key in ("velocity", "effort"):
            if not math.isfinite(float(limit.get(key, "inf"))):
                limit.set(key, "0")


def _found(elements: Mapping[str, Element]) -> list[FoundJoint]:
    ends = {name: (_link(joint, "parent"), _link(joint, "child")) for name, joint in elements.items()}
    by_child = {child: name for name, (_, child) in ends.items()}

    def above(name: str) -> str | None:
        joint = by_child.get(ends[name][0])
        while joint is not None and elements[joint].get("type") == "fixed":
            joint = by_child.get(ends[joint][0])
        return joint

    found = []
    for name, joint in elements.items():
        kind = joint.get("type", "")
        if kind == "fixed":
            continue
        limit, mimic = joint.find("limit"), joint.find("mimic")
        lower = upper = 0.0
        if limit is not None and kind in _KINDS:
            lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        follows = None
        if mimic is not None:
            values = float(mimic.get("offset", "0")), float(mimic.get("multiplier", "1"))
            follows = Coupling(mimic.get("joint", ""), values)
        found.append(FoundJoint(name, _KINDS.get(kind, kind), above(name), ends[name][0], lower, upper, 0.0, follows))
    return found


def _parts(link: Element) -> tuple[int, float]:
    """How many collision shapes a link has, and its mass [kg]."""
    mass = link.find("inertial/mass")
    return len(link.findall("collision")), 0.0 if mass is None else float(mass.get("value", "0"))


def _link(joint: Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")
