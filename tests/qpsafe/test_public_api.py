"""The public contract: every name with the shapes it promises, and an import that stays light."""

import importlib
import inspect
import json
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import qpsafe

N, LINKS = 6, 6
PROMISED = [
    "Box",
    "DangerField",
    "HierarchicalLaw",
    "Law",
    "LawProblem",
    "LawResult",
    "Level",
    "NullspaceLaw",
    "Robot",
    "SafetyController",
    "Sample",
    "Task",
    "WeightedLaw",
    "load_robot",
    "nullspace_velocity",
    "solve_hierarchy",
]


def fresh(code: str) -> Any:
    """What `code` prints as JSON in an interpreter of its own."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_import_is_light() -> None:
    loaded = fresh("import json, sys, qpsafe; print(json.dumps([*sys.modules]))")
    heavy = {"numpy", "scipy", "numba", "pinocchio", "mujoco", "matplotlib", "qpsolvers", "pydantic", "typer", "rich"}
    assert heavy.isdisjoint(loaded)
    assert not [name for name in loaded if name.startswith("qpsafe.")]


def test_an_error_can_be_caught_without_the_rest() -> None:
    code = "import json, sys; from qpsafe import ConfigurationError; print(json.dumps([*sys.modules]))"
    assert {"numpy", "mujoco"}.isdisjoint(fresh(code))


@pytest.mark.long
def test_the_controller_imports_no_simulation() -> None:
    """Arrows point one way: neither MuJoCo nor a plot is needed to control a robot."""
    code = (
        "import json, sys, numpy as np, qpsafe\n"
        "robot = qpsafe.load_robot('irb140')\n"
        "goal = qpsafe.FixedPose(robot.pose('tcp', robot.home))\n"
        "controller = qpsafe.SafetyController(robot, [qpsafe.PositionTask('tcp', goal)])\n"
        "status = controller.step(robot.home, np.zeros(6), np.full(20, np.inf)).status\n"
        "print(json.dumps([status, *sys.modules]))"
    )
    status, *loaded = fresh(code)
    assert status == "ok"
    assert {"mujoco", "matplotlib", "typer", "qpsafe.sim", "qpsafe.cli"}.isdisjoint(loaded)


def test_every_public_name_is_there() -> None:
    assert len(set(qpsafe.__all__)) == len(qpsafe.__all__)
    assert set(qpsafe.__all__) <= set(dir(qpsafe))
    assert set(PROMISED) <= set(qpsafe.__all__)
    for name in qpsafe.__all__:
        value = getattr(qpsafe, name)
        if name != "__version__":
            assert inspect.getdoc(value), name
            assert value.__module__.startswith("qpsafe."), name
            assert getattr(importlib.import_module(value.__module__), name) is value


def test_completion_offers_public_names_only_and_imports_nothing() -> None:
    code = (
        "import json, sys, rlcompleter, qpsafe\n"
        "complete = rlcompleter.Completer({'qpsafe': qpsafe}).complete\n"
        "found = []\n"
        "while (text := complete('qpsafe.', len(found))) is not None: found.append(text)\n"
        "loaded = [name for name in sys.modules if name.startswith('qpsafe.')]\n"
        "same = qpsafe.Wire is qpsafe.Wire is __import__('qpsafe.robot.wire').robot.wire.Wire\n"
        "qpsafe.Wire = None\n"
        "print(json.dumps([found, dir(qpsafe), loaded, same, qpsafe.Wire]))"
    )
    found, listed, loaded, same, exchanged = fresh(code)
    assert sorted(text.rstrip("(") for text in found) == [
        f"qpsafe.{name}" for name in sorted(qpsafe.__all__) if name != "__version__"
    ]
    assert listed == sorted(qpsafe.__all__)
    assert loaded == []
    assert same
    assert exchanged is None  # as a test of somebody's own program may want it


def test_static_checkers_are_told_every_public_name() -> None:
    source = inspect.getsource(qpsafe)
    for name, module in qpsafe._PUBLIC.items():
        assert f"from {module} import {name} as {name}\n" in source, name


def test_star_import_brings_all() -> None:
    space: dict[str, Any] = {}
    exec("from qpsafe import *", space)
    assert set(qpsafe.__all__) <= set(space)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Controller'"):
        _ = qpsafe.Controller


def test_version_is_the_packages() -> None:
    from importlib.metadata import version

    assert qpsafe.__version__ == version("qpsafe")


def test_robot(irb140: Any) -> None:
    assert irb140.nq == N
    assert len(irb140.joint_names) == N
    for name in ("lower", "upper", "max_velocity", "max_acceleration"):
        value = getattr(irb140, name)
        assert (value.shape, value.dtype) == ((N,), np.float64)
    for frame in [f"dh{i}" for i in range(7)] + ["flange", "tool0"]:
        assert irb140.pose(frame, irb140.home).shape == (4, 4)
        assert irb140.jacobian(frame, irb140.home).shape == (6, N)
    wire = irb140.wire(irb140.home, np.ones(N))
    for name in ("starts", "ends", "start_velocities", "end_velocities"):
        value = getattr(wire, name)
        assert (value.shape, value.dtype) == ((LINKS, 3), np.float64)
    assert "irb140" in qpsafe.bundled_robots()


@pytest.mark.parametrize("count", [0, 1, 7])
def test_danger_field(irb140: Any, count: int) -> None:
    field = qpsafe.DangerField(static=1.0, kinetic=1.0, gamma=1.0, floor=1e-3)
    assert field == qpsafe.DangerField()
    points, wire = np.ones((count, 3)), irb140.wire(irb140.home, np.ones(N))
    value, gradient = field.evaluate(points, wire)
    assert (value.shape, gradient.shape) == ((count,), (count, 3))
    assert field.vectors(points, wire).shape == (count, 3)


def test_nullspace_velocity() -> None:
    rng = np.random.default_rng(0)
    J_H, J_L, xd = rng.normal(size=(3, N)), rng.normal(size=(3, N)), rng.normal(size=3)
    assert qpsafe.nullspace_velocity(J_H, J_L, xd, xd, np.ones(N), 0.5, 0.5).shape == (N,)
    assert qpsafe.nullspace_velocity(J_H, np.zeros((0, N)), xd, np.zeros(0), np.ones(N), 0.5, 1.0).shape == (N,)


def test_solve_hierarchy() -> None:
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(3, N)), rng.normal(size=3)
    for levels in ([(A, b)], [(A, b), (np.eye(N), np.zeros(N))], [qpsafe.Level(A, b - 1.0, b + 1.0, 2.0)]):
        for bound in (None, np.ones(N)):
            solution = qpsafe.solve_hierarchy(levels, lower=None if bound is None else -bound, upper=bound)
            assert solution.qd.shape == (N,)
            assert solution.status == "solved"
            assert len(solution.residuals) == len(levels)
            assert isinstance(solution.binding, tuple)
            assert solution.solve_time > 0.0


def test_controller(irb140: Any) -> None:
    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    for law in (None, qpsafe.NullspaceLaw(), qpsafe.HierarchicalLaw(), qpsafe.WeightedLaw()):
        controller = qpsafe.SafetyController(irb140, tasks=tasks, law=law, dt=0.004)
        q, qd = irb140.home, np.zeros(N)
        for tick in (
            controller.step(q, qd, np.full(20, 0.5)),
            controller.step(q, qd, points=[[0.9, 0.0, 0.5]]),
            controller.step(q, qd, [[0.9, 0.0, 0.5]]),
            controller.step(None, None, None),  # type: ignore[arg-type]
        ):
            assert tick.reference.q.shape == tick.reference.qd.shape == (N,)
            assert (type(tick.reference.seq), type(tick.reference.time)) == (int, float)
            assert all(isinstance(value, float) for value in (tick.cdf_n, tick.m, tick.f, tick.solve_time))
            assert all(isinstance(value, str) for value in (tick.regime, tick.phase, tick.status))
            assert isinstance(tick, qpsafe.Tick)
            assert isinstance(tick.reference, qpsafe.JointReference)


def test_errors_are_one_family() -> None:
    assert issubclass(qpsafe.RobotFileError, qpsafe.ConfigurationError)
    assert issubclass(qpsafe.ConfigurationError, qpsafe.QpsafeError)
    assert issubclass(qpsafe.ConfigurationError, ValueError)
    error = qpsafe.ConfigurationError("a.toml", "key", 3, "a number < 2")
    assert str(error) == "a.toml: key = 3: expected a number < 2"


#: Modules that have errors of their own.
ERRORS = (
    "tasks.program_file", "tasks.reach", "irc5.records.log", "irc5.messages", "sim.stories.file",
    "sim.stories.planning", "sim.campaign.runner", "sim.campaign.trials.rows", "sim.campaign.executors",
    "sim.world.plant", "sim.recording.run_file", "sim.irc5.udp", "sim.drawing.film",
)  # fmt: skip


def kinds_of(error: type[qpsafe.QpsafeError]) -> list[type[qpsafe.QpsafeError]]:
    return [error, *(kind for child in error.__subclasses__() for kind in kinds_of(child))]


def test_errors_come_out_of_another_process_as_they_went_in() -> None:
    """Of every kind; one that cannot be unpickled would break the pool, which looks as if a process had died."""
    for name in ERRORS:
        importlib.import_module(f"qpsafe.{name}")
    for kind in kinds_of(qpsafe.QpsafeError):
        code = getattr(kind.__init__, "__code__", None)  # none of those that take but a text
        error = kind(*(["said"] if code is None else [0, ["a", 3], "c", "d"][: code.co_argcount - 1]))
        there = pickle.loads(pickle.dumps(error))
        assert (type(there), str(there), vars(there)) == (kind, str(error), vars(error))
