"""What is written is read again, to the last bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.sim.stories.file import load_story, parse_story
from qpsafe.sim.stories.steps import BoardTable, PersonTable, StoryTable
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


@given(st.text(min_size=1, max_size=60, alphabet=st.characters(exclude_categories=["Cs"])))
def test_names_may_hold_anything(name: str) -> None:
    person = PersonTable(name=name, start=(1.0, -2.5e-7), board=BoardTable(), repeat=3)
    table = StoryTable(title=name[::-1], duration=1.5, person=[person])
    assert parse_story(story_text(table)).table == table
