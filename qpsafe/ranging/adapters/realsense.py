"""Depth frames of a RealSense camera as images, by `pyrealsense2` (extra `realsense`)."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.ranging.adapters.depth_camera import DepthCamera
from qpsafe.ranging.sensor import RangeImage, RangeSensor


class RealSense:
    """An open camera.

    Args:
        name: Of its own.
        shape: Rows and columns.
        rate: Images a second.
        latency: From the middle of the exposure until an image is here [s].
        clock: Of the stamps, and of `SafetyController.step(now=...)` [s].
        sigma_1m: See `DepthCamera`.
        parts: Attributes of the `RangeSensor`: `mount`, `pose`, `range_max` and others.

    Attributes:
        sensor: What it is: its zones as the camera's own intrinsics have them.

    Raises:
        MissingExtraError: `pyrealsense2` is not installed.
        ConfigurationError: The camera's depth is distorted, or a part is wrong.
    """

    def __init__(
        self,
        name: str,
        shape: tuple[int, int] = (480, 640),
        rate: int = 30,
        *,
        latency: float = 0.05,
        clock: Callable[[], float] = time.monotonic,
        sigma_1m: float | None = None,
        **parts: object,
    ) -> None:
        require("realsense", "RealSense", "pyrealsense2")
        import pyrealsense2 as rs

        self._clock, self._latency = clock, latency
        self._pipeline, config = rs.pipeline(), rs.config()
        config.enable_stream(rs.stream.depth, shape[1], shape[0], rs.format.z16, rate)
        profile = self._pipeline.start(config)
        try:
            found = profile.get_stream(rs.stream.depth).as_video_stream_profile().get_intrinsics()
            if np.any(np.asarray(found.coeffs)):
                expected = "none: depth of a rectified camera"
                raise ConfigurationError(f"RealSense {name!r}", "distortion", list(found.coeffs), expected)
            intrinsics = (found.fx, found.fy, found.ppx, found.ppy)
            figures = {"range_min": 0.1, "range_max": 4.0, "period": 1.0 / rate, **parts}
            self.sensor = RangeSensor.camera(name, (found.height, found.width), intrinsics, **figures)
            scale = profile.get_device().first_depth_sensor().get_depth_scale()
            self._frames = DepthCamera(self.sensor, scale, sigma_1m)
        except BaseException:
            self._pipeline.stop()
            raise

    def images(self) -> list[RangeImage]:
        """Those that came since the last call; it does not wait. For `SafetyController.step(images=...)`."""
        found: list[RangeImage] = []
        while True:
            came: Any = self._pipeline.poll_for_frames()
            frame = came.get_depth_frame() if came else None
            if not frame:
                return found
            depth = np.array(frame.get_data())  # the frame's memory is the camera's
            found.append(self._frames.image(depth, stamp=self._clock() - self._latency))

    def close(self) -> None:
        """Stop the camera."""
        self._pipeline.stop()

    def __enter__(self) -> RealSense:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()
