"""The wrapper of pyrealsense2, with a camera made up: what it asks for, and what it makes of frames."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.ranging.adapters.realsense import RealSense


class Frames:
    """What `poll_for_frames` gives: nothing, or a depth frame."""

    def __init__(self, depth) -> None:
        self.depth = depth

    def __bool__(self) -> bool:
        return self.depth is not None

    def get_depth_frame(self):
        return None if self.depth is None else SimpleNamespace(get_data=lambda: self.depth)


def camera_made_up(monkeypatch, queue, coeffs=(0.0,) * 5):
    calls = []
    seen = SimpleNamespace(fx=6.0, fy=6.5, ppx=3.5, ppy=2.5, width=8, height=6, coeffs=list(coeffs))
    stream = SimpleNamespace(as_video_stream_profile=lambda: SimpleNamespace(get_intrinsics=lambda: seen))
    device = SimpleNamespace(first_depth_sensor=lambda: SimpleNamespace(get_depth_scale=lambda: 0.0005))
    profile = SimpleNamespace(get_stream=lambda kind: stream, get_device=lambda: device)
    pipeline = SimpleNamespace(
        start=lambda config: profile,
        stop=lambda: calls.append("stop"),
        poll_for_frames=lambda: Frames(queue.pop(0) if queue else None),
    )
    config = SimpleNamespace(enable_stream=lambda *asked: calls.append(asked))
    module = SimpleNamespace(
        pipeline=lambda: pipeline,
        config=lambda: config,
        stream=SimpleNamespace(depth="depth"),
        format=SimpleNamespace(z16="z16"),
    )
    monkeypatch.setitem(sys.modules, "pyrealsense2", module)
    return calls


def test_frames_that_came_are_images_of_the_cameras_own_intrinsics(monkeypatch) -> None:
    queue = [np.full((6, 8), 2000, np.uint16), np.zeros((6, 8), np.uint16)]
    calls = camera_made_up(monkeypatch, queue)
    with RealSense("wall", (6, 8), 15, latency=0.04, clock=lambda: 10.0, range_max=3.0) as camera:
        assert calls == [("depth", 8, 6, "z16", 15)]
        one, other = camera.images()
        assert camera.images() == []
    assert calls[-1] == "stop"
    assert camera.sensor.period == pytest.approx(1 / 15)
    points = np.asarray(one.distances)[:, None] * camera.sensor.directions
    assert points[:, 2] == pytest.approx(1.0)
    assert points[0, :2] == pytest.approx([-3.5 / 6.0, -2.5 / 6.5])
    assert one.stamp == pytest.approx(9.96)
    assert not np.asarray(other.valid).any()


def test_a_distorted_camera_is_refused_and_stopped(monkeypatch) -> None:
    calls = camera_made_up(monkeypatch, [], (0.1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ConfigurationError, match="distortion"):
        RealSense("wall", (6, 8))
    assert calls[-1] == "stop"


def test_without_the_extra_it_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(MissingExtraError, match=r"qpsafe\[realsense\]"):
        RealSense("wall")
