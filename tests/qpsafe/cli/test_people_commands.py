"""Commands about people: stories are checked and put into demos; the viewer says in one line why it cannot open."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from amounts import first
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.sim.drawing.stories import plan_figure
from qpsafe.sim.experiments.fast_person import STORY, at_speed
from qpsafe.sim.stories.file import StoryError, load_story

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples" / "two_people.toml"
STORIES = [*sorted((ROOT / "examples").glob("*.toml")), STORY]


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(words))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


@pytest.mark.long
@pytest.mark.parametrize("path", first(1, STORIES), ids=lambda path: path.name)
def test_bundled_stories_are_sound_and_drawn(path: Path, tmp_path: Path) -> None:
    code, text = run("story", str(path), "--json", "--plot", str(tmp_path / "plan.png"))
    found = json.loads(text)
    assert code == 0
    story = load_story(path)
    assert found["duration"] == story.duration
    assert [step["does"] for step in found["steps"]] == [s.do for actor in story.people for s in actor.steps]
    assert all(step["from"] <= step["to"] for step in found["steps"])
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")
    plan_figure(story.varied(1), tmp_path / "other.png")
    assert (tmp_path / "plan.png").read_bytes() != (tmp_path / "other.png").read_bytes()


def test_a_wrong_story_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    path, out = tmp_path / "wrong.toml", tmp_path / "out"
    path.write_text(EXAMPLE.read_text().replace("speed = 1.2", "speed = 12.0"))
    for command in (["story"], ["demo", "fixed", "--out", str(out), "--story"], ["demo", "path", "--story"]):
        with pytest.raises(StoryError, match=r"wrong\.toml:\d+: person\[0\]\.step\[0\]\.speed = 12\.0"):
            run(*command, str(path))
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["fixed", "path"])
def test_a_demo_with_a_story_says_how_near_people_came(tmp_path: Path, kind: str) -> None:
    path, out = tmp_path / "near.toml", tmp_path / "out"
    path.write_text('[[person]]\nname = "A"\nstart = [1.0, 0.0]\n[[person.step]]\ndo = "wait"\ntime = 3.0\n')
    words = ["demo", kind, "--story", str(path), "--out", str(out), "--json", "--no-video", "--duration"]
    code, text = run(*words, "0.4" if kind == "fixed" else "3.0")
    assert code == 0
    found = json.loads(text)
    near = [found["encounter"]] if kind == "fixed" else list(found["encounters"].values())
    for item in near:
        assert item["contact"] is None
        assert 0.1 < item["distance"] < 1.0
    runs = sorted(file.name for file in out.glob("run*.npz"))
    laws = ("nullspace", "paper", "strict-no-recovery", "strict")
    assert runs == (["run.npz"] if kind == "fixed" else [f"run-{law}.npz" for law in laws])
    assert run("replay", str(out / runs[0]))[0] == 0


@pytest.mark.slow
def test_somebody_fast_is_reported_whatever_happens(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--experiment"):
        run("demo", "fast-person", "--experiment", "lunch", "--out", str(tmp_path))
    words = ["--speed", "2.0", "--experiment", "fixed", "--no-video", "--json", "--out", str(tmp_path)]
    code, text = run("demo", "fast-person", *words)
    assert code == 0
    row = json.loads(text)[0]
    assert (row["experiment"], row["speed"]) == ("fixed", 2.0)
    assert (row["contact"] is None) == (row["distance"] > 0.0)
    assert row["danger"] > 11.5
    assert (row["towards_speed"] is None) == (row["contact"] is None)
    assert json.loads((tmp_path / "table.json").read_text()) == [row]
    assert run("replay", str(tmp_path / "run-fixed-2.npz"))[0] == 0


def test_speeds_change_the_walk_and_nothing_else() -> None:
    for speed in (0.5, 2.0):
        story = at_speed(speed)
        walker = story.people[0]
        assert walker.course.speed(0.5 * (walker.steps[1].start + walker.steps[1].end)) == pytest.approx(
            speed, abs=1e-6
        )
        assert walker.root(story.duration)[:2] == pytest.approx((0.45, 0.0))


@pytest.mark.parametrize(
    "words",
    [
        ["demo", "fixed", "--duration", "1"],
        pytest.param(["demo", "path"], marks=pytest.mark.slow),
        pytest.param(["demo", "fast-person"], marks=pytest.mark.slow),
    ],
)
def test_without_a_display_the_viewer_says_so_in_one_line(
    words: list[str], without_display: Callable[..., Any], tmp_path: Path
) -> None:
    done = without_display(*words, "--view", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "viewer cannot open a window here" in done.stderr.strip().splitlines()[-1]
    assert list(tmp_path.iterdir()) == []
