"""Stories: what people do is continuous, no faster than said, where it was asked for, and the same in a mirror."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from amounts import crossed, some
from hypothesis import example, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sim.people.anatomy import HEIGHTS, SEGMENTS, Body
from qpsafe.sim.people.person import Person
from qpsafe.sim.people.posture import Arm, Posture, Stoop
from qpsafe.sim.stories.file import StoryError, load_story, parse_story
from qpsafe.sim.stories.story import Story
from qpsafe.sim.world.distance import TrueDistances
from qpsafe.sim.world.scene import build_scene

TEXT = """
[[person]]
name = "Ada"
start = [3.0, 0.5]
heading = 180.0
height = 1.62

[[person.step]]
do = "walk"
to = [[1.6, 0.5], [1.0, 0.1]]
speed = 2.0

[[person.step]]
do = "reach"
arm = "right"
to = [0.55, 0.2, 0.2]
speed = 1.5
event = "take"

[[person.step]]
do = "wait"
time = 0.5

[[person.step]]
do = "retract"

[[person.step]]
do = "walk"
to = [[1.6, 0.6], [3.0, 0.5], [3.0, -1.0]]
speed = 1.2

[[person]]
name = "Bo"
start = [3.0, -1.5]
heading = 180.0
height = 1.86
board = { width = 0.5 }

[[person.step]]
do = "put_down"

[[person.step]]
do = "reach"
arm = "both"
to = [2.2, -1.5, 0.2]

[[person.step]]
do = "retract"

[[person.step]]
do = "look"
at = [0.0, 0.0, 0.5]

[[person.step]]
do = "carry"

[[person.step]]
do = "walk"
to = [2.4, -1.0]
facing = "keep"
speed = 0.5
"""
DT = 0.004


def person(steps: str, start: str = "start = [2.0, 0.0]\nheading = 180.0") -> str:
    return f'[[person]]\nname = "A"\n{start}\n{steps}'


@pytest.fixture(scope="module")
def story() -> Story:
    return parse_story(TEXT)


def sampled(story: Story, duration: float | None = None) -> np.ndarray:
    """Ends of all capsules of everybody (N, p, 17, 2, 3)."""
    times = np.arange(0.0, duration or story.duration + 1.0, DT)
    return np.stack([actor.poses_at(times).ends for actor in story.people], axis=1)


@pytest.fixture(scope="module")
def ends(story: Story) -> np.ndarray:
    return sampled(story)


def test_nothing_jumps_and_bones_keep_their_lengths(story: Story, ends: np.ndarray) -> None:
    speed = np.linalg.norm(np.diff(ends, axis=0), axis=-1) / DT
    assert speed.max() < 8.5  # a swinging foot goes at about four times the walking speed
    jolt = np.linalg.norm(np.diff(ends, n=2, axis=0), axis=-1) / DT  # change of velocity in a tick
    assert jolt.max() < 1.0
    for k, actor in enumerate(story.people):
        lengths = np.linalg.norm(ends[:, k, :, 1] - ends[:, k, :, 0], axis=-1)
        wanted = np.array([segment.length for segment in actor.person.body.segments])
        loose = [i for i, s in enumerate(SEGMENTS) if not s.name.endswith(("shank", "forearm", "hand"))]
        assert np.abs(lengths - wanted)[:, loose].max() < 1e-9
        assert np.abs(lengths - wanted).max() < 2e-3  # a hand on its way may be let go of by a millimetre


@given(
    st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), min_size=1, max_size=5),
    st.floats(0.5, 2.0),
    st.sampled_from(["travel", "keep"]),
)
@example([(0.0, 0.0), (2.0, 0.0), (2.0, 0.25), (0.0, 0.0)], 1.0, "travel")
@settings(max_examples=some(8, of=40), deadline=None)
def test_nobody_walks_faster_than_said_and_everybody_arrives(places, speed, facing) -> None:
    places = [place for a, place in zip([(5.0, 5.0), *places], places, strict=False) if math.dist(a, place) > 0.05]
    places = places or [(1.0, 1.0)]
    to = "[" + ", ".join(f"[{x!r}, {y!r}]" for x, y in places) + "]"
    story = parse_story(
        person(f'[[person.step]]\ndo = "walk"\nto = {to}\nspeed = {speed!r}\nfacing = "{facing}"', "start = [5.0, 5.0]")
    )
    actor = story.people[0]
    roots = np.stack(actor.course(np.arange(0.0, story.duration + 0.1, 0.01)), axis=1)
    steps = np.linalg.norm(np.diff(roots[:, :2], axis=0), axis=1)
    assert steps.max() <= speed * 0.01 * (1.0 + 1e-9)
    assert roots[-1, :2] == pytest.approx(places[-1], abs=1e-9)
    corners = max(len(places) - 1, 1)  # turns at corners that are near each other add up
    assert np.abs(np.diff(roots[:, 2])).max() <= corners * math.radians(241.0) * 0.01
    length = sum(math.dist(a, b) for a, b in zip([(5.0, 5.0), *places], places, strict=False))
    assert story.duration >= length / speed


def test_a_long_straight_walk_reaches_the_speed_that_was_said() -> None:
    story = parse_story(person('[[person.step]]\ndo = "walk"\nto = [-3.0, 0.0]\nspeed = 2.0'))
    assert story.people[0].course.speed(2.0) == pytest.approx(2.0, abs=1e-9)


def test_whoever_walks_looks_where_they_walk(story: Story) -> None:
    actor = story.people[0]
    walk = actor.steps[0]
    for t in np.arange(walk.start, walk.end, 0.05):
        (x1, y1, _), (x2, y2, heading) = actor.root(t - 0.02), actor.root(t + 0.02)
        if math.hypot(x2 - x1, y2 - y1) > 0.02:
            off = math.remainder(math.atan2(y2 - y1, x2 - x1) - heading, 2 * math.pi)
            assert abs(off) < math.radians(20.0)


def test_standing_feet_do_not_slide_and_feet_stay_above_the_floor(story: Story, ends: np.ndarray) -> None:
    for k, actor in enumerate(story.people):
        radius = actor.person.body.foot_radius
        for row in (7, 13):  # left and right foot
            assert ends[:, k, row, :, 2].min() >= actor.person.floor + radius - 1e-9
            toe = ends[:, k, row, 1]
            down = toe[:, 2] < actor.person.floor + radius + 1e-9
            both = down[1:] & down[:-1]
            assert np.linalg.norm(np.diff(toe, axis=0), axis=1)[both].max() < 2e-4


@pytest.mark.parametrize(("arm", "z"), crossed(["left", "right", "both"], [-0.4, -0.1, 0.3, 0.8, 1.2]))
def test_the_hand_is_at_the_point_from_the_end_of_the_step_on(arm: str, z: float) -> None:
    """From the floor to over the head, after a walk, also for both hands."""
    point = (1.05, -0.1, z)
    walk = '[[person.step]]\ndo = "walk"\nto = [1.5, 0.0]\n'
    steps = walk + f'[[person.step]]\ndo = "reach"\narm = "{arm}"\nto = {list(point)}'
    story = parse_story(person(steps + '\nspeed = 2.0\n[[person.step]]\ndo = "wait"\ntime = 3.0'))
    actor = story.people[0]
    reach = actor.steps[1]
    before = actor.pose(reach.end - 0.3).hands
    for t in np.linspace(reach.end, story.duration, 30):
        hands = actor.pose(t).hands
        used = {"left": hands[0], "right": hands[1], "both": hands.mean(axis=0)}[arm]
        assert np.linalg.norm(used - point) < 1e-3
    assert np.linalg.norm(before - hands, axis=1).max() > 0.01  # it was on its way


def test_hands_are_no_faster_than_said() -> None:
    for speed in (0.3, 2.0):
        step = f'[[person.step]]\ndo = "reach"\narm = "left"\nto = [1.4, 0.3, 0.6]\nspeed = {speed}\n'
        story = parse_story(person(step + f'[[person.step]]\ndo = "retract"\nspeed = {speed}'))
        hands = story.people[0].poses_at(np.arange(0.0, story.duration, DT)).hands
        fastest = np.linalg.norm(np.diff(hands, axis=0), axis=2).max() / DT
        assert 0.7 * speed < fastest <= speed


def test_a_point_out_of_reach_is_refused_with_what_is_missing() -> None:
    """Coming nearer by what the message says is enough, and by less is not."""

    def problem(x: float) -> str:
        step = '[[person.step]]\ndo = "reach"\narm = "right"\nto = [-0.5, -0.18, 0.8]'
        try:
            parse_story(person(step, f"start = [{x!r}, 0.0]\nheading = 180.0"), "far.toml")
        except StoryError as error:
            return str(error)
        return ""

    message = problem(2.0)
    assert "far.toml:8: person[0].step[0].to" in message
    missing = float(re.search(r"([\d.]+) m too far for the right hand", message)[1])
    assert 0.5 < missing < 2.0
    assert problem(2.0 - 1.15 * missing) == ""
    assert problem(2.0 - 0.9 * missing) != ""


SWAP = [0, 1, 2, 3, 4, *range(11, 17), *range(5, 11)]


def mirrored(ends: np.ndarray) -> np.ndarray:
    """Ends of the capsules (17, 2, 3) of the mirror image: y negated, left and right exchanged."""
    image = ends[SWAP] * (1.0, -1.0, 1.0)
    image[[3, 4]] = image[[3, 4]][:, ::-1]  # pelvis and shoulders go from right to left
    return image


@given(st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(0.0, 1.0), st.floats(0.0, 0.5))
def test_the_mirror_image_of_a_pose_is_the_pose_of_the_mirror_image(heading, ahead, share, lean) -> None:
    figure = Person(0.0, None, Body.of_height(1.7))
    reach, hang = Arm("hang", (0.5, -0.2, 1.1), share, 0.1), Arm()
    left, right = figure.standing_feet(1.0, 0.4, heading)
    left = left._replace(x=left.x + ahead, lift=0.03)
    a = figure.pose(1.0, 0.4, heading, (left, right), Posture((hang, reach), Stoop(lean, 0.1), gaze=(0.2, 0.3)))
    feet = tuple(f._replace(y=-f.y, yaw=-f.yaw) for f in (right, left))
    other = Posture((reach._replace(goal=(0.5, 0.2, 1.1)), hang), Stoop(lean, 0.1), gaze=(0.2, -0.3))
    b = figure.pose(1.0, -0.4, -heading, feet, other)
    assert a.ends == pytest.approx(mirrored(b.ends), abs=1e-9)


def test_mirrored_story_has_mirrored_poses(story: Story) -> None:
    """Left and right exchanged, y and angles negated. Feet differ: everybody begins with the left one."""
    text = TEXT.replace('"right"', '"LEFT"').replace('"left"', '"right"').replace('"LEFT"', '"left"')
    text = re.sub(r"\[(-?[\d.]+), (-?[\d.]+)(, -?[\d.]+)?\]", lambda m: f"[{m[1]}, {-float(m[2])}{m[3] or ''}]", text)
    image = parse_story(text.replace("heading = 180.0", "heading = -180.0"))
    assert image.duration == pytest.approx(story.duration, abs=1e-9)
    for a, b in zip(story.people, image.people, strict=True):
        for t in np.linspace(0.0, story.duration, 60):
            x, y, heading = b.root(t)
            assert a.root(t)[:2] == pytest.approx((x, -y), abs=1e-9)
            assert math.remainder(a.root(t)[2] + heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
        for step in a.steps:
            if step.do not in ("walk", "wait"):
                assert a.pose(step.end).hands == pytest.approx(mirrored(b.pose(step.end).ends)[[10, 16], 1], abs=0.05)


def test_a_board_stands_where_it_was_put_down_until_it_is_taken_up(story: Story) -> None:
    bo = story.people[1]
    board = bo.person.board
    assert board is not None
    put, carry = bo.steps[0], bo.steps[4]
    places = [bo.pose(t).board_position for t in np.linspace(put.end, carry.start, 20)]
    assert np.ptp(places, axis=0).max() < 1e-12
    assert places[0][2] == pytest.approx(bo.person.floor + 0.5 * board.height, abs=1e-9)
    after = bo.pose(story.duration)
    x, y, heading = bo.root(story.duration)
    assert after.board_face[:2] == pytest.approx(
        (x + board.reach * math.cos(heading), y + board.reach * math.sin(heading)), abs=1e-9
    )
    x, y, heading = bo.root(put.start)
    face = (x + board.reach * math.cos(heading), y + board.reach * math.sin(heading))
    assert bo.pose(put.start).board_face == pytest.approx((*face, bo.person.floor + board.centre_height), abs=1e-12)
    before = bo.poses_at(np.arange(0.0, bo.end, DT)).centres
    assert np.linalg.norm(np.diff(before, axis=0), axis=1).max() / DT <= 0.81  # as fast as it is moved, never a jump


def test_varied_stories_differ_and_are_repeatable(story: Story) -> None:
    assert story.varied(0) is story
    one, again, other = story.varied(1), story.varied(1), story.varied(2)
    for t in (1.0, 3.0, 7.0):
        for a, b in zip(one.poses(t), again.poses(t), strict=True):
            assert np.array_equal(a.ends, b.ends)
    assert not np.allclose(one.poses(2.0)[0].ends, other.poses(2.0)[0].ends, atol=1e-3)
    assert [step.do for step in one.people[0].steps][1:] == [step.do for step in story.people[0].steps]


def test_steps_repeat_and_events_are_in_order() -> None:
    steps = '[[person.step]]\ndo = "wait"\ntime = 2.0\nevent = "tick"'
    story = parse_story(person(steps, "start = [2.0, 0.0]\nrepeat = 4"))
    assert [time for time, _, _ in story.events] == [2.0, 4.0, 6.0, 8.0]
    assert story.duration == 8.0


def test_people_stand_in_the_scene_where_their_poses_are(story: Story) -> None:
    scene = build_scene(qpsafe.load_robot("irb140"), people=story.persons)
    data = scene.make_data()
    assert len(scene.person_geoms) == 34
    assert len(scene.board_geoms) == 1
    for t in (0.0, 3.0, 9.0):
        poses = story.poses(t)
        scene.place_people(data, poses)
        segments = [s for actor in story.people for s in actor.person.body.segments]
        for geom, segment, ends in zip(
            scene.person_geoms, segments, np.concatenate([p.ends for p in poses]), strict=True
        ):
            half = segment.length / 2 * data.geom_xmat[geom].reshape(3, 3)[:, 2]
            middle = data.geom_xpos[geom]
            assert scene.model.geom_size[geom, 0] == segment.radius
            assert middle - half == pytest.approx(ends[0], abs=2e-3)
            assert middle + half == pytest.approx(ends[1], abs=2e-3)
        assert data.geom_xpos[scene.board_geom] == pytest.approx(poses[1].board_position, abs=1e-12)
        assert np.isfinite(TrueDistances(scene).board(data).distance)
    scene = build_scene(qpsafe.load_robot("irb140"), people=story.persons[:1])
    data = scene.make_data()
    assert scene.board_geom == -1
    scene.place_people(data, story.poses(3.0)[:1])
    board, person = TrueDistances(scene).measure(data)
    assert board.distance == np.inf
    assert np.isfinite(person.distance)


@pytest.mark.parametrize("height", [height for heights in HEIGHTS.values() for height in heights])
def test_people_are_as_tall_as_they_should_be(height: float) -> None:
    """Crown, shoulders, hips and arms of Winter's figure 4.1, in shares of the body height."""
    pose = Person(0.0, None, Body.of_height(height)).pose(0.0, 0.0, 0.0)
    names = [s.name for s in SEGMENTS]
    radii = np.array([s.radius for s in Body.of_height(height).segments])
    assert (pose.ends[:, :, 2].max(axis=1) + radii).max() == pytest.approx(height, rel=0.01)
    assert pose.ends[names.index("left_upper_arm"), 1, 2] == pytest.approx(0.818 * height, rel=0.02)
    assert pose.ends[names.index("left_thigh"), 1, 2] == pytest.approx(0.530 * height, rel=0.025)  # knees a little bent
    body = Body.of_height(height)
    finger = 0.033 * body.scale
    assert body.upper_arm + body.forearm + body.hand + finger == pytest.approx(0.44 * height, abs=1e-12)


STEP = "[[person.step]]\n"
WALK = STEP + 'do = "walk"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[person]\n", r":1: file"),
        ('[[person]]\nname = "A"\n', r":1: person\[0\]\.start = 'nothing'"),
        (person(STEP + 'do = "fly"\n'), r":6: person\[0\]\.step\[0\]\.do = 'fly'"),
        (person(WALK + "to = [1.0, 0.0]\nspeed = 2.6\n"), r":8: person\[0\]\.step\[0\]\.speed = 2\.6"),
        (person(WALK + "to = [1.0, nan]\n"), r":7: person\[0\]\.step\[0\]\.to"),
        (person(WALK + "to = [2.0, 0.0]\n"), r":7: .*at least 0\.05 m"),
        (person(WALK + "to = [1.0, 0.0]\n\n" + STEP + 'do = "wait"\n'), r":9: .*either time, or until"),
        (person(STEP + 'do = "carry"\n'), r":5: .*a board that has been put down"),
        (person(STEP + 'do = "put_down"\n'), r":5: .*a board in both hands"),
        (
            person(STEP + 'do = "reach"\nto = [1.4, 0.0, 0.5]\n' + WALK + "to = [1.0, 0.0]\n"),
            r":8: .*to retract before",
        ),
        (person("") + person(""), r":6: person\[1\]\.name = 'A': expected another name"),
        (person("", "start = [0.0, 0.0]\nheight = 2.5"), r":4: person\[0\]\.height = 2\.5"),
        (person("", "start = [0.0, 0.0]\nheigth = 1.5"), r":4: person\[0\]\.heigth"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text: str, message: str) -> None:
    with pytest.raises(StoryError, match=r"bad\.toml" + message):
        parse_story(text, "bad.toml")


def test_a_missing_file_is_named(tmp_path) -> None:
    with pytest.raises(StoryError, match=r"nowhere\.toml: file"):
        load_story(tmp_path / "nowhere.toml")
