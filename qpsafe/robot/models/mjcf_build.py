"""pinocchio's model of a compiled MJCF file.

MuJoCo moves a body joint after joint: a joint at p with the axis a, at q, multiplies the body's pose from the right by
Trans(p) exp(a (q - ref)) Trans(-p). pinocchio's joint is placed at Trans(p) exp(-a ref), so that its q is MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from qpsafe.errors import RobotFileError
from qpsafe.robot.joint_choice import SLIDE
from qpsafe.robot.models.mjcf import Compiled
from qpsafe.robot.models.names import unique_name

_ALIGNED = {
    (False, 0): pin.JointModelRX,
    (False, 1): pin.JointModelRY,
    (False, 2): pin.JointModelRZ,
    (True, 0): pin.JointModelPX,
    (True, 1): pin.JointModelPY,
    (True, 2): pin.JointModelPZ,
}


class Built(NamedTuple):
    """pinocchio's model, and where MuJoCo's bodies and sites are in it.

    Attributes:
        model: pinocchio's model.
        bodies: MuJoCo's body -> pinocchio's joint that moves it, and its placement on that (4, 4).
        sites: MuJoCo's site -> pinocchio's frame.
        roots: A joint on a fixed body -> the frame at the root of its tree, where that is off the world's origin.
    """

    model: Any
    bodies: dict[int, tuple[int, Any]]
    sites: dict[int, int]
    roots: dict[str, str]


def build_model(compiled: Compiled, held: Mapping[str, float]) -> Built:
    """Build the model of the joints that are not held, with a frame for every body, joint and named site."""
    mj, model = compiled.model, pin.Model()
    model.name = mj.names[: mj.names.index(b"\0")].decode() or "robot"
    model.gravity.linear = np.array(mj.opt.gravity)
    joints: dict[int, list[Any]] = {}
    for joint in compiled.joints:
        joints.setdefault(int(mj.jnt_bodyid[compiled.joint_ids[joint.name]]), []).append(joint)
    taken = {"universe"}
    site_names = {i: unique_name(mj.site(i).name, "site", taken) for i in range(mj.nsite) if mj.site(i).name}
    names = {body: unique_name(compiled.body_names[body], "body", taken) for body in compiled.bodies}
    dofs: list[int] = []
    roots: dict[str, str] = {}
    places: dict[int, tuple[int, Any]] = {0: (0, pin.SE3.Identity())}
    frames = {0: 0}
    sites: dict[int, int] = {}
    kind = pin.FrameType

    def add_sites(body: int, parent: int, place: Any, frame: int) -> None:
        for site in map(int, np.flatnonzero(mj.site_bodyid == body)):
            if site in site_names:
                there = place * _placement(mj.site_pos[site], mj.site_quat[site])
                sites[site] = _add(model, pin.Frame(site_names[site], parent, frame, there, kind.OP_FRAME))

    add_sites(0, 0, pin.SE3.Identity(), 0)
    for body in compiled.bodies:
        above = int(mj.body_parentid[body])
        parent, place = places[above]
        frame = frames[above]
        place = place * _placement(mj.body_pos[body], mj.body_quat[body])
        for joint in joints.get(body, []):
            j = compiled.joint_ids[joint.name]
            sliding, axis = joint.kind == SLIDE, mj.jnt_axis[j]
            anchor = pin.SE3(np.eye(3), mj.jnt_pos[j])
            name = unique_name(joint.name, "joint", taken)
            if joint.name in held or mj.jnt_type[j] < 2:
                moved = _motion(sliding, axis, held[joint.name] - joint.rest) if joint.name in held else None
                place = place if moved is None else place * anchor * moved * anchor.inverse()
                frame = _add(model, pin.Frame(name, parent, frame, place * anchor, kind.FIXED_JOINT))
                continue
            root = int(mj.body_rootid[body])
            if parent == 0 and root != body and np.linalg.norm(mj.body_pos[root]) > 1e-9:
                roots[joint.name] = names[root]
            back = _motion(sliding, axis, -joint.rest)
            parent = model.addJoint(
                parent,
                _joint_model(sliding, axis),
                place * anchor if back is None else place * anchor * back,
                joint.name,
                *(np.array([value]) for value in (_effort(mj, j), np.inf, joint.lower, joint.upper)),
            )
            dofs.append(int(mj.jnt_dofadr[j]))
            frame = _add(model, pin.Frame(name, parent, frame, pin.SE3.Identity(), kind.JOINT))
            place = pin.SE3(np.eye(3), -mj.jnt_pos[j])
        if body not in joints and above:
            fixed = unique_name(f"{compiled.body_names[body]}_fixed", "joint", taken)
            frame = _add(model, pin.Frame(fixed, parent, frame, place, kind.FIXED_JOINT))
        model.appendBodyToJoint(parent, _inertia(mj, body), place)
        frame = _add(model, pin.Frame(names[body], parent, frame, place, kind.BODY))
        places[body], frames[body] = (parent, place), frame
        add_sites(body, parent, place, frame)
    model.armature = np.array(mj.dof_armature[dofs])
    model.damping = np.array(mj.dof_damping[dofs])
    return Built(model, places, sites, roots)


def check_same(path: Any, compiled: Compiled, built: Built, held: Mapping[str, float]) -> None:
    """Compare ranges, bodies, sites and inertia with MuJoCo's, in three random configurations.

    Args:
        path: The model file, for the error.
        compiled: By MuJoCo.
        built: By us.
        held: Joints that are held, and where.

    Raises:
        RobotFileError: Names the first that differs.
    """
    import mujoco

    mj, model, rng = compiled.model, built.model, np.random.default_rng(0)
    data, work = mujoco.MjData(mj), model.createData()
    names = list(model.names)[1:]
    ids = [compiled.joint_ids[name] for name in names]
    addresses = mj.jnt_qposadr[ids]
    limited = mj.jnt_limited[ids].astype(bool)
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    for name, own, theirs in zip(
        np.array(names)[limited], np.stack((lower, upper), 1)[limited], mj.jnt_range[ids][limited], strict=True
    ):
        _same(path, f"joint {name}: range", own, theirs)
    for name, value in held.items():
        data.qpos[mj.jnt_qposadr[compiled.joint_ids[name]]] = value
    for _ in range(3):
        q = rng.uniform(np.maximum(lower, -np.pi), np.maximum(np.minimum(upper, np.pi), lower))
        data.qpos[addresses] = q
        mujoco.mj_kinematics(mj, data)
        pin.framesForwardKinematics(model, work, q)
        sums: dict[int, Any] = {}
        for body in compiled.bodies:
            parent, place = built.bodies[body]
            pose = work.oMi[parent] * place
            name = f"body {compiled.body_names[body]}"
            _same(path, name, pose.translation, data.xpos[body])
            _same(path, name, pose.rotation.ravel(), data.xmat[body])
            there = pin.SE3(data.ximat[body].reshape(3, 3), data.xipos[body])
            inertia = there.act(pin.Inertia(mj.body_mass[body], np.zeros(3), np.diag(mj.body_inertia[body]))).matrix()
            sums[parent] = sums.get(parent, 0.0) + inertia
        for site, frame in built.sites.items():
            _same(path, f"site {mj.site(site).name}", work.oMf[frame].translation, data.site_xpos[site])
            _same(path, f"site {mj.site(site).name}", work.oMf[frame].rotation.ravel(), data.site_xmat[site])
        for joint, theirs in sums.items():
            own = work.oMi[joint].act(model.inertias[joint]).matrix()
            _same(path, f"inertia of what {model.names[joint]} moves", own.ravel(), theirs.ravel())


def _same(path: Any, what: str, own: NDArray[np.float64], theirs: NDArray[np.float64]) -> None:
    error, size = float(np.abs(own - theirs).max()), max(1.0, float(np.abs(theirs).max()))
    if not error <= 1e-9 * size:
        raise RobotFileError(path, what, np.round(own, 6).tolist(), f"MuJoCo's {np.round(theirs, 6).tolist()}")


def _add(model: Any, frame: Any) -> int:
    return int(model.addFrame(frame, False))


def _placement(position: NDArray[np.float64], quaternion: NDArray[np.float64]) -> Any:
    import mujoco

    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return pin.SE3(rotation.reshape(3, 3), np.array(position))


def _motion(sliding: bool, axis: NDArray[np.float64], by: float) -> Any:
    """exp(axis by); None where that is the identity."""
    if by == 0.0:
        return None
    return pin.SE3(np.eye(3), by * axis) if sliding else pin.SE3(pin.exp3(by * axis), np.zeros(3))


def _joint_model(sliding: bool, axis: NDArray[np.float64]) -> Any:
    for i, unit in enumerate(np.eye(3)):
        if np.array_equal(axis, unit):
            return _ALIGNED[sliding, i]()
    return (pin.JointModelPrismaticUnaligned if sliding else pin.JointModelRevoluteUnaligned)(np.array(axis))


def _inertia(mj: Any, body: int) -> Any:
    place = _placement(mj.body_ipos[body], mj.body_iquat[body])
    moments = place.rotation @ np.diag(mj.body_inertia[body]) @ place.rotation.T
    return pin.Inertia(float(mj.body_mass[body]), place.translation, 0.5 * (moments + moments.T))


def _effort(mj: Any, j: int) -> float:
    return float(mj.jnt_actfrcrange[j, 1]) if mj.jnt_actfrclimited[j] else np.inf
