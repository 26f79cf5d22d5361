"""An MJCF file as MuJoCo compiles it: which bodies are the robot's, and what its joints are.

MuJoCo resolves includes, default classes, frames, references, angles and plugins; the XML is not interpreted here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from qpsafe.errors import RobotFileError
from qpsafe.extras import require
from qpsafe.robot.joint_choice import HINGE, SLIDE, Coupling, FoundJoint, HeldJoint

#: Range of a joint that turns without end, either way: so far that it is never met, and a finite number [rad].
ENDLESS = 2000.0 * np.pi
_NUMBERS = re.compile(r"\b[+-]?(nan|inf|infinity)\b", re.IGNORECASE)
_NUMERIC = (
    *("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "axis", "range", "size", "fromto", "ref"),
    *("mass", "diaginertia", "fullinertia", "armature", "damping"),
)
_COMPILED = (
    "body_pos",
    "body_quat",
    "body_mass",
    "body_inertia",
    "jnt_pos",
    "jnt_axis",
    "qpos0",
    "site_pos",
    "geom_pos",
)
_KINDS = ("free", "ball", SLIDE, HINGE)  # in the order of mjtJoint


class Compiled(NamedTuple):
    """An MJCF file.

    Attributes:
        model: `mujoco.MjModel`.
        bodies: Numbers of the robot's bodies, the world not among them.
        body_names: Name of every body of the model; made up where the file has none.
        joints: The robot's joints.
        joint_ids: Their numbers in the model.
        notes: What is doubtful, in words.
        home: Name of a joint -> its value in the keyframe "home"; empty if there is none.
    """

    model: Any
    bodies: tuple[int, ...]
    body_names: tuple[str, ...]
    joints: tuple[FoundJoint, ...]
    joint_ids: dict[str, int]
    notes: tuple[str, ...]
    home: dict[str, float]


def compile_mjcf(path: Path, root: Element) -> Compiled:
    """Let MuJoCo compile a file, and find the robot in it.

    Raises:
        RobotFileError: Names the element that is wrong, in MuJoCo's words where it found it.
    """
    require("mjcf", "an MJCF file", "mujoco")
    import mujoco

    for element in root.iter():
        for key in _NUMERIC:
            text = element.get(key)
            if text is not None and _NUMBERS.search(text):
                where = f"<{element.tag}> {element.get('name', '')}".strip()
                raise RobotFileError(path, f"{where}: {key}", text, "finite numbers")
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise RobotFileError(path, "file", path.name, f"a model that MuJoCo can compile ({_one_line(error)})") from None
    for key in _COMPILED:  # an included file is not in `root`
        if not np.isfinite(getattr(model, key)).all():
            raise RobotFileError(path, key, "not finite", "finite numbers")
    body_names = _names([model.body(i).name for i in range(model.nbody)], [f"body_{i}" for i in range(model.nbody)])
    wanted = [f"{body_names[body]}_joint" for body in model.jnt_bodyid]
    names = _names([model.joint(j).name for j in range(model.njnt)], wanted)
    bodies, objects = _robot_bodies(model)
    notes = []
    if objects:
        notes.append(f"what moves freely or is moved by hand is left out: {', '.join(body_names[i] for i in objects)}")
    moving = [i for i in bodies if model.body_dofnum[i] > 0]
    massless = [body_names[i] for i in moving if not (model.body_mass[i] > 0 and model.body_inertia[i].min() > 0)]
    if massless:
        notes.append(f"no mass or inertia is given for what moves: {', '.join(massless)} (only simulations need it)")
    couplings, loops, others = _equalities(model, names, set(bodies))
    if others:
        notes.append("equality constraints of tendons and flexible things are not known to the controller")
    home = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, "home")
    joints, ids, stand = [], {}, {}
    for j in range(model.njnt):
        body = int(model.jnt_bodyid[j])
        if body not in bodies:
            continue
        kind, address = _KINDS[model.jnt_type[j]], model.jnt_qposadr[j]
        above = _joint_above(model, j)
        low, high = model.jnt_range[j] if model.jnt_limited[j] else (-np.inf, np.inf)
        if kind == HINGE and not model.jnt_limited[j]:
            low, high = -ENDLESS, ENDLESS
        ids[names[j]] = j
        if home >= 0 and kind in (HINGE, SLIDE):
            stand[names[j]] = float(model.key_qpos[home, address])
        joints.append(
            FoundJoint(
                name=names[j],
                kind=kind,
                parent=None if above < 0 else names[above],
                carrier=body_names[model.body_parentid[body]],
                lower=float(low),
                upper=float(high),
                rest=float(model.qpos0[address]),
                follows=couplings.get(j),
                loop=loops.get(j),
            )
        )
    return Compiled(model, bodies, body_names, tuple(joints), ids, tuple(notes), stand)


def held_positions(model: Any, held: Mapping[str, HeldJoint], prefix: str = "") -> tuple[list[int], list[float]]:
    """Where the positions of held joints are in `qpos` of a MuJoCo model, and what they are.

    Args:
        model: A model that the robot is in.
        held: `Robot.held`.
        prefix: What stands before the robot's names there.
    """
    import mujoco

    ids = {name: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, prefix + name) for name in held}
    found = [(int(model.jnt_qposadr[j]), held[name].value) for name, j in ids.items() if j >= 0]
    return [address for address, _ in found], [value for _, value in found]


def _robot_bodies(model: Any) -> tuple[tuple[int, ...], list[int]]:
    """Bodies of the robot, and the roots of what is none: mocap bodies, flexible things, and objects without an arm.

    An object is a tree on a free joint that has no other joint.
    """
    free, objects, bodies = 0, [], []
    joints_of = np.bincount(model.body_rootid[model.jnt_bodyid], minlength=model.nbody)
    flexible = set(model.flex_vertbodyid.tolist()) if model.nflex else set()
    left: set[int] = set()
    for i in range(1, model.nbody):
        parent, joint = int(model.body_parentid[i]), int(model.body_jntadr[i])
        is_object = parent == 0 and joint >= 0 and model.jnt_type[joint] == free and joints_of[i] == 1
        if is_object or model.body_mocapid[i] >= 0 or i in flexible:
            objects.append(i)
            left.add(i)
        elif parent in left:
            left.add(i)
        else:
            bodies.append(i)
    return tuple(bodies), objects


def _joint_above(model: Any, j: int) -> int:
    """The joint next to joint j on the way to the world, -1 if there is none."""
    body = int(model.jnt_bodyid[j])
    if j > model.body_jntadr[body]:
        return j - 1
    body = int(model.body_parentid[body])
    while body > 0 and model.body_jntnum[body] == 0:
        body = int(model.body_parentid[body])
    return int(model.body_jntadr[body] + model.body_jntnum[body] - 1) if body > 0 else -1


def _equalities(
    model: Any, names: tuple[str, ...], bodies: set[int]
) -> tuple[dict[int, Coupling], dict[int, int], list[int]]:
    """Joints that follow others, joints in closed loops, and the constraints of other kinds."""
    import mujoco

    kinds = mujoco.mjtEq
    couplings: dict[int, Coupling] = {}
    loops: dict[int, int] = {}
    others: list[int] = []
    for e in range(model.neq):
        first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        if not model.eq_active0[e]:
            continue
        if int(model.eq_type[e]) == kinds.mjEQ_JOINT:
            alone = second < 0  # locked: it "follows" itself by a constant
            source = first if alone else second
            if bodies.issuperset(model.jnt_bodyid[[first, source]].tolist()):
                own, at = model.qpos0[model.jnt_qposadr[[first, source]]].tolist()
                coefficients = model.eq_data[e, : 1 if alone else 5].tolist()
                couplings[first] = Coupling(names[source], tuple(coefficients), own, at)
        elif int(model.eq_type[e]) in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            ends = [first, second]
            if int(model.eq_objtype[e]) == mujoco.mjtObj.mjOBJ_SITE:
                ends = [int(model.site_bodyid[site]) for site in ends]
            if all(end == 0 or end in bodies for end in ends):
                one, other = (_joints_towards_world(model, end) for end in ends)
                touched = {loops[j] for j in one ^ other if j in loops}  # loops that share a joint are one
                members = (one ^ other) | {j for j, number in loops.items() if number in touched}
                loops.update(dict.fromkeys(members, e))
        else:
            others.append(e)
    return couplings, loops, others


def _joints_towards_world(model: Any, body: int) -> set[int]:
    found: set[int] = set()
    while body > 0:
        start = int(model.body_jntadr[body])
        found.update(range(start, start + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return found


def _names(given: list[str], otherwise: list[str]) -> tuple[str, ...]:
    """Names as the file has them; where it has none, `otherwise`, with a number where that is taken."""
    taken, result = set(given), []
    for name, base in zip(given, otherwise, strict=True):
        unique, number = name or base, 2
        while not name and unique in taken:
            unique, number = f"{base}_{number}", number + 1
        taken.add(unique)
        result.append(unique)
    return tuple(result)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
