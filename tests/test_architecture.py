"""Arrows point one way: no circle of imports, and none from a lower room to a higher one. Drawn by grimp."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

#: From the ground up: a line may import the lines above it, and itself. The longest prefix of a name counts.
LAYERS = """
errors fixed reference
extras
text compiled
hqp hqp.own limits robot
hqp.backends tasks
hqp.solve danger
sensing
ranging
geometry
gate
laws recovery
pipeline gate
tick
controller
batch
plugins placement irc5 irc5.records bench check
sim.people sim.world sim.engine sim.ranging
sim.stories sim.recording
sim.drawing
sim.placement
sim.experiments.shared
sim.experiments.fixed
sim.experiments.path
sim.experiments.pick_place
sim.replay
sim.experiments sim.sick
sim.campaign.people
sim.campaign
sim.campaign.report
sim.tuning
sim.irc5 sim.web
cli.common cli.sheet cli.outputs
cli.check
cli cli.demos
__main__
"""

DRAW = """
import json, sys
import grimp
graph = grimp.build_graph("qpsafe", cache_dir=None, exclude_type_checking_imports=sys.argv[1] == "run")
imports = {module: sorted(graph.find_modules_directly_imported_by(module)) for module in graph.modules}
print(json.dumps(imports))
"""


def drawn(folder: Path, what: str) -> dict[str, list[str]]:
    """Module -> modules it imports, of the packages as they lie in the wheel."""
    command = [sys.executable, "-c", DRAW, what]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def wheel_like(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tree as a wheel has it, by links: nothing else may need them, so they are made here."""
    folder = tmp_path_factory.mktemp("drawn")
    (folder / "qpsafe").mkdir()
    for path in [*(ROOT / "qpsafe").iterdir(), *(ROOT / name for name in ("tasks", "robots", "sim"))]:
        (folder / "qpsafe" / path.name).symlink_to(path)
    return folder


@pytest.mark.parametrize("what", ["run", "types too"])
def test_no_module_is_in_a_circle(wheel_like: Path, what: str) -> None:
    imports = drawn(wheel_like, what)
    assert len(imports) > 200
    imports.pop("qpsafe")  # shows public names to static checkers
    TopologicalSorter(imports).prepare()  # raises and names the circle


def layer(module: str, layers: dict[str, int]) -> int:
    """Height of a module."""
    parts = module.removeprefix("qpsafe.").split(".")
    for length in range(len(parts), 0, -1):
        name = ".".join(parts[:length])
        if name in layers:
            return layers[name]
    raise AssertionError(f"{module} has no layer: say where it stands")


def test_no_arrow_points_upwards(wheel_like: Path) -> None:
    layers = {name: k for k, line in enumerate(LAYERS.split("\n")) for name in line.split()}
    layers |= {"sim": layers["extras"], "robots": 0}  # it says what is missing; folders of robots
    wrong = [
        (module, other)
        for module, others in drawn(wheel_like, "run").items()
        for other in others
        if "qpsafe" not in (module, other) and layer(module, layers) < layer(other, layers)
    ]
    assert not wrong


def rooms() -> dict[Path, list[Path]]:
    """Folder -> its modules."""
    found: dict[Path, list[Path]] = {}
    for top in ("qpsafe", "tasks", "sim"):
        for path in (ROOT / top).rglob("*.py"):
            if path.name != "__init__.py" and not path.name.endswith("_pb2.py"):
                found.setdefault(path.parent, []).append(path)
    return found


def test_no_room_is_crowded_and_no_module_is_long() -> None:
    assert {str(room.relative_to(ROOT)): len(inside) for room, inside in rooms().items() if len(inside) > 17} == {}
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text("utf-8").splitlines()) for p in rooms().values() for path in p
    }
    assert {name: length for name, length in lengths.items() if length > 300} == {}


def test_no_function_takes_many_positional_arguments() -> None:
    """But compiled kernels, which cannot take them otherwise, and commands, whose options the command line names."""
    many = []
    for path in (path for inside in rooms().values() for path in inside if "cli" not in path.parts):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef):
                kernel = any(ast.unparse(d).startswith(("entry", "inline")) for d in node.decorator_list)
                names = [a.arg for a in (*node.args.posonlyargs, *node.args.args) if a.arg not in ("self", "cls")]
                if len(names) > 8 and not kernel:
                    many.append(f"{path.relative_to(ROOT)}: {node.name}")
    assert many == ["qpsafe/hqp/own/hierarchy.py: run"]  # compiled in `qpsafe.hqp.own.solver`


def test_no_two_modules_share_a_name_that_says_nothing() -> None:
    names = [path.stem for inside in rooms().values() for path in inside]
    assert [name for name in ("reference", "kernel", "timing", "loop") if names.count(name) > 1] == []
