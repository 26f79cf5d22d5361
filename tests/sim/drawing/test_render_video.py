import os
import sys

import mujoco
import numpy as np
import pytest
from amounts import first

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.drawing import gl
from qpsafe.sim.drawing.caption import Caption, CaptionStrip
from qpsafe.sim.drawing.overlay import GREEN, RED, YELLOW, DangerOverlay, danger_colour
from qpsafe.sim.drawing.render import Camera, VideoWriter
from qpsafe.sim.people.choreography import Choreography
from qpsafe.sim.world.scene import build_scene

pytestmark = pytest.mark.long

needs_gl = pytest.mark.usefixtures("opengl")


SMALL = (320, 180)


@pytest.fixture(scope="module")
def scene():
    return build_scene(load_robot("irb140"))


def caption(regime="medium", cdf=8.0, **change):
    return Caption(12.3, regime, cdf, (5.6, 9.8), 0.7, 0.4)._replace(**change)


@needs_gl
def test_a_video_has_the_frames_that_were_added(scene, tmp_path):
    import imageio.v2 as imageio

    data, choreography = scene.make_data(), Choreography(person=scene.person)
    target = tmp_path / "new folder" / "run.mp4"
    frames = []
    with VideoWriter(target, scene, size=SMALL) as video:
        for t in (5.0, 6.0, 7.0, 8.0, 9.0):
            scene.place_person(data, choreography.pose(t))
            frames.append(video.add(data, caption=caption(time=t)))
            assert not target.exists()  # not before it is complete
    assert [p.name for p in target.parent.iterdir()] == ["run.mp4"]
    with imageio.get_reader(target) as reader:
        read = [np.asarray(frame) for frame in reader]
        assert reader.get_meta_data()["fps"] == 25
    assert len(read) == 5
    for frame, back in zip(frames, read, strict=True):
        assert back.shape == frame.shape == (SMALL[1], SMALL[0], 3)
        assert np.abs(frame.astype(float) - back).mean() < 6.0  # compressed, but the same picture
    assert np.abs(frames[0].astype(float) - frames[-1]).mean() > 0.5


@needs_gl
@pytest.mark.parametrize("interruption", first(1, [KeyboardInterrupt, ValueError]))
def test_an_interrupted_video_leaves_nothing_and_keeps_what_was_there(scene, tmp_path, interruption):
    target = tmp_path / "run.mp4"
    target.write_bytes(b"an older video")
    data = scene.make_data()

    def film():
        with VideoWriter(target, scene, size=SMALL) as video:
            video.add(data)
            raise interruption

    with pytest.raises(interruption):
        film()
    assert [p.name for p in tmp_path.iterdir()] == ["run.mp4"]
    assert target.read_bytes() == b"an older video"


@needs_gl
def test_the_danger_is_drawn_where_it_is(scene):
    """A red ball in the air changes the picture around its place and nowhere else."""
    data = scene.make_data()
    camera = Camera(scene, SMALL)
    try:
        place = np.array([0.5, -0.1, 0.9])
        plain = camera.picture(data).astype(int)
        drawn = camera.picture(data, DangerOverlay(place[None], np.array([[0.0, 0.0, 12.0]]))).astype(int)
    finally:
        camera.close()
    lens, frame = data.cam_xpos[0], data.cam_xmat[0].reshape(3, 3)
    x, y, z = frame.T @ (place - lens)
    focal = SMALL[1] / 2 / np.tan(np.radians(scene.model.cam_fovy[0]) / 2)
    column, row = SMALL[0] / 2 - focal * x / z, SMALL[1] / 2 + focal * y / z
    changed = np.argwhere(np.abs(plain - drawn).sum(axis=2) > 60)
    assert len(changed) > 10
    assert np.abs(changed[:, 1] - column).max() < 15
    assert changed[:, 0].max() < row + 6  # the ball, and from it the arrow upwards: 12 times the arrow's scale
    rise = focal * 12.0 * DangerOverlay().arrow_scale * frame[2, 1] / -z
    assert changed[:, 0].min() == pytest.approx(row - rise, abs=4.0)
    red = drawn[round(row), round(column)]
    assert red[0] > 2 * max(red[1], red[2])


@needs_gl
@pytest.mark.parametrize("index", first(1, [0, 1, 2]))
def test_the_person_is_in_the_picture_from_every_direction(scene, index):
    data, choreography = scene.make_data(), Choreography(person=scene.person)
    camera = Camera(scene, SMALL)
    try:
        empty = camera.picture(data).astype(int)
        pauses = [p for p in choreography.phases if p.approach == index and p.name == "close"]
        scene.place_person(data, choreography.pose(pauses[0].start))
        there = camera.picture(data).astype(int)
    finally:
        camera.close()
    changed = np.argwhere(np.abs(empty - there).sum(axis=2) > 40)
    assert len(changed) > 0.02 * SMALL[0] * SMALL[1]
    assert changed.min(axis=0).min() > 2  # nothing of the person is cut off
    assert changed[:, 0].max() < SMALL[1] - 3
    assert changed[:, 1].max() < SMALL[0] - 3


@pytest.mark.parametrize(
    ("change", "key"), [({"path": "run.avi"}, "path"), ({"fps": 0}, "fps"), ({"fps": 1000}, "fps")]
)
def test_a_wrong_video_names_what_is_wrong(scene, change, key):
    with pytest.raises(ConfigurationError) as error:
        VideoWriter(**{"path": "run.mp4", "scene": scene, **change})
    assert error.value.key == key


def test_sizes_and_cameras_are_checked_before_a_context_is_opened(scene):
    for size in ((321, 180), (0, 0), (100000, 2)):
        with pytest.raises(ConfigurationError, match="size"):
            Camera(scene, size)
    with pytest.raises(ConfigurationError, match="overview"):
        Camera(scene, SMALL, camera="nowhere")


@pytest.mark.parametrize("module", ["imageio.v2", "imageio_ffmpeg"])
def test_without_the_extra_the_error_names_it(scene, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"qpsafe\[video\]"):
        VideoWriter("run.mp4", scene)


def test_overlay_draws_what_is_finite_and_never_overflows():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    points = np.array([[0.0, 0.0, 1.0], [np.nan, 0.0, 0.0]])
    vectors = np.array([[0.0, 0.0, -5.0], [0.0, 1.0, 0.0]])
    starts, ends = np.zeros((3, 3)), np.array([[1.0, 0, 0], [0, np.inf, 0], [0, 0, 1.0]])
    overlay = DangerOverlay(points, vectors, starts, ends, np.array([True, True, False]))
    roomy, tight = mujoco.MjvScene(model, maxgeom=50), mujoco.MjvScene(model, maxgeom=3)
    overlay.draw(roomy)
    assert roomy.ngeom == 4  # two rays, a ball and its arrow
    overlay.draw(tight)
    assert tight.ngeom == 3
    arrow = roomy.geoms[3]
    assert np.asarray(arrow.mat).reshape(3, 3)[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    assert np.asarray(arrow.pos) == pytest.approx(points[0], abs=1e-6)


def test_colours_run_from_green_over_yellow_to_red():
    assert danger_colour(0.0, 5.0, 10.0) == pytest.approx(GREEN)
    assert danger_colour(5.0, 5.0, 10.0) == pytest.approx(YELLOW)
    assert danger_colour(10.0, 5.0, 10.0) == pytest.approx(RED)
    assert danger_colour(99.0, 5.0, 10.0) == pytest.approx(RED)
    grey = danger_colour(float("nan"), 5.0, 10.0)
    assert np.ptp(grey) == 0.0


def test_captions_change_with_what_they_say_and_survive_bad_numbers():
    strip = CaptionStrip(960)
    plain = strip.draw(caption())
    assert plain.shape == (strip.height, 960, 3)
    assert strip.height % 2 == 0
    for other in (
        caption(regime="high"),
        caption(cdf=12.0),
        caption(m=0.1),
        caption(f=0.9),
        caption(time=1.0),
        caption(note="x"),
    ):
        assert (strip.draw(other) != plain).any()
    nan = float("nan")
    assert strip.draw(Caption(nan, "?", nan, (5.6, 9.8), nan, nan)).shape == plain.shape
    # the bar grows with the danger
    lit = [(strip.draw(caption(regime="high", cdf=c)).max(axis=2) > 150).sum() for c in (9.9, 12.0, 15.0)]
    assert lit[0] < lit[1] < lit[2]


@pytest.mark.parametrize("value", ["disable", "off", "0", "nonsense"])
def test_the_environment_can_refuse_opengl(monkeypatch, value):
    monkeypatch.setenv("MUJOCO_GL", value)
    available, why = gl.gl_available.__wrapped__()
    assert not available
    assert value in why


def test_back_ends_are_tried_in_turn_and_a_failure_says_why(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "BACKENDS", ("first", "second"))
    monkeypatch.setattr(gl, "_probe", lambda backend: None if backend == "second" else "no driver")
    assert gl.gl_available.__wrapped__() == (True, "second")
    monkeypatch.setattr(gl, "_probe", lambda backend: "no driver")
    available, why = gl.gl_available.__wrapped__()
    assert not available
    assert "first: no driver" in why
    assert "second: no driver" in why


def test_a_probe_of_no_back_end_fails_in_its_own_process():
    before = dict(os.environ)
    assert gl._probe("nonsense") is not None
    assert dict(os.environ) == before
