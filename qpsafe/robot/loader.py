"""Robots by name, by folder, or by a bare MJCF or URDF file."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from qpsafe.errors import RobotFileError, RobotWarning
from qpsafe.robot.dh import dh_frames
from qpsafe.robot.models.model_file import ModelFile, read_bundled, read_model
from qpsafe.robot.models.package_model import find_package_model, is_package_model
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.defaults import spec_from_model
from qpsafe.robot.robot_file.schema import RobotFile, read_robot_file, table_key
from qpsafe.robot.robot_file.spec import DHChain, Region, RobotSpec, Tool, Tuned

_SPOTS = "spots.toml"  # sensors that are placed later: a folder may name them before
_TOLERANCE = 1e-6  # rad and m: how well robot.toml must agree with the model file


def bundled_robots() -> list[str]:
    """Names of the robots that come with qpsafe, sorted."""
    return sorted(entry.name for entry in _bundled_folder().iterdir() if (entry / "robot.toml").is_file())


def load_robot(
    name_or_path: str | Path,
    toml: str | Path | None = None,
    *,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    max_velocity: ArrayLike | None = None,
    max_acceleration: ArrayLike | None = None,
    home: ArrayLike | None = None,
    hold: Mapping[str, float] | None = None,
    parameters: str = "robot",
) -> Robot:
    """Load a robot. Where a joint slides, limits are in m instead of rad.

    Args:
        name_or_path: A bundled name (see `bundled_robots`); the path of a robot folder (with `robot.toml`); an MJCF
            or URDF file, from which limits, frames and a wire along the joint tree are taken; or a model of another
            package, ``"robot_descriptions:panda_description"`` or ``"example_robot_data:ur5"``.
        toml: A `robot.toml` that describes this model file, wherever it is; not for what has one of its own.
        lower: Lower position limits for a bare model file, one number or (n,) [rad].
        upper: Upper position limits for a bare model file, one number or (n,) [rad].
        max_velocity: Speed limits for a bare model file, one number or (n,) [rad/s]; 1 where neither is stated (MJCF).
        max_acceleration: Acceleration limits for a bare model file, one number or (n,) [rad/s^2]; what reaches full
            speed in 0.25 s if not given.
        home: Home pose for a bare model file, (n,) [rad]; if not given, the keyframe "home" of an MJCF, else zero,
            moved inside the limits.
        hold: Joints of a bare model file that are held in place, and where, e.g. ``{"finger": 0.02}`` [rad or m].
        parameters: Of its controllers: "robot" for what its file states, "paper" for the paper's, see
            `Robot.with_parameters`.

    Returns:
        The robot; what is missing or doubtful in its files stands in `robot.notes` and is warned of (`RobotWarning`).

    Raises:
        RobotFileError: There is no such robot, or one of its files is wrong; names file, key and value.
    """
    overrides = {
        "lower": lower,
        "upper": upper,
        "max_velocity": max_velocity,
        "max_acceleration": max_acceleration,
        "home": home,
    }
    given = {key: value for key, value in overrides.items() if value is not None}
    path = find_robot(name_or_path)
    if path.suffix == ".toml" and toml is not None:
        expected = f"nothing: {path} describes this robot; give its model file to describe that anew"
        raise RobotFileError("load_robot", "toml", str(toml), expected)
    described = path if path.suffix == ".toml" else None if toml is None else Path(toml).absolute()
    if described is not None:
        for key, value in (given | ({} if hold is None else {"hold": hold})).items():
            raise RobotFileError("load_robot", key, value, f"nothing: {described} states the limits; edit it instead")
        robot = _load_described(described, None if described is path else path)
    else:
        file = read_model(path, hold)
        robot = Robot(spec_from_model(path, file, given), file.model)
    if robot.notes:
        warnings.warn(f"{robot.model_path.name}: " + "; ".join(robot.notes), RobotWarning, stacklevel=2)
    return robot.with_parameters(parameters)


def load_quietly(name_or_path: str | Path, toml: str | Path | None = None, **given: Any) -> Robot:
    """`load_robot` for whoever shows `robot.notes`, or for whom somebody has: nothing is warned of.

    Args:
        name_or_path: As for `load_robot`.
        toml: As for `load_robot`.
        given: As for `load_robot`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return load_robot(name_or_path, toml, **given)


def _bundled_folder() -> Path:
    return Path(str(files("qpsafe.robots")))


def find_robot(name_or_path: str | Path) -> Path:
    """The robot.toml or model file that is meant, by its whole path: some of its files are read later.

    Raises:
        RobotFileError: There is none.
    """
    bundled = bundled_robots()
    if is_package_model(str(name_or_path)):
        return find_package_model(str(name_or_path)).absolute()
    if str(name_or_path) in bundled:
        return _bundled_folder() / str(name_or_path) / "robot.toml"
    path = Path(name_or_path)
    if os.path.isdir(path):  # unlike Path.is_dir, False for what cannot be a name
        return path.absolute() / "robot.toml"
    if os.path.isfile(path):
        return path.absolute()
    expected = (
        f"a bundled robot ({', '.join(bundled)}), the path of a robot folder, an MJCF or a URDF file, or PACKAGE:MODEL"
    )
    raise RobotFileError("load_robot", "name_or_path", str(name_or_path), expected)


def _load_described(path: Path, model_path: Path | None) -> Robot:
    """The robot that the robot.toml at `path` describes, with its own model file or the given one."""
    file = read_robot_file(path)
    if model_path is None:
        model_path = path.parent / file.model
        if not os.path.isfile(model_path):
            raise RobotFileError(path, "model", file.model, "a file in the same folder")
    if _bundled_folder() in path.parents:
        model_file = read_bundled(model_path)
    else:
        model_file = read_model(model_path, file.hold, (file.units.radians, file.units.metres), file.joints.keys())
    robot = Robot(_to_spec(path, file, model_path, model_file), model_file.model)
    _check_kinematics(path, robot)
    return robot


def _to_spec(path: Path, file: RobotFile, model_path: Path, model_file: ModelFile) -> RobotSpec:
    """The file in SI units and in the order of the model's joints; checks joints and frames against the model."""
    model = model_file.model
    names = list(model.names)[1:]  # 0 is pinocchio's universe
    for name in names:
        if name not in file.joints:
            expected = f"limits of this joint of {file.model}: it is missing, in [hold] too"
            raise RobotFileError(path, f"joints.{name}", None, expected)
    for name in file.joints:
        if name not in names:
            expected = f"a revolute or prismatic joint of {file.model} that is not held: {', '.join(names)}"
            raise RobotFileError(path, f"joints.{name}", name, expected)
    for name, target in file.frames.items():
        if not model.existFrame(target):
            expected = f"a site or body of {file.model} that moves, or a fixed body"
            raise RobotFileError(path, f"frames.{name}", target, expected)

    rad, m = file.units.radians, file.units.metres
    joints = [file.joints[name] for name in names]
    slides = np.array([joint.shortname().startswith("JointModelP") for joint in list(model.joints)[1:]])
    si = np.where(slides, m, rad)  # SI in one unit of each joint's figures
    home = dict(zip(file.joints, file.home, strict=True))
    for i, (name, joint) in enumerate(zip(names, joints, strict=True)):
        low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
        for key, value in (("lower", joint.lower), ("upper", joint.upper)):
            if not low - _TOLERANCE <= value * si[i] <= high + _TOLERANCE:
                unit = file.units.length if slides[i] else file.units.angle
                expected = f"within the joint's range in {file.model}, {low / si[i]:g} to {high / si[i]:g} {unit}"
                raise RobotFileError(path, f"joints.{name}.{key}", value, expected)
    chains = []
    for table in file.denavit_hartenberg:
        rows = np.array([[rad * r.theta, m * r.d, m * r.a, rad * r.alpha] for r in table.rows])
        order = names if table.joints is None else table.joints
        chains.append(DHChain(rows, tuple(table.frames), tuple(names.index(name) for name in order)))
    danger = file.danger
    spots, notes = None if file.spots is None else path.parent / file.spots, model_file.notes
    if spots is not None and not os.path.isfile(spots):
        if file.spots != _SPOTS:
            expected = f"a file in the same folder; only {_SPOTS} may be missing as yet"
            raise RobotFileError(path, "spots", file.spots, expected)
        spots = None
        notes = (*notes, f"{_SPOTS}, which {path.name} names, is not there: no sensors on the robot's skin")
    regions = tuple(
        Region(
            r.name,
            r.link - 1,
            r.frame or file.denavit_hartenberg[0].frames[r.link],
            m * np.array(r.lower),
            m * np.array(r.upper),
            None if r.mesh is None else path.parent / r.mesh,
            m,
            r.at_most,
            r.self_sight,
        )
        for r in file.regions
    )
    return RobotSpec(
        name=file.name,
        title=file.title,
        manufacturer=file.manufacturer,
        folder=path.parent,
        model_path=model_path,
        notes=notes,
        spots_path=spots,
        joint_names=tuple(names),
        lower=si * np.array([joint.lower for joint in joints]),
        upper=si * np.array([joint.upper for joint in joints]),
        max_velocity=si * np.array([joint.max_velocity for joint in joints]),
        max_acceleration=si * np.array([joint.max_acceleration for joint in joints]),
        home=si * np.array([home[name] for name in names]),
        frames=dict(file.frames),
        wire_frames=tuple((start, end) for start, end in file.wire.links),
        tools=tuple(Tool(t.frame, t.mounted_on, m * np.array(t.offset), t.mass) for t in file.tool),
        chains=tuple(chains),
        danger=None if danger is None else ((danger.delta, danger.epsilon), (danger.delta_f, danger.epsilon_f)),
        tuned=_tuned(file, names),
        regions=regions,
        held=model_file.held,
        hulls=model_file.hulls,
        external_joints=None if file.egm is None else tuple(file.egm.external),
    )


def _tuned(file: RobotFile, names: Sequence[str]) -> Tuned:
    """The parameters of a controller that a file states, in SI and in the order of the model's joints."""
    order, evasion = [list(file.joints).index(name) for name in names], None
    if file.evasion is not None:
        mass, damping = (tuple([values[k] for k in order]) for values in (file.evasion.mass, file.evasion.damping))
        friction = file.evasion.friction
        evasion = mass, damping, None if friction is None else tuple([friction[k] for k in order])
    rad, m = file.units.radians, file.units.metres
    units = {"speed": m, "angular_speed": rad, "joint_speed": rad, "approach": m, "escape": m}
    tables = (file.recovery, file.sensing, file.gate)
    stated = ({} if table is None else table.model_dump(exclude_none=True) for table in tables)
    return Tuned(
        evasion, *(tuple((key, units.get(key, 1.0) * value) for key, value in said.items()) for said in stated)
    )


def _check_kinematics(path: Path, robot: Robot) -> None:
    """The table and the tool of robot.toml must say what the model says, else one of them is wrong."""
    rng = np.random.default_rng(0)
    for q in (robot.home, *rng.uniform(robot.lower, robot.upper, (3, robot.nq))):
        state = robot.at(q)
        for k, chain in enumerate(robot.chains):
            base, order = state.pose(chain.frames[0]), list(chain.joints)
            for i, (frame, pose) in enumerate(
                zip(chain.frames, dh_frames(chain.table, q[order], robot.sliding[order]), strict=True)
            ):
                error = np.abs(state.pose(frame) - base @ pose).max()
                if not error < _TOLERANCE:
                    row = max(i - 1, 0)
                    key = f"{table_key('denavit_hartenberg', k, len(robot.chains))}.rows[{row}]"
                    expected = f"the pose of frame {frame} in {robot.model_path.name}; they differ by {error:.3g}"
                    raise RobotFileError(path, key, chain.table[row].tolist(), expected)
        for k, tool in enumerate(robot.tools):
            mount = state.pose(tool.mounted_on)
            offset = mount[:3, :3].T @ (state.position(tool.frame) - mount[:3, 3])
            if not np.abs(offset - tool.offset).max() < _TOLERANCE:
                expected = f"{np.round(offset, 6).tolist()} m, where {robot.model_path.name} has frame {tool.frame}"
                key = f"{table_key('tool', k, len(robot.tools))}.offset"
                raise RobotFileError(path, key, tool.offset.tolist(), expected)
