"""What can be wrong with an MJCF file: MuJoCo's own complaints, and where pinocchio's reader sees another robot."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from qpsafe.errors import RobotFileError

_NUMBERS = re.compile(r"\b[+-]?(nan|inf|infinity)\b", re.IGNORECASE)
_NUMERIC = (
    *("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "axis", "range", "size", "fromto", "ref"),
    *("mass", "diaginertia", "fullinertia", "armature", "damping"),
)

READER = "it ignores <frame> and what is in it, and knows one joint a body"


def check_mjcf(path: Path, root: Element) -> list[str]:
    """Check numbers, let MuJoCo compile the file, and find what pinocchio will leave out.

    Returns:
        Notes on what is doubtful.

    Raises:
        RobotFileError: Names the element that is wrong, in MuJoCo's words where it found it.
    """
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
    notes = []
    roots = [model.body(i) for i in range(1, model.nbody) if model.body_parentid[i] == 0]
    if len(roots) > 1:
        left_out = ", ".join(body.name or "(no name)" for body in roots[1:])
        notes.append(f"only the first tree of bodies is read, {roots[0].name or '(no name)'}; left out: {left_out}")
    moving = [i for i in range(1, model.nbody) if model.body_dofnum[i] > 0]
    massless = [model.body(i).name for i in moving if not (model.body_mass[i] > 0 and model.body_inertia[i].min() > 0)]
    if massless:
        notes.append(f"no mass or inertia is given for what moves: {', '.join(massless)} (only simulations need it)")
    if model.neq:
        notes.append("equality constraints are not known to the controller: joints that they couple move on their own")
    return notes


def check_same_kinematics(path: Path, model: Any) -> None:
    """Compare pinocchio's bodies with MuJoCo's at a few configurations: its reader knows less of MJCF.

    Args:
        path: The file.
        model: pinocchio's model of it, all joints included.

    Raises:
        RobotFileError: Names the first joint whose body is elsewhere, e.g. because of a <frame>.
    """
    import mujoco
    import pinocchio as pin

    theirs = mujoco.MjModel.from_xml_path(str(path))
    data, work = mujoco.MjData(theirs), model.createData()
    rng = np.random.default_rng(0)
    hinges = {theirs.joint(j).name: j for j in range(theirs.njnt) if theirs.jnt_type[j] in (2, 3)}
    known = set(model.names)
    for j in range(theirs.njnt):  # of the first tree, which is the one that is read
        name = theirs.joint(j).name
        if name and name not in known and theirs.body_rootid[theirs.jnt_bodyid[j]] == 1:
            expected = f"a joint that pinocchio's reader sees too; {READER}"
            raise RobotFileError(path, f"joint {name}", name, expected)
    names = [name for name in list(model.names)[1:] if name in hinges]
    for _ in range(3):
        q = pin.neutral(model)
        data.qpos[:] = theirs.qpos0
        for name in names:
            joint = model.joints[model.getJointId(name)]
            if joint.nq == 1:
                value = rng.uniform(-1.0, 1.0)
                q[joint.idx_q] = value
                data.qpos[theirs.jnt_qposadr[hinges[name]]] = value
        mujoco.mj_kinematics(theirs, data)
        pin.forwardKinematics(model, work, q)
        for name in names:
            joint = model.joints[model.getJointId(name)]
            axis, anchor = data.xaxis[hinges[name]], data.xanchor[hinges[name]]
            place = work.oMi[model.getJointId(name)]
            offset = anchor - place.translation
            own = place.rotation @ _axis(joint)
            beside = offset - own * float(own @ offset)  # a point of the axis is as good as another
            if np.abs(axis - own).max() > 1e-6 or np.linalg.norm(beside) > 1e-6:
                expected = f"where MuJoCo has it: pinocchio's reader finds it elsewhere; {READER}"
                raise RobotFileError(path, f"joint {name}", np.round(place.translation, 6).tolist(), expected)


def _axis(joint: Any) -> np.ndarray:
    """Axis of a revolute or prismatic joint in its own frame."""
    kind = joint.shortname()
    if "Unaligned" in kind:
        data = joint.createData()
        joint.calc(data, np.zeros(1), np.zeros(1))
        motion = np.ravel(data.S)  # linear before angular
        return motion[3:] if kind.startswith("JointModelR") else motion[:3]
    return np.eye(3)["XYZ".index(kind[-1])]


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
