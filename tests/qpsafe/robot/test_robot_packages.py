"""Models that other packages ship, found by name; the packages themselves are large or fetch from the network."""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qpsafe.errors import MissingExtraError, RobotFileError
from qpsafe.robot.loader import load_robot

pytestmark = pytest.mark.filterwarnings("ignore::qpsafe.errors.RobotWarning")

URDF = """<robot name="{name}"><link name="base"/><link name="arm"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="1"/></joint></robot>"""


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed example-robot-data with two models, as its wheel lays them out."""
    robots = Path("cmeel.prefix/share/example-robot-data/robots")
    records = []
    for stem in ("panda_description/urdf/panda", "ur_description/urdf/ur5_robot"):
        path = tmp_path / robots / f"{stem}.urdf"
        path.parent.mkdir(parents=True)
        path.write_text(URDF.format(name=path.stem), encoding="utf-8")
        records.append(f"{robots}/{stem}.urdf,,")
    info = tmp_path / "example_robot_data-6.0.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.4\nName: example-robot-data\nVersion: 6.0.0\n")
    (info / "RECORD").write_text("\n".join(records) + "\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    return tmp_path


def test_example_robot_data_by_the_name_of_its_file(shipped: Path) -> None:
    assert load_robot("example_robot_data:panda").name == "panda"
    assert load_robot("example_robot_data:ur5").name == "ur5_robot"
    assert load_robot("example_robot_data:ur5_robot").model_path.is_relative_to(shipped)


def test_example_robot_data_lists_what_it_has(shipped: Path) -> None:
    with pytest.raises(RobotFileError, match=r"panda, ur5_robot"):
        load_robot("example_robot_data:iiwa")
    (shipped / "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf").unlink()
    with pytest.raises(RobotFileError, match=r"is there|expected a URDF file of"):
        load_robot("example_robot_data:panda")


def module(monkeypatch: pytest.MonkeyPatch, name: str, **attributes: Any) -> None:
    """A fake module of robot_descriptions, as if it had been fetched."""
    for full in ("robot_descriptions", f"robot_descriptions.{name}"):
        fake = types.ModuleType(full)
        fake.__spec__ = importlib.machinery.ModuleSpec(full, None)
        fake.__path__ = []  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, full, fake)
    for key, value in attributes.items():
        setattr(sys.modules[f"robot_descriptions.{name}"], key, value)


def test_robot_descriptions_by_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "iiwa14.urdf"
    path.write_text(URDF.format(name="iiwa14"), encoding="utf-8")
    module(monkeypatch, "iiwa14_description", URDF_PATH=str(path))
    assert load_robot("robot_descriptions:iiwa14_description").name == "iiwa14"
    mjcf = load_robot("iiwa14").model_path
    module(monkeypatch, "iiwa14_mj_description", MJCF_PATH=str(mjcf))
    np.testing.assert_array_equal(load_robot("robot_descriptions:iiwa14_mj_description").lower[0], np.deg2rad(-170))


def test_robot_descriptions_with_nothing_to_load(monkeypatch: pytest.MonkeyPatch) -> None:
    module(monkeypatch, "odd_description")
    with pytest.raises(RobotFileError, match="URDF_PATH"):
        load_robot("robot_descriptions:odd_description")
    for name in ("none_description", "", "../odd", "os.path"):
        with pytest.raises(RobotFileError, match="MODULE"):
            load_robot(f"robot_descriptions:{name}")


def test_a_package_that_is_not_installed_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> Any:
        raise importlib.metadata.PackageNotFoundError

    monkeypatch.setattr(importlib.metadata, "files", missing)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for name in ("example_robot_data:panda", "robot_descriptions:panda_description"):
        with pytest.raises(MissingExtraError, match=r"qpsafe\[models\]"):
            load_robot(name)


def test_what_cannot_be_fetched_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    module(monkeypatch, "far_description", URDF_PATH="x")

    def fail(name: str) -> Any:
        raise OSError("no network")

    fake = types.SimpleNamespace(import_module=fail, util=importlib.util)
    monkeypatch.setattr("qpsafe.robot.models.package_model.importlib", fake)
    with pytest.raises(RobotFileError, match="no network"):
        load_robot("robot_descriptions:far_description")


@pytest.mark.slow
@pytest.mark.parametrize(("model", "joints"), [("panda", 7), ("ur5", 6)])
def test_the_real_files_of_example_robot_data(model: str, joints: int) -> None:
    """Where it is installed (131 MB: not in the test extra)."""
    try:
        importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    robot = load_robot(f"example_robot_data:{model}")
    assert robot.nq == joints
