"""What is promised of an installation without extras: the loop runs, and whatever else is asked names its extra."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from amounts import first
from packaging.requirements import Requirement
from typer.main import get_command

from qpsafe.__main__ import EXTRAS
from qpsafe.cli.main import app

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

#: Hides every installed distribution that the extras in argv[1] do not bring, as if pip had never seen it.
HIDE = """
import json, sys, warnings
from importlib import metadata
from importlib.abc import MetaPathFinder
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

def closure(names, extras, seen):
    for text in names:
        wanted = Requirement(text) if isinstance(text, str) else text
        for extra in ("", *wanted.extras):
            key = canonicalize_name(wanted.name), extra
            if key in seen:
                continue
            seen.add(key)
            try:
                needs = metadata.requires(wanted.name) or []
            except metadata.PackageNotFoundError:
                continue  # for another system, or not installed here
            inner = [Requirement(line) for line in needs]
            closure([r for r in inner if r.marker is None or r.marker.evaluate({"extra": extra})], extras, seen)
    return seen

project = json.loads(sys.argv[1])
extras = sys.argv[2].split(",") if sys.argv[2] else []
optional = project["optional-dependencies"]

def texts(extra):
    for text in optional[extra]:
        wanted = Requirement(text)
        yield from (t for inner in wanted.extras for t in texts(inner)) if wanted.name == "qpsafe" else [text]

asked = [*project["dependencies"], *(text for extra in extras for text in texts(extra))]
kept = {name for name, _ in closure(asked, extras, set())} | {"qpsafe", "packaging", "pip", "setuptools"}
owners = {"proxsuite": {"proxsuite"}}  # a wheel whose modules metadata does not list
for module, names in metadata.packages_distributions().items():
    owners[module] = {canonicalize_name(name) for name in names}

class Hidden(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        top = "google.protobuf" if name.startswith("google.protobuf") else name.partition(".")[0]
        of = owners.get(top.partition(".")[0])
        if of is not None and not of & kept:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None

for module in [m for m in sys.modules if m.partition(".")[0] == "packaging"]:
    del sys.modules[module]
sys.meta_path.insert(0, Hidden())
warnings.simplefilter("ignore")
"""

LOOP = """
import numpy as np, qpsafe
found = {}
for name in qpsafe.__all__:
    getattr(qpsafe, name)
for name in (*qpsafe.bundled_robots(), urdf):
    robot = qpsafe.load_robot(name)
    tool = robot.tool_frames[0]
    here = qpsafe.FixedPose(robot.pose(tool, robot.home))
    controller = qpsafe.SafetyController(robot, [qpsafe.PositionTask(tool, here), qpsafe.OrientationTask(tool, here)])
    tick = controller.step(robot.home, np.zeros(robot.nq), points=[here.pose[:3, 3] + [0.3, 0.0, 0.0]])
    found[name] = [tick.status, bool(tick.cdf_n > 0.0)]
print(json.dumps(found))
"""

ASK = """
from qpsafe.errors import MissingExtraError
said = {}
for extra, code in json.loads(sys.argv[3]).items():
    try:
        exec(code, {"folder": sys.argv[4], "sys": sys})
        said[extra] = "nothing"
    except MissingExtraError as error:
        said[extra] = str(error)
    except SystemExit as error:
        said[extra] = f"exit: {error.code}"
print(json.dumps(said))
"""

#: What asks for an extra where there is none at all, and where there are those on which it builds.
BARE = {
    "cli": "from qpsafe.__main__ import main; main()",
    "mjcf": "import qpsafe; qpsafe.load_robot(folder + '/arm.xml')",
    "sim": "import qpsafe.sim.world.scene",
    "plots": "from qpsafe.sensing.skin.calibration_plot import calibration_figure; calibration_figure([])",
    "proxqp": "import qpsafe; qpsafe.HierarchicalLaw('paper', solver='proxqp')",
    "irc5": "import qpsafe.irc5.messages",
    "mink": "import qpsafe.plugins.mink",
    "pink": "import qpsafe.plugins.pink",
    "realsense": "from qpsafe.ranging.adapters.realsense import RealSense; RealSense('wall')",
    "models": "import qpsafe; qpsafe.load_robot('robot_descriptions:panda_description')",
}
WITH_SIM = {
    "video": "from qpsafe.sim.drawing.render import VideoWriter; VideoWriter('a.mp4', None, fps=25)",
    "place": "from qpsafe.placement.surface import _trimesh; _trimesh('a mesh')",
    "campaign": "from qpsafe.sim.campaign.store import _pyarrow; _pyarrow()",
    "tune": "from qpsafe.sim.tuning.ask import study_of; study_of(None, ())",
    "gym": "import qpsafe.sim.campaign.gym.environment",
    "web": "from qpsafe.sim.web.server import need_viser; need_viser()",
    "dask": "from qpsafe.sim.campaign.executors import dask_executor; dask_executor('tcp://127.0.0.1:1').__enter__()",
}
TOGETHER = {"test", "dev", "bench", "browser", "docs", "release"}  # for who works on the project

ARM = """<robot name="arm"><link name="base"/>{links}{joints}</robot>"""


def arm(folder: Path) -> Path:
    """Seven joints in a row, turning about z and y in turn."""
    links = "".join(
        f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        '</inertial><collision><geometry><box size="0.05 0.05 0.2"/></geometry></collision></link>'
        for i in range(7)
    )
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="{f"l{i - 1}" if i else "base"}"/><child link="l{i}"/>'
        f'<origin xyz="0.02 0 0.2"/><axis xyz="0 {i % 2} {1 - i % 2}"/>'
        '<limit lower="-2" upper="2" velocity="2" effort="50"/></joint>'
        for i in range(7)
    )
    path = folder / "arm.urdf"
    path.write_text(ARM.format(links=links, joints=joints))
    return path


def run(folder: Path, code: str, *words: str) -> dict[str, object]:
    command = [sys.executable, "-c", HIDE + code, json.dumps(PROJECT), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_loop_runs_without_any_extra(tmp_path: Path) -> None:
    """Every public name, every bundled robot and a URDF, with nothing installed but the base's dependencies."""
    found = run(tmp_path, f"urdf = {str(arm(tmp_path))!r}\n" + LOOP, "")
    assert len(found) >= 4
    assert set(map(tuple, found.values())) == {("ok", True)}  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize(("present", "asked"), first(1, [("", BARE), ("sim", WITH_SIM)]))
def test_what_is_missing_is_named_by_its_extra(present: str, asked: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    said = run(tmp_path, ASK, present, json.dumps(asked), str(tmp_path))
    assert {extra: f"pip install 'qpsafe[{extra}]'" in str(words) for extra, words in said.items()} == dict.fromkeys(
        asked, True
    ), said


#: What commands need that a robot's computer does not.
NEEDED = {
    "demo": {"mujoco", "matplotlib"},
    "web": {"viser", "mujoco"},
    "place": {"trimesh", "mujoco"},
    "campaign": {"pyarrow", "mujoco"},
    "tune": {"optuna", "pyarrow"},
    "bench": {"mink"},
    "stream": {"protobuf"},
    "irc5-sim": {"protobuf", "mujoco"},
    "irc5-faults": {"protobuf", "mujoco"},
}


def brought(extras: str) -> set[str]:
    """Names of the packages that extras bring, those on which they build included."""
    found = set()
    for extra in extras.split(","):
        for wanted in map(Requirement, PROJECT["optional-dependencies"][extra]):
            found |= brought(",".join(wanted.extras)) if wanted.name == "qpsafe" else {wanted.name}
    return found


def test_a_command_is_told_every_extra_that_it_needs() -> None:
    commands = get_command(app).commands  # type: ignore[attr-defined]
    assert set(EXTRAS) | set(NEEDED) <= set(commands)
    for name in commands:
        assert {"typer", "rich"} | NEEDED.get(name, set()) <= brought(EXTRAS.get(name, "sim")), name


@pytest.mark.parametrize("words", first(1, [["demo", "fixed", "--seed", "3"], ["web"]]))
def test_who_has_the_base_only_is_told_the_whole_command(words: list[str], tmp_path: Path) -> None:
    """As `uvx qpsafe demo fixed` has it, which installs no extra."""
    said = run(tmp_path, ASK, "", json.dumps({"cli": f"sys.argv[1:] = {words!r}; {BARE['cli']}"}), "")["cli"]
    source = f"'qpsafe[{EXTRAS.get(words[0], 'sim')}]' qpsafe {' '.join(words)}"
    assert f"uvx --from {source}, or pipx run --spec {source}" in str(said)


def test_every_extra_is_asked_for() -> None:
    assert set(PROJECT["optional-dependencies"]) - TOGETHER == {*BARE, *WITH_SIM}
