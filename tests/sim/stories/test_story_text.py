"""What is written is read again, to the last bit."""

from __future__ import annotations

from pathlib import Path

import pytest

from qpsafe.sim.campaign.floor_plan import FloorPlan
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.stories.file import load_story, parse_story
from qpsafe.sim.stories.write import story_text

MODEL, PLAN = EncounterModel.load(), FloorPlan(-0.55, (0.45, 0.0, 0.54), 0.81)


@pytest.mark.parametrize("path", ["examples/two_people.toml", "sim/experiments/pick_place/people.toml"])
def test_a_file_is_written_as_what_it_says(path: str) -> None:
    story = load_story(Path(path))
    assert parse_story(story_text(story.table)).table == story.table


@pytest.mark.parametrize("seed", range(12))
def test_random_encounters_are_stories_that_can_be_written_down(seed: int) -> None:
    table = MODEL.encounter(MODEL.random(seed), PLAN).table
    again = parse_story(story_text(table)).table
    assert again == table
    assert story_text(again) == story_text(table)


def test_names_may_hold_anything() -> None:
    story = parse_story('title = "\\"a\\" \\\\ \\n ü"\n[[person]]\nname = "A \\t #"\nstart = [1.0, 2.0]\nboard = {}\n')
    assert parse_story(story_text(story.table)).table == story.table
