"""Models that other packages ship: `robot_descriptions` and `example-robot-data`, optional extra `models`."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
from collections.abc import Iterable
from pathlib import Path, PurePath

from qpsafe.errors import MissingExtraError, RobotFileError
from qpsafe.extras import require

PACKAGES = ("robot_descriptions", "example_robot_data")


def is_package_model(name: str) -> bool:
    """Whether a name has the form PACKAGE:MODEL of a package that is known here."""
    return name.partition(":")[0] in PACKAGES and ":" in name


def find_package_model(name: str) -> Path:
    """The model file of ``"robot_descriptions:MODULE"`` or ``"example_robot_data:MODEL"``.

    `robot_descriptions` fetches a model when it is asked for the first time; that needs git and a network.

    Raises:
        MissingExtraError: The package is not installed.
        RobotFileError: It has no such model, or cannot fetch it.
    """
    package, _, model = name.partition(":")
    if package == "robot_descriptions":
        return _from_robot_descriptions(name, model)
    return _from_example_robot_data(name, model)


def _from_robot_descriptions(name: str, model: str) -> Path:
    require("models", name, "robot_descriptions")
    module = f"robot_descriptions.{model}"
    if not model.isidentifier() or importlib.util.find_spec(module) is None:
        expected = "robot_descriptions:MODULE, e.g. panda_description, ur5_description, iiwa14_description"
        raise RobotFileError("load_robot", "name_or_path", name, expected)
    try:
        found = importlib.import_module(module)
    except Exception as error:  # git, network, disk: whatever stops it from fetching
        reason = f"{type(error).__name__}: {error}"
        expected = f"a model that robot_descriptions can fetch ({reason})"
        raise RobotFileError("load_robot", "name_or_path", name, expected) from error
    for attribute in ("URDF_PATH", "MJCF_PATH"):
        path = getattr(found, attribute, None)
        if path is not None:
            return _existing(name, Path(path))
    raise RobotFileError("load_robot", "name_or_path", name, "a module with a URDF_PATH or an MJCF_PATH")


def _from_example_robot_data(name: str, model: str) -> Path:
    """By the name of the URDF file, with or without a trailing "_robot"."""
    try:
        files = importlib.metadata.files("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        raise MissingExtraError(f"{name} needs example-robot-data: pip install 'qpsafe[models]'") from None
    urdfs: Iterable[importlib.metadata.PackagePath] = [file for file in files or () if file.suffix == ".urdf"]
    stems = {PurePath(file).stem: file for file in urdfs}
    for stem in (model, f"{model}_robot"):
        if stem in stems:
            return _existing(name, Path(str(stems[stem].locate())))
    close = [stem for stem in sorted(stems) if model and (model in stem or stem in model)]
    expected = "a URDF file of example-robot-data: " + ", ".join(close or sorted(stems))
    raise RobotFileError("load_robot", "name_or_path", name, expected)


def _existing(name: str, path: Path) -> Path:
    if not path.is_file():
        raise RobotFileError("load_robot", "name_or_path", name, f"a model whose file {path} is there")
    return path
