"""qpsafe: danger-aware hierarchical QP control for industrial robot arms that share their space with people.

Names are imported when first used, so that `import qpsafe` stays quick.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

__version__ = "0.1.0"

#: Public name -> module that defines it.
_PUBLIC = {
    "Activation": "qpsafe.danger.activation",
    "BatchController": "qpsafe.batch.controller",
    "BatchTick": "qpsafe.batch.result",
    "Box": "qpsafe.limits",
    "ConfigurationError": "qpsafe.errors",
    "DangerBarrier": "qpsafe.laws.barrier",
    "DangerField": "qpsafe.danger.field",
    "Evasion": "qpsafe.danger.evasion",
    "FixedPose": "qpsafe.tasks.trajectory",
    "FrameTask": "qpsafe.tasks.frame",
    "HierarchicalLaw": "qpsafe.laws.hierarchical",
    "JointLimits": "qpsafe.limits",
    "JointReference": "qpsafe.reference",
    "JointTask": "qpsafe.tasks.joint",
    "Law": "qpsafe.laws.problem",
    "LawProblem": "qpsafe.laws.problem",
    "LawResult": "qpsafe.laws.problem",
    "Level": "qpsafe.hqp.level",
    "NullspaceLaw": "qpsafe.laws.nullspace",
    "Obstacle": "qpsafe.sensing.hulls",
    "OrientationTask": "qpsafe.tasks.orientation",
    "PositionTask": "qpsafe.tasks.position",
    "PostureTask": "qpsafe.tasks.joint",
    "Program": "qpsafe.tasks.program",
    "QpsafeError": "qpsafe.errors",
    "RangeImage": "qpsafe.ranging.sensor",
    "RangeRules": "qpsafe.ranging.rules",
    "RangeSensor": "qpsafe.ranging.sensor",
    "RecoveryRules": "qpsafe.recovery.returns",
    "RelativeFrameTask": "qpsafe.tasks.frame",
    "Robot": "qpsafe.robot.robot",
    "RobotFileError": "qpsafe.errors",
    "RobotWarning": "qpsafe.errors",
    "SafetyController": "qpsafe.controller",
    "Sample": "qpsafe.tasks.trajectory",
    "SensingRules": "qpsafe.sensing.rules",
    "Separation": "qpsafe.danger.separation",
    "SeparationLimit": "qpsafe.danger.separation_limit",
    "SpotArray": "qpsafe.sensing.skin.spots",
    "StopCategory": "qpsafe.irc5.supervisor",
    "Supervisor": "qpsafe.irc5.supervisor",
    "Task": "qpsafe.tasks.task",
    "Threshold": "qpsafe.danger.activation",
    "Tick": "qpsafe.tick",
    "WeightedLaw": "qpsafe.laws.weighted",
    "Wire": "qpsafe.robot.wire",
    "bundled_robots": "qpsafe.robot.loader",
    "load_cameras": "qpsafe.ranging.cell_cameras",
    "load_cell": "qpsafe.sensing.cell_file",
    "load_converter": "qpsafe.sensing.skin.calibration",
    "load_program": "qpsafe.tasks.program_file",
    "load_range_sensors": "qpsafe.ranging.sensor_file",
    "load_robot": "qpsafe.robot.loader",
    "load_spots": "qpsafe.sensing.skin.spots",
    "nullspace_velocity": "qpsafe.laws.nullspace",
    "robot_activation": "qpsafe.danger.thresholds",
    "solve_hierarchy": "qpsafe.hqp.solve",
}

__all__ = ["__version__", *sorted(_PUBLIC)]

if TYPE_CHECKING:
    from qpsafe.batch.controller import BatchController as BatchController
    from qpsafe.batch.result import BatchTick as BatchTick
    from qpsafe.controller import SafetyController as SafetyController
    from qpsafe.danger.activation import Activation as Activation
    from qpsafe.danger.activation import Threshold as Threshold
    from qpsafe.danger.evasion import Evasion as Evasion
    from qpsafe.danger.field import DangerField as DangerField
    from qpsafe.danger.separation import Separation as Separation
    from qpsafe.danger.separation_limit import SeparationLimit as SeparationLimit
    from qpsafe.danger.thresholds import robot_activation as robot_activation
    from qpsafe.errors import ConfigurationError as ConfigurationError
    from qpsafe.errors import QpsafeError as QpsafeError
    from qpsafe.errors import RobotFileError as RobotFileError
    from qpsafe.errors import RobotWarning as RobotWarning
    from qpsafe.hqp.level import Level as Level
    from qpsafe.hqp.solve import solve_hierarchy as solve_hierarchy
    from qpsafe.irc5.supervisor import StopCategory as StopCategory
    from qpsafe.irc5.supervisor import Supervisor as Supervisor
    from qpsafe.laws.barrier import DangerBarrier as DangerBarrier
    from qpsafe.laws.hierarchical import HierarchicalLaw as HierarchicalLaw
    from qpsafe.laws.nullspace import NullspaceLaw as NullspaceLaw
    from qpsafe.laws.nullspace import nullspace_velocity as nullspace_velocity
    from qpsafe.laws.problem import Law as Law
    from qpsafe.laws.problem import LawProblem as LawProblem
    from qpsafe.laws.problem import LawResult as LawResult
    from qpsafe.laws.weighted import WeightedLaw as WeightedLaw
    from qpsafe.limits import Box as Box
    from qpsafe.limits import JointLimits as JointLimits
    from qpsafe.ranging.cell_cameras import load_cameras as load_cameras
    from qpsafe.ranging.rules import RangeRules as RangeRules
    from qpsafe.ranging.sensor import RangeImage as RangeImage
    from qpsafe.ranging.sensor import RangeSensor as RangeSensor
    from qpsafe.ranging.sensor_file import load_range_sensors as load_range_sensors
    from qpsafe.recovery.returns import RecoveryRules as RecoveryRules
    from qpsafe.reference import JointReference as JointReference
    from qpsafe.robot.loader import bundled_robots as bundled_robots
    from qpsafe.robot.loader import load_robot as load_robot
    from qpsafe.robot.robot import Robot as Robot
    from qpsafe.robot.wire import Wire as Wire
    from qpsafe.sensing.cell_file import load_cell as load_cell
    from qpsafe.sensing.hulls import Obstacle as Obstacle
    from qpsafe.sensing.rules import SensingRules as SensingRules
    from qpsafe.sensing.skin.calibration import load_converter as load_converter
    from qpsafe.sensing.skin.spots import SpotArray as SpotArray
    from qpsafe.sensing.skin.spots import load_spots as load_spots
    from qpsafe.tasks.frame import FrameTask as FrameTask
    from qpsafe.tasks.frame import RelativeFrameTask as RelativeFrameTask
    from qpsafe.tasks.joint import JointTask as JointTask
    from qpsafe.tasks.joint import PostureTask as PostureTask
    from qpsafe.tasks.orientation import OrientationTask as OrientationTask
    from qpsafe.tasks.position import PositionTask as PositionTask
    from qpsafe.tasks.program import Program as Program
    from qpsafe.tasks.program_file import load_program as load_program
    from qpsafe.tasks.task import Task as Task
    from qpsafe.tasks.trajectory import FixedPose as FixedPose
    from qpsafe.tasks.trajectory import Sample as Sample
    from qpsafe.tick import Tick as Tick


class _OnFirstUse(ModuleType):
    """This module: a name not used yet is a property, so that completing ``qpsafe.`` by TAB imports nothing."""


def _wait_for_use(name: str, where: str) -> None:
    def use(module: ModuleType) -> object:
        vars(module)[name] = value = getattr(import_module(where), name)
        with suppress(AttributeError):  # another thread was first
            delattr(_OnFirstUse, name)
        return value

    setattr(_OnFirstUse, name, property(use))


for _name, _where in _PUBLIC.items():
    _wait_for_use(_name, _where)
sys.modules[__name__].__class__ = _OnFirstUse


def __dir__() -> list[str]:
    """Public names, imported or not."""
    return __all__
