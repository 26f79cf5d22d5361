"""What a stranger gets: sdist and wheel that an index would take, and an environment in which the README works."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import qpsafe

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def run(*words: object, where: Path, good: bool = True) -> str:
    """Output of a command that sees nothing of this tree and of this environment."""
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        list(map(str, words)), cwd=where, env=clean | {"NO_COLOR": "1"}, capture_output=True, text=True, timeout=900
    )
    assert (done.returncode == 0) == good, f"{words}: {done.stdout[-2000:]}{done.stderr[-4000:]}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel made from it."""
    for module in ("build", "twine"):
        pytest.importorskip(module, reason=f"needs {module}: pip install 'qpsafe[release]'")
    if not (ROOT / ".git").exists():
        pytest.skip("this tree is an unpacked sdist itself")
    work = tmp_path_factory.mktemp("built")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.splitlines():
        source, target = ROOT / name, work / "tree" / name
        if source.exists():  # not yet staged as deleted
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", work / "dist", work / "tree", where=work)
    return work / "dist"


@pytest.mark.slow
def test_an_index_would_take_both(built: Path) -> None:
    names = sorted(path.name for path in built.iterdir())
    assert names == [f"qpsafe-{qpsafe.__version__}-py3-none-any.whl", f"qpsafe-{qpsafe.__version__}.tar.gz"]
    said = run(sys.executable, "-m", "twine", "check", "--strict", *built.iterdir(), where=built)
    assert said.count("PASSED") == 2, said


@pytest.mark.slow
def test_an_empty_environment_runs_the_readme(built: Path, tmp_path: Path) -> None:
    """The base alone steps a controller; with an extra more, the commands are there."""
    run(sys.executable, "-m", "venv", tmp_path / "empty", where=tmp_path)
    python, command = (tmp_path / "empty" / "bin" / name for name in ("python", "qpsafe"))
    (wheel,) = built.glob("*.whl")
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "-c", ROOT / "constraints.txt")
    run(*pip, wheel, where=tmp_path)
    installed = run(python, "-m", "pip", "list", "--format=freeze", where=tmp_path).lower()
    assert not re.search(r"^(mujoco|matplotlib|mink|typer|rich|proxsuite)\b", installed, re.MULTILINE), installed

    (tmp_path / "readme.py").write_text("\n".join(re.findall(r"```python\n(.*?)```", README, re.DOTALL)))
    assert "danger" in run(python, "readme.py", where=tmp_path)
    assert "pip install 'qpsafe[cli]'" in run(command, "--version", where=tmp_path, good=False)

    run(*pip, f"{wheel}[sim]", where=tmp_path)
    assert run(command, "--version", where=tmp_path).split() == ["qpsafe", qpsafe.__version__]
    for words in sorted(set(re.findall(r"^\| `qpsafe ([a-z0-9-]+(?: [a-z-]+)?)", README, re.MULTILINE))):
        assert "Usage" in run(command, *words.split(), "--help", where=tmp_path)
    demo = ("demo", "fixed", "--duration", "1", "--no-video", "--out", tmp_path / "out")
    assert "joint velocity limits" in run(command, *demo, where=tmp_path)
    assert (tmp_path / "out" / "figure.png").stat().st_size > 10_000
