"""What somebody has corrected in the files that were chosen for a robot is never written over."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from amounts import some
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.experiments.shared import skin
from qpsafe.sim.experiments.shared.by_hand import MARK, by_hand, marked, unmarked, write_marked
from qpsafe.sim.experiments.shared.ready import Ready, made_ready

pytestmark = pytest.mark.long


@hypothesis_settings(max_examples=some(20, of=200), deadline=None)
@given(st.text(), st.integers(0), st.sampled_from(["", "#", "x", "\n", "é", "\r"]))
def test_any_change_is_seen_and_none_is_not(tmp_path_factory: Any, text: str, where: int, more: str) -> None:
    path = tmp_path_factory.getbasetemp() / "file.toml"
    write_marked(path, text.replace("\r", ""))
    written = path.read_bytes()
    assert not by_hand(path)
    write_marked(path, marked(text.replace("\r", "")))  # a mark is not marked again
    assert path.read_bytes() == written
    whole = written.decode()
    k = where % (len(whole) + 1)
    path.write_bytes((whole[:k] + more + whole[k:]).encode())
    after = path.read_text(encoding="utf-8")
    assert by_hand(path) or after == whole or unmarked(after) == unmarked(whole)
    path.write_bytes(b"\xff\xfe")
    assert by_hand(path)
    path.unlink()
    assert not by_hand(path)


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """A choice of sensors that looks at few people."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(skin, "PAIRS", 20)
        patch.setattr(skin, "AROUND", 4)
        yield


@pytest.fixture(scope="module")
def chosen(arms: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Ready]:
    """A bare URDF, the folder of results, and what was chosen."""
    folder = tmp_path_factory.mktemp("own")
    file = arms.write_arm(folder, shapes=False)
    return file, folder / "out", made_ready("test", str(file), folder / "out")


@pytest.fixture
def again(chosen: tuple[Path, Path, Ready], tmp_path: Path) -> tuple[Path, Path]:
    """The same, to be changed."""
    shutil.copytree(chosen[1], tmp_path / "out")
    return chosen[0], tmp_path / "out"


def test_a_corrected_robot_is_the_robot_from_then_on(again: tuple[Path, Path]) -> None:
    file, out = again
    toml = out / "robot" / "robot.toml"
    text = toml.read_text(encoding="utf-8").replace("max_velocity = 143.239449", "max_velocity = 90.0", 1)
    toml.write_text(text, encoding="utf-8")
    before = {path.name: path.read_bytes() for path in toml.parent.iterdir()}
    made = made_ready("test", str(file), out)
    assert {path.name: path.read_bytes() for path in toml.parent.iterdir()} == before
    assert made.robot.max_velocity[0] == pytest.approx(1.5708, abs=1e-4)
    assert any("changed by hand" in item for item in made.said)


def test_what_nobody_changed_is_not_even_written(chosen: tuple[Path, Path, Ready]) -> None:
    file, out, first = chosen
    before = {path: path.stat().st_mtime_ns for path in (out / "robot").iterdir()}
    assert made_ready("test", str(file), out).said == first.said
    assert {path: path.stat().st_mtime_ns for path in (out / "robot").iterdir()} == before
    assert all(path.read_text(encoding="utf-8").splitlines()[-1].startswith(MARK) for path in before)


def test_corrected_sensors_stay(again: tuple[Path, Path]) -> None:
    file, out = again
    spots = out / "robot" / "spots.toml"
    head, first, *_ = spots.read_text(encoding="utf-8").split("\n[[spot]]\n")
    spots.write_text(f"{head}\n[[spot]]\n{first}", encoding="utf-8")
    made = made_ready("test", str(file), out)
    assert made.robot.spots_path is not None
    assert spots.read_text(encoding="utf-8") == f"{head}\n[[spot]]\n{first}"
    assert any("spots.toml was changed by hand and is kept" in item for item in made.said)


def test_a_correction_of_another_robot_is_not_taken_for_this_one(again: tuple[Path, Path], arms: Any) -> None:
    _, out = again
    toml = out / "robot" / "robot.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + "# mine\n", encoding="utf-8")
    other = arms.write_arm(out, arms.SEVEN)
    with pytest.raises(ConfigurationError, match=r"another folder.*changed by hand"):
        made_ready("test", str(other), out)
    assert toml.read_text(encoding="utf-8").endswith("# mine\n")


def test_a_corrected_copy_of_a_folder_stays_too(chosen: tuple[Path, Path, Ready], tmp_path: Path) -> None:
    """A folder of one's own, without sensors, is copied to get some."""
    own, out = tmp_path / "own", tmp_path / "out"
    own.mkdir()
    text = (chosen[1] / "robot" / "robot.toml").read_text(encoding="utf-8").replace('spots = "spots.toml"', "")
    (own / "robot.toml").write_text(text, encoding="utf-8")
    made_ready("test", str(own), out)
    copy = out / "robot" / "robot.toml"
    assert not by_hand(copy)
    copy.write_text(copy.read_text(encoding="utf-8").replace("143.239449", "100.0"), encoding="utf-8")
    kept = copy.read_bytes()
    made = made_ready("test", str(own), out)
    assert copy.read_bytes() == kept
    assert made.robot.max_velocity[0] == load_robot(out / "robot").max_velocity[0] == pytest.approx(1.7453, abs=1e-4)
