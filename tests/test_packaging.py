"""One version, one list of packages, one range of Pythons: what is promised, what is in the tree and in the wheel."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from typer.testing import CliRunner

import qpsafe

ROOT = Path(__file__).resolve().parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT, SETUPTOOLS = PYPROJECT["project"], PYPROJECT["tool"]["setuptools"]
FOLDERS = SETUPTOOLS["package-dir"]  # package -> folder
HEAVY = {"mujoco", "pinocchio", "numba", "scipy", "matplotlib", "qpsolvers", "mink", "proxsuite", "daqp"}


def modules() -> dict[str, Path]:
    """Place in the wheel -> file, of every module in the tree."""
    found = {}
    for package, folder in FOLDERS.items():
        for path in (ROOT / folder).rglob("*.py"):
            if (path.parent / "__init__.py").exists():
                found[f"{package.replace('.', '/')}/{path.relative_to(ROOT / folder).as_posix()}"] = path
    return found


def test_every_folder_with_modules_is_a_package() -> None:
    """A forgotten __init__.py would leave modules out of the wheel. Scripts beside a robot's model are meant to be."""
    inside = {path.parent for path in modules().values()}
    folders = {path.parent for name in ("qpsafe", "tasks", "sim") for path in (ROOT / name).rglob("*.py")}
    assert {folder for folder in folders if folder.resolve() == folder} <= inside


def test_one_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert "version" in PROJECT["dynamic"]
    assert SETUPTOOLS["dynamic"]["version"] == {"attr": "qpsafe.__version__"}  # the one place
    assert "version" not in PROJECT
    assert str(citation["version"]) == qpsafe.__version__
    assert f"## [{qpsafe.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_citation_states_what_it_must() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["license"] == PROJECT["license"] == "Apache-2.0"
    (paper,) = citation["references"]
    assert {"type", "title", "authors", "journal", "year"} <= set(paper)
    assert paper["title"].lower() in " ".join((ROOT / "README.md").read_text("utf-8").replace("> ", "").lower().split())


def test_a_release_says_where_it_comes_from(tmp_path: Path) -> None:
    """The workflow's own step, run on a copy."""
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))
    (step,) = (step for step in workflow["jobs"]["build"]["steps"] if "project.urls" in step.get("run", ""))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    where = {"GITHUB_SERVER_URL": "https://github.com", "GITHUB_REPOSITORY": "some/robots"}
    where |= {"GITHUB_REPOSITORY_OWNER": "some", "GITHUB_REF_NAME": "v1.2.3"}
    subprocess.run(["bash", "-e", "-c", step["run"]], cwd=tmp_path, env=os.environ | where, check=True)
    made = tomllib.loads((tmp_path / "pyproject.toml").read_text(encoding="utf-8"))
    assert made["project"].pop("urls") == PROJECT["urls"] | {
        "Documentation": "https://some.github.io/robots",
        "Source": "https://github.com/some/robots",
        "Issues": "https://github.com/some/robots/issues",
        "Changelog": "https://github.com/some/robots/blob/v1.2.3/CHANGELOG.md",
    }
    assert made == PYPROJECT | {"project": {key: value for key, value in PROJECT.items() if key != "urls"}}


def test_one_range_of_pythons() -> None:
    """requires-python, classifiers, the workflow's matrix and the Makefile's check agree."""
    listed = {c.rpartition(" ")[2] for c in PROJECT["classifiers"] if c.startswith("Programming Language")}
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
    assert set(workflow["jobs"]["gate"]["strategy"]["matrix"]["python"]) == listed
    allowed = Requirement(f"python{PROJECT['requires-python']}").specifier
    assert {f"3.{minor}" for minor in range(8, 20) if allowed.contains(f"3.{minor}.1")} == listed
    first, last = re.findall(r"\(3, (\d+)\)", (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert {f"3.{minor}" for minor in range(int(first), int(last) + 1)} == listed


def test_the_gate_does_what_the_readme_says_in_its_order_then_lint_and_docs() -> None:
    blocks = re.findall(r"```bash\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    promised = [line.partition("#")[0].strip() for line in blocks[0].splitlines()]
    gate = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert re.findall(r"^make .*$", gate, re.MULTILINE) == [*promised, "make lint", "make docs"]


def test_nothing_puts_links_into_the_source_tree() -> None:
    """A test could come to need them, and fail in every fresh clone."""
    for name in ("dev", "demo", "test", "lint"):
        recipe = subprocess.run(["make", "--dry-run", "--always-make", name], cwd=ROOT, capture_output=True, text=True)
        assert recipe.returncode == 0, recipe.stderr
        for line in recipe.stdout.splitlines():
            assert not re.search(r"\bln\b", line) or " build/typed/" in line, line
    assert not [path for path in (ROOT / "qpsafe").iterdir() if path.is_symlink()], "left over from an older Makefile"


def test_the_oldest_numba_that_is_allowed_is_tried_and_the_newest_is_bounded() -> None:
    """Its inner parts, of which compiled code uses a few, change from one minor version to the next."""
    (numba,) = (requirement for requirement in requirements() if requirement.name == "numba")
    bounds = {specifier.operator: specifier.version for specifier in numba.specifier}
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert f'"numba=={bounds[">="]}.*"' in workflow
    pinned = re.search(r"^numba==(\d+)\.(\d+)", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert pinned is not None
    assert bounds["<"] == f"{pinned[1]}.{int(pinned[2]) + 1}"


def requirements(*extras: str) -> list[Requirement]:
    """Dependencies of the project with some extras, extras that name extras resolved."""
    found = [Requirement(text) for text in PROJECT["dependencies"]]
    for extra in extras:
        for requirement in map(Requirement, PROJECT["optional-dependencies"][extra]):
            found += requirements(*requirement.extras) if requirement.name == PROJECT["name"] else [requirement]
    return found


def test_constraints_pin_what_make_installs_and_name_no_host() -> None:
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+", line)] == []  # no address, option or path
    pins = {canonicalize_name(name): Version(version) for name, _, version in (line.partition("==") for line in lines)}
    assert len(pins) == len(lines)
    assert "://" not in text
    for requirement in requirements("dev", "bench", "release"):
        pin = pins.get(canonicalize_name(requirement.name))
        assert pin is not None, f"{requirement} is not pinned"
        assert requirement.specifier.contains(pin, prereleases=True), f"{requirement}: pinned to {pin}"


def test_the_package_is_typed() -> None:
    """One marker at the top covers all subpackages (PEP 561)."""
    assert (ROOT / "qpsafe" / "py.typed").is_file()
    assert "py.typed" in SETUPTOOLS["package-data"]["*"]
    assert all(package.partition(".")[0] == "qpsafe" for package in FOLDERS)


def test_public_names_are_there_for_people_and_for_checkers() -> None:
    """What is imported on first use, what static checkers are shown, and what the modules define are the same."""
    tree = ast.parse((ROOT / "qpsafe" / "__init__.py").read_text(encoding="utf-8"))
    guarded = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    shown = {a.asname: node.module for part in guarded for node in part.body for a in node.names}  # type: ignore[attr-defined]
    assert shown == qpsafe._PUBLIC
    assert set(qpsafe.__all__) == {"__version__", *shown}
    for name, module in shown.items():
        assert getattr(qpsafe, name) is getattr(importlib.import_module(module), name)


@pytest.mark.parametrize("module", ["qpsafe", "qpsafe.cli.main"])
def test_importing_loads_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert not HEAVY & set(loaded.stdout.split())


def test_the_command_line_helps() -> None:
    from qpsafe.cli.main import app

    (entry,) = (e for e in metadata.entry_points(group="console_scripts") if e.name == "qpsafe")
    assert entry.value == PROJECT["scripts"]["qpsafe"]
    assert callable(entry.load())
    shown = CliRunner().invoke(app, ["--help"], env={"NO_COLOR": "1", "TERM": "dumb"})
    assert shown.exit_code == 0
    assert all(command in shown.output for command in ("demo", "compare", "robots", "bench"))
    assert CliRunner().invoke(app, ["--version"]).output.strip() == f"qpsafe {qpsafe.__version__}"
    assert CliRunner().invoke(app, ["no-such-command"]).exit_code != 0


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from a copy of the tree, without the network."""
    pytest.importorskip("setuptools", minversion="77", reason="building the wheel here needs setuptools >= 77")
    copy, out = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for name in FOLDERS.values():
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.nb[ic]"))
    code = f"from setuptools import build_meta; build_meta.build_wheel({str(out)!r})"  # as pip would, in half the time
    subprocess.run([sys.executable, "-c", code], cwd=copy, check=True, timeout=300, capture_output=True)
    (path,) = out.glob("*.whl")
    return path


@pytest.mark.slow
def test_an_unpacked_sdist_is_a_whole_source_tree(tmp_path: Path) -> None:
    """Whatever is tracked is in it, so that its README's commands work."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode != 0:
        pytest.skip("this tree is an unpacked sdist itself")
    tree = tmp_path / "tree"
    for name in listed.stdout.splitlines():
        if (ROOT / name).exists():  # not yet staged as deleted
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    code = f"from setuptools import build_meta; build_meta.build_sdist({str(tmp_path)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=tree, check=True, timeout=300, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    assert set(listed.stdout.splitlines()) - names == set()


@pytest.mark.long
def test_the_wheel_has_every_module_and_leaks_no_other_name(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {name for name in names if name.endswith(".py")} == set(modules())
    assert {"qpsafe/py.typed", "qpsafe/tasks/task.py", "qpsafe/sim/__init__.py"} <= names
    data = {path.relative_to(ROOT).as_posix() for path in (ROOT / "sim").rglob("*.toml")}
    assert {f"qpsafe/{path}" for path in data} <= names
    assert {f"qpsafe/robots/irb140/{name}" for name in ("robot.xml", "robot.toml", "spots.toml")} <= names
    assert {f"qpsafe/robots/{name}/spots-vl53l5cx.toml" for name in qpsafe.bundled_robots()} <= names
    information = f"qpsafe-{qpsafe.__version__}.dist-info"
    assert {name.partition("/")[0] for name in names} == {"qpsafe", information}
    assert any(name.startswith(information) and name.endswith("/LICENSE") for name in names)


@pytest.mark.slow
def test_the_wheel_works_away_from_the_tree(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "import qpsafe, qpsafe.sim, qpsafe.tasks\n"
        "robot = qpsafe.load_robot('irb140')\n"
        "print(qpsafe.__file__, robot.folder, len(qpsafe.load_spots(robot)))"
    )
    python = [sys.executable, "-c", code]
    plain = os.environ | {"NUMBA_DISABLE_JIT": "1"}  # files count here: kernels would be compiled for this folder anew
    run = subprocess.run(python, cwd=tmp_path, capture_output=True, text=True, timeout=300, env=plain)
    assert run.returncode == 0, run.stderr
    module, folder, spots = run.stdout.split()
    assert Path(module).is_relative_to(tmp_path)
    assert Path(folder).is_relative_to(tmp_path)
    assert int(spots) > 0
