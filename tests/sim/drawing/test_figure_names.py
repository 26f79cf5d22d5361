"""Names from files in figures: what stands between dollars is not read as mathematics, which can fail."""

from dataclasses import replace
from pathlib import Path

import matplotlib.text
import pytest

import qpsafe
from qpsafe.sim.drawing.plots import figure_11
from qpsafe.sim.drawing.stories import encounter_figure, plan_figure
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.recording.log import RunLog
from qpsafe.sim.stories.file import parse_story

NAMES = ("$x$", r"cost $5, $\foo$, $\frac$, a_{b}^c, 100 %")
STORY = """
title = '{name}'
[[person]]
name = 'Ada {name}'
start = [1.5, 0.0]
[[person.step]]
do = "wait"
time = 3.0
"""


@pytest.fixture(scope="module")
def log() -> RunLog:
    log = FixedExperiment(qpsafe.load_robot("irb140"), duration=0.02).run()
    log.distances[:] = 0.5  # every spot has its line, and its name in the legend
    return log


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_drawn_as_it_is_written(
    name: str, log: RunLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: set[str] = set()
    read = matplotlib.text.Text._preprocess_math

    def kept(self: matplotlib.text.Text, text: str) -> tuple[str, object]:
        shown, mathematics = read(self, text)
        if not mathematics:
            drawn.add(shown)
        return shown, mathematics

    monkeypatch.setattr(matplotlib.text.Text, "_preprocess_math", kept)
    plan_figure(parse_story(STORY.format(name=name), Path("story.toml")), tmp_path / "plan.png")
    assert any(text.startswith(f"Ada {name}, ") for text in drawn)
    assert name in drawn
    spots = tuple(f"{spot} {name}" for spot in log.spot_names)
    figure_11(replace(log, spot_names=spots), tmp_path / "figure.png", f"robot {name}")
    encounter_figure(log, tmp_path / "encounter.png", f"story {name}")
    assert {f"robot {name}", f"story {name}", *spots} <= drawn
