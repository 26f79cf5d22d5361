"""What of a robot decides trials: its own files and its shapes, and nothing else that lies in its folder."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from qpsafe.robot.loader import load_robot
from qpsafe.sim.campaign.plan import Plan


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot's folder that is the working folder, too, so results go into it."""
    shutil.copytree(load_robot("irb140").folder, tmp_path / "cell")
    return tmp_path / "cell"


def test_results_and_other_files_in_its_folder_do_not_count(folder: Path) -> None:
    plan = Plan(robot=str(folder))
    before = plan.digest()
    (folder / "out" / "campaign").mkdir(parents=True)
    (folder / "out" / "campaign" / "trials-1.parquet").write_bytes(b"1")
    (folder / "notes.txt").write_text("x")
    (folder / "work.toml").write_text("x = 1")
    assert plan.digest() == before


@pytest.mark.parametrize("name", ["robot.toml", "spots.toml", "spots-vl53l5cx.toml", "robot.xml"])
def test_its_own_files_count(name: str, folder: Path) -> None:
    plan = Plan(robot=str(folder))
    before = plan.digest()
    text = (folder / name).read_text(encoding="utf-8")
    (folder / name).write_text(text + ("<!-- -->" if name.endswith("xml") else "# changed\n"), encoding="utf-8")
    assert plan.digest() != before


@pytest.mark.slow
def test_a_model_elsewhere_and_what_its_meshes_look_like_count(tmp_path: Path) -> None:
    from qpsafe.sim.experiments.shared.ready import made_ready

    mesh, far = tmp_path / "meshes" / "link.obj", tmp_path / "ready"

    def looks(size: float) -> None:
        corners = "".join(f"v {size * (i & 1)} {size * (i >> 1 & 1)} {size * (i >> 2)}\n" for i in range(8))
        mesh.parent.mkdir(exist_ok=True)
        mesh.write_text(corners + "f 1 2 4\nf 1 4 3\nf 5 8 6\nf 5 7 8\nf 1 6 2\nf 1 5 6\nf 3 4 8\nf 3 8 7\n")

    looks(0.1)
    file = tmp_path / "urdf" / "arm.urdf"
    file.parent.mkdir()
    shape = '<collision><geometry><mesh filename="../meshes/link.obj"/></geometry></collision>'
    links, joints = f'<link name="l0">{shape}</link>', ""
    for i, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "0 0 1"), 1):
        links += f'<link name="l{i}">{shape}</link>'
        joints += (
            f'<joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="0 0 0.3"/>'
            f'<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="2" effort="0"/></joint>'
        )
    file.write_text(f'<robot name="arm">{links}{joints}</robot>')
    made_ready("test", str(file), far)
    plan = Plan(robot=str(far / "robot"))
    first = plan.digest()
    looks(0.12)
    second = plan.digest()
    file.write_text(file.read_text().replace('velocity="2"', 'velocity="3"'))
    assert len({first, second, plan.digest()}) == 3
    assert replace(plan, trials=7).digest() == plan.digest()
