"""A user's thresholds, evasion and gate as plain data, and again from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.evasion import Evasion
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.experiments.shared.control import Control


def part_settings(experiment: Control) -> dict[str, Any]:
    """Thresholds and evasion, None for those that the experiment chooses; metrics do not change a run.

    Raises:
        ConfigurationError: There are tasks, or parts of another class: replay could not build them again.
    """
    for key, usual in (("tasks", type(None)), ("activation", Activation), ("evasion", Evasion)):
        part = getattr(experiment, key)
        if part is not None and type(part) is not usual:
            expected = f"{'none' if key == 'tasks' else usual.__name__}: replay has to build it again"
            raise ConfigurationError("settings_of", key, type(part).__name__, expected)
    activation, evasion, gate = experiment.activation, experiment.evasion, experiment.gate
    if gate not in (None, "off"):
        raise ConfigurationError("settings_of", "gate", gate, "none, or 'off': replay has to build it again")
    return {
        "gate": gate,
        "thresholds": None if activation is None else [[t.delta, t.epsilon] for t in activation.thresholds],
        "evasion": None
        if evasion is None
        else {"dt": evasion.dt} | {key: getattr(evasion, key).tolist() for key in ("mass", "damping", "friction")},
    }


def parts_of(robot: Robot, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The parts again; runs recorded before there were any have none."""
    thresholds, evasion = settings.get("thresholds"), settings.get("evasion")
    return {
        "activation": None if thresholds is None else Activation(tuple(Threshold(*pair) for pair in thresholds)),
        "evasion": None if evasion is None else Evasion(n=robot.nq, **evasion),
        "gate": settings.get("gate"),
    }
