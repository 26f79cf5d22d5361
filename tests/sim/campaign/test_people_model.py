"""The model of encounters: distributed as it says, a function of the point alone, and people stay people in it."""

from __future__ import annotations

import math
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.people import BUNDLED, EncounterModel
from qpsafe.sim.campaign.people.draws import Draw
from qpsafe.sim.campaign.people.file import PeopleFile
from qpsafe.sim.campaign.people.floor_plan import PEDESTAL, FloorPlan, Rectangle
from qpsafe.sim.campaign.people.tables import Spread, mixed
from qpsafe.sim.people.person import SEGMENTS, Person
from qpsafe.sim.stories.story import Story
from qpsafe.text.toml_parse import toml_table

MODEL, FILE = EncounterModel.load(), PeopleFile.read(BUNDLED)
TABLE = FILE.table
PLAIN = FloorPlan(-0.55, (0.45, 0.0, 0.54), 0.81)
TABLES = FloorPlan(
    *(-0.55, (0.49, 0.0, 0.45), 0.81),
    obstacles=(PEDESTAL, Rectangle(0.3, 0.68, 0.27, 0.59), Rectangle(0.3, 0.68, -0.59, -0.27)),
)
DT = 0.004


@pytest.fixture(scope="module")
def draws() -> list[Draw]:
    """The people of 600 encounters."""
    return [one for seed in range(600) for one in FILE.draws(MODEL.random(seed).tolist())]


def cut(spread: Spread) -> Any:
    """The distribution by another library."""
    low, high = spread.ends
    if spread.normal is None:
        return stats.uniform(low, high - low)
    mean, deviation = spread.normal
    return stats.truncnorm((low - mean) / deviation, (high - mean) / deviation, mean, deviation)


def agrees(values: list[float], cdf: Any) -> bool:
    return stats.kstest(values, cdf).pvalue > 0.01


def test_walking_speeds_heights_and_azimuths_are_distributed_as_said(draws: list[Draw]) -> None:
    walkers = [one for one in draws if one.kind in ("past", "straight", "reach", "turn")]
    walk, body, share, women = TABLE.walk, TABLE.body, TABLE.walk.hurry.share, TABLE.body.women.share
    slow, fast, low, tall = (cut(s) for s in (walk.comfortable, walk.hurried, body.height_women, body.height_men))
    assert agrees([one.speed for one in walkers], lambda v: (1.0 - share) * slow.cdf(v) + share * fast.cdf(v))
    assert agrees([one.height for one in draws], lambda h: women * low.cdf(h) + (1.0 - women) * tall.cdf(h))
    around = [math.remainder(one.azimuth, 2.0 * math.pi) for one in draws]
    assert agrees(around, stats.uniform(-math.pi, 2.0 * math.pi).cdf)
    reachers = [one.hand_speed for one in draws if one.kind == "reach"]
    assert agrees(reachers, cut(TABLE.hand.speed).cdf)
    # ... and the test can tell: comfortable speeds alone are others
    assert not agrees([one.speed for one in walkers], slow.cdf)


def test_people_come_from_all_round_as_kinds_and_pairs_are_weighted(draws: list[Draw]) -> None:
    kinds, total = Counter(one.kind for one in draws), sum(TABLE.kinds.weights.values())
    wanted = [len(draws) * TABLE.kinds.weights[name] / total for name in TABLE.kinds.weights]
    assert stats.chisquare([kinds[name] for name in TABLE.kinds.weights], wanted).pvalue > 0.01
    pairs = len(draws) - 600
    assert stats.binomtest(pairs, 600, TABLE.encounter.second.share).pvalue > 0.01
    boards = [one.board for one in draws if one.kind in ("past", "straight", "turn")]
    assert stats.binomtest(sum(boards), len(boards), TABLE.body.board.share).pvalue > 0.01
    assert not any(one.board for one in draws if one.kind in ("reach", "stumble"))


SPREADS = [
    Spread(uniform=(-2.0, 3.0), source="ours"),
    Spread(normal=(1.4, 0.17), within=(0.8, 2.0), source="ours"),
    Spread(normal=(0.0, 1.0), within=(2.0, 2.5), source="ours"),
]


@pytest.mark.parametrize("spread", SPREADS)
@given(u=st.floats(0.0, 1.0))
def test_a_spread_is_the_inverse_of_its_distribution(spread: Spread, u: float) -> None:
    value = spread.at(u)
    assert spread.ends[0] <= value <= spread.ends[1]
    assert spread.below(value) == pytest.approx(u, abs=1e-9)
    assert cut(spread).cdf(value) == pytest.approx(u, abs=1e-9)


@given(u=st.floats(0.0, 1.0), share=st.floats(0.0, 1.0))
def test_a_mixture_is_the_inverse_of_the_mixed_distribution(u: float, share: float) -> None:
    parts, weights = SPREADS[:2], (share, 1.0 - share)
    value = mixed(parts, weights, u)
    assert sum(w * cut(part).cdf(value) for part, w in zip(parts, weights, strict=True)) == pytest.approx(u, abs=1e-9)


def numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [x for part in value.values() for x in numbers(part)]
    if isinstance(value, list | tuple):
        return [x for part in value for x in numbers(part)]
    return [float(value)] if isinstance(value, float) else []


@pytest.mark.parametrize("seed", first(1, range(3)))
@pytest.mark.parametrize("name", [n for n, smooth in zip(MODEL.names, MODEL.continuous, strict=True) if smooth])
def test_encounters_are_continuous_where_the_model_says_so(seed: int, name: str) -> None:
    u = 0.05 + 0.9 * MODEL.random(seed)
    u[1] = 0.5 * TABLE.encounter.second.share  # two people
    at, step = MODEL.names.index(name), 1e-7
    near = u.copy()
    near[at] += step
    one, other = (numbers(MODEL.encounter(point, PLAIN).table.model_dump()) for point in (u, near))
    assert len(one) == len(other)
    change = np.array(one) - np.array(other)
    change[np.abs(np.abs(change) - 360.0) < 1e-3] = 0.0  # headings
    assert np.abs(change).max() < 1e4 * step


def test_every_coordinate_matters_to_somebody() -> None:
    rng = np.random.default_rng(3)
    for at, name in enumerate(MODEL.names):
        for _ in range(200):
            u = rng.random(MODEL.dimensions)
            u[1] = u[1] if name == "second" else 0.01
            other = u.copy()
            other[at] = rng.random()
            if FILE.draws(u.tolist()) != FILE.draws(other.tolist()) or name == "duration":
                break
        else:
            raise AssertionError(f"{name} changes nothing")


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_same_point_is_the_same_encounter_to_the_last_bit(seed: int) -> None:
    u, times = MODEL.random(seed), np.arange(0.0, 6.0, 0.05)
    assert np.array_equal(u, EncounterModel.load().random(seed))
    assert not np.array_equal(u, MODEL.random(seed + 1))
    one, other = (EncounterModel.load().encounter(u, PLAIN) for _ in range(2))
    assert one.duration == other.duration
    assert np.array_equal(one.track(times).ends, other.track(times).ends)


@pytest.mark.parametrize("plan", [PLAIN, TABLES], ids=["plain", "tables"])
@pytest.mark.parametrize("seed", first(3, range(20)))
def test_people_stay_people_whatever_they_do(seed: int, plan: FloorPlan) -> None:
    story = MODEL.encounter(MODEL.random(seed), plan)
    times = np.arange(0.0, story.duration, DT)
    assert 6.0 <= story.duration <= 10.0
    for actor, table in zip(story.people, story.table.person, strict=True):
        ends, (x, y, heading) = actor.poses_at(times).ends, actor.course(times)
        # nobody is faster than their walk says, and nobody goes through furniture
        fastest = max(step.speed for step in table.step if step.do == "walk")
        assert (np.hypot(np.diff(x), np.diff(y)) / DT).max() <= fastest * (1.0 + 1e-6) <= 2.5 * (1.0 + 1e-6)
        for r in plan.obstacles:
            assert not ((r.x0 < x) & (x < r.x1) & (r.y0 < y) & (y < r.y1)).any()
        # bones keep their lengths, hands those of the board by 2 mm
        lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
        off = np.abs(lengths - [segment.length for segment in actor.person.body.segments]).max(axis=0)
        loose = [i for i, s in enumerate(SEGMENTS) if s.name.endswith("hand")]
        assert np.delete(off, loose).max() < 1e-9
        assert off.max() < 2e-3
        # feet that stand do not slide, and nothing sinks into the floor
        for foot in (7, 13):
            toe = ends[:, foot, 1]
            down = toe[:, 2] < plan.floor + actor.person.body.foot_radius + 1e-9
            moved = np.linalg.norm(np.diff(toe, axis=0), axis=1)[down[1:] & down[:-1]]
            assert moved.max() < 4e-4
        radii = np.array([segment.radius for segment in actor.person.body.segments])
        assert (ends[..., 2].min(axis=2) - radii).min() > plan.floor - 1e-9
        # hands: those of the steps and those of hanging arms add up
        hands = np.linalg.norm(np.diff(ends[:, [10, 16], 1], axis=0), axis=-1).max(axis=1) / DT
        person = Person(plan.floor, None, actor.person.body)
        roots = np.stack((x, y, heading), axis=-1)
        free = person.poses(roots, actor._footsteps.at(times)).hands
        said = max((step.speed for step in table.step if step.do in ("reach", "retract", "stumble")), default=0.0)
        swing = (np.linalg.norm(np.diff(free, axis=0), axis=-1) / DT).max()
        if not table.board:
            assert hands.max() <= said + swing + 1e-6
        assert said <= 2.0


def test_people_begin_out_of_sight_and_come_soon() -> None:
    seen = []
    for seed in range(40):
        story = MODEL.encounter(MODEL.random(seed), PLAIN)
        times = np.arange(0.0, story.duration, 0.02)
        for number, actor in enumerate(story.people):
            away = np.hypot(*actor.course(times)[:2])
            assert away[0] > PLAIN.reach + 0.85
            if number == 0:
                seen.append(times[np.argmax(away < PLAIN.reach + 0.8)] if away.min() < PLAIN.reach + 0.8 else math.inf)
    assert np.median(seen) < 2.5
    assert np.mean(np.isfinite(seen)) > 0.95


def test_hands_get_as_near_to_what_they_want_as_an_arm_can() -> None:
    """Near points are reached as they are; those out of reach on the way to them."""
    from qpsafe.sim.campaign.people.within_reach import within_reach

    root = (0.9, 0.2, math.pi)
    assert within_reach(1.75, -0.55, root, (0.5, 0.1, 0.5), True) == pytest.approx((0.5, 0.1, 0.5), abs=1e-12)
    far = within_reach(1.75, -0.55, root, (-1.5, 0.1, 0.5), True)
    farther = within_reach(1.75, -0.55, root, (-3.5, 0.1, 0.5), True)
    assert -1.5 < far[0] < 0.2
    assert farther == pytest.approx(far, abs=0.1)


WRONG = {
    "an unknown key": ("[walk]", "[walk]\nspeed = 1.0", "walk.speed"),
    "no source": ('share = 0.5, source = "ours"', "share = 0.5", "body.women.source"),
    "two distributions": ("uniform = [6.0, 10.0]", "uniform = [6.0, 10.0], normal = [7.0, 1.0]", "encounter.duration"),
    "the wrong way round": ("uniform = [6.0, 10.0]", "uniform = [10.0, 6.0]", "encounter.duration"),
    "nobody walks so fast": ("uniform = [1.75, 2.50]", "uniform = [1.75, 3.50]", "walk.hurried"),
    "no number": ("share = 0.25", 'share = "many"', "walk.hurry.share"),
    "not finite": ("uniform = [0.2, 2.5]", "uniform = [0.2, inf]", "approach.stay.uniform"),
    "no weight": ("past = 0.20", "past = -0.20", "kinds.past"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_its_line(name: str, tmp_path: Path) -> None:
    before, after, key = WRONG[name]
    text = BUNDLED.read_text(encoding="utf-8")
    assert before in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        EncounterModel.load(path)
    assert error.value.key.startswith(key)
    assert re.search(r"mine\.toml:\d+", str(error.value))


def test_a_copy_with_other_numbers_is_another_model(tmp_path: Path) -> None:
    path = tmp_path / "hurried.toml"
    text = BUNDLED.read_text(encoding="utf-8").replace("share = 0.25", "share = 1.0")
    path.write_text(re.sub(r"^(?!straight)(\w+) = 0\.\d+ ", r"\1 = 0.0 ", text, flags=re.MULTILINE), encoding="utf-8")
    model = EncounterModel.load(path)
    assert {kind for seed in range(50) for kind in model.kinds(model.random(seed))} == {"straight"}
    for seed in range(5):
        walk = model.encounter(model.random(seed), PLAIN).table.person[0].step[1]
        assert walk.speed >= 1.75  # type: ignore[union-attr]


def write_stories(folder: Path) -> list[Path]:
    step = '[[person.step]]\ndo = "walk"\nto = [0.6, 0.0]\nspeed = {speed}\n'
    paths = [folder / "slow.toml", folder / "fast.toml"]
    for path, speed in zip(paths, (0.8, 1.6), strict=True):
        path.write_text(f'[[person]]\nname = "A"\nstart = [3.0, 0.0]\n{step.format(speed=speed)}', encoding="utf-8")
    return paths


def first_walk(story: Story) -> float:
    return next(step.speed for step in story.table.person[0].step if step.do == "walk")


def test_stories_may_be_the_model(tmp_path: Path) -> None:
    paths = write_stories(tmp_path)
    folder, listed = EncounterModel.load(tmp_path), EncounterModel.load(paths)
    assert folder.dimensions == listed.dimensions == 2
    assert {folder.kinds(folder.random(seed)) for seed in range(20)} == {("slow",), ("fast",)}
    assert first_walk(listed.encounter([0.0, 0.0], PLAIN)) == 0.8
    assert first_walk(listed.encounter([0.99, 0.0], PLAIN)) == 1.6
    assert 1.4 <= first_walk(listed.encounter([0.99, 0.3], PLAIN)) < 1.6
    assert listed.encounter([0.0, 0.5], FloorPlan(-0.8, (0.4, 0.0, 0.4), 1.0)).floor == -0.8
    assert EncounterModel.load(paths[0]).kinds([0.9, 0.5]) == ("slow",)


def test_stories_that_are_wrong_and_places_without_any_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="TOML files"):
        EncounterModel.load(tmp_path)
    with pytest.raises(ConfigurationError, match=r"nothing\.toml"):
        EncounterModel.load(tmp_path / "nothing.toml")
    paths = write_stories(tmp_path)
    paths[1].write_text(paths[1].read_text().replace("1.6", "9.0"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"fast\.toml:7: person\[0\]\.step\[0\]\.speed"):
        EncounterModel.load(paths)


@pytest.mark.parametrize("u", [[0.5] * 3, [math.nan] * MODEL.dimensions, [1.5] * MODEL.dimensions])
def test_what_is_no_point_of_the_cube_is_refused(u: list[float]) -> None:
    with pytest.raises(ConfigurationError, match="numbers from 0 to 1"):
        MODEL.encounter(u, PLAIN)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_the_corners_of_the_cube_are_encounters_too(value: float) -> None:
    for kind in np.linspace(0.0, 1.0, 15):
        u = np.full(MODEL.dimensions, value)
        u[[MODEL.names.index(f"{who}.kind") for who in ("first", "second")]] = kind
        assert MODEL.encounter(u, TABLES).duration > 0.0


@given(
    unit=st.lists(st.floats(0.0, 1.0), min_size=MODEL.dimensions, max_size=MODEL.dimensions),
    reach=st.floats(0.5, 1.8),
    floor=st.floats(0.2, 1.2),
    tool=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.2, 1.2)),
    boxes=st.lists(
        st.tuples(st.floats(-1.0, 1.0), st.floats(0.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.2, 1.2)), max_size=3
    ),
)
@settings(max_examples=some(10, of=25), deadline=None)
def test_every_point_is_an_encounter_in_every_cell(unit, reach, floor, tool, boxes) -> None:
    """Nothing is refused, nothing is infinite, and nobody walks through what stands there."""
    obstacles = (PEDESTAL, *(Rectangle(x, x + a, y, y + b) for x, a, y, b in boxes))
    story = MODEL.encounter(unit, FloorPlan(-floor, tool, reach, obstacles=obstacles))
    times = np.arange(0.0, story.duration, 0.05)
    assert np.isfinite(story.track(times).ends).all()
    for actor in story.people:
        x, y, _ = actor.course(times)
        assert not any(((r.x0 < x) & (x < r.x1) & (r.y0 < y) & (y < r.y1)).any() for r in obstacles)


def test_the_page_lists_every_number_with_its_source() -> None:
    page = (Path(__file__).parents[3] / "docs" / "explanation" / "campaign-people.md").read_text(encoding="utf-8")
    rows = {m[1]: (m[2], m[3]) for m in re.finditer(r"^\| `(\w+\.\w+)` \| (.*?) \| (.*?) \|$", page, re.MULTILINE)}
    file = toml_table(BUNDLED.read_text(encoding="utf-8"))
    listed = {f"{room}.{key}": value for room, tables in file.items() if room not in ("title", "kinds")
              for key, value in tables.items()}  # fmt: skip
    assert rows.keys() == listed.keys()
    for key, value in listed.items():
        text, source = rows[key]
        wanted = (
            [100.0 * value["share"]]
            if "share" in value
            else [*value.get("normal", ()), *(value.get("within") or value["uniform"])]
        )
        assert [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", text.split("<")[0])] == pytest.approx(wanted)
        assert source == value["source"]
    weights = dict(re.findall(r"^\| `(\w+)` \| (\d+) % \|", page, re.MULTILINE))
    assert {name: float(share) / 100.0 for name, share in weights.items()} == pytest.approx(TABLE.kinds.weights)
