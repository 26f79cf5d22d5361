"""Off-screen pictures of a scene, and an mp4 of them."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.extras import require
from qpsafe.sim.drawing.caption import Caption, CaptionStrip
from qpsafe.sim.drawing.gl import gl_available, make_context
from qpsafe.sim.drawing.overlay import DangerOverlay
from qpsafe.sim.world.robot_spec import shown_groups
from qpsafe.sim.world.scene import CAMERA, Scene

__all__ = ["Camera", "VideoWriter", "gl_available"]

Frame = NDArray[np.uint8]


class Camera:
    """Renders a scene off screen. It owns an OpenGL context: use it in one thread, and close it."""

    def __init__(self, scene: Scene, size: tuple[int, int] = (960, 540), *, camera: str = CAMERA) -> None:
        """Open a context of a size (width, height) [px].

        Args:
            scene: What is rendered.
            size: (width, height) [px].
            camera: Name of the camera.

        Raises:
            ConfigurationError: The size is odd or too large, or the scene has no such camera.
            RuntimeError: No OpenGL back end works.
        """
        width, height = size
        view = scene.model.vis.global_
        if not (0 < width <= view.offwidth and 0 < height <= view.offheight and width % 2 == height % 2 == 0):
            expected = f"even numbers up to {view.offwidth} x {view.offheight} px"
            raise ConfigurationError("Camera", "size", size, expected)
        index = mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if index < 0:
            names = ", ".join(scene.model.camera(i).name for i in range(scene.model.ncam))
            raise ConfigurationError("Camera", "camera", camera, f"one of {names}")
        self.size = (width, height)
        self._model = scene.model
        self._gl: Any = make_context(width, height)
        self._render = mujoco.MjrContext(scene.model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._render)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._drawing = mujoco.MjvScene(scene.model, maxgeom=1000)
        self._drawing.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # a software renderer spends its time on them
        self._drawing.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._options = mujoco.MjvOption()
        self._options.geomgroup[:] = shown_groups(scene.model)
        self._view = mujoco.MjvCamera()
        self._view.type, self._view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, index

    def picture(self, data: Any, overlay: DangerOverlay | None = None) -> Frame:
        """Render the present state, (height, width, 3) RGB."""
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mj_camlight(self._model, data)
        mujoco.mjv_updateScene(self._model, data, self._options, None, self._view, everything, self._drawing)
        if overlay is not None:
            overlay.draw(self._drawing)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._drawing, self._render)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._render)
        return pixels[::-1]  # OpenGL counts rows from below

    def close(self) -> None:
        """Free the context; the camera is of no use afterwards."""
        if self._gl is not None:
            self._gl.make_current()
            self._render.free()
            self._gl.free()
            self._gl = None


class VideoWriter:
    """Writes an mp4 of a scene; a context manager.

    The file appears under its name only when it is complete: an error or Ctrl-C in the `with` block leaves nothing.

        with VideoWriter("run.mp4", scene) as video:
            video.add(plant.data, overlay, caption)
    """

    def __init__(self, path: str | Path, scene: Scene, *, fps: int = 25, size: tuple[int, int] = (960, 540)) -> None:
        """Prepare; nothing is written before the `with` block.

        Args:
            path: Ends in .mp4; its folder is made if need be.
            scene: What to show.
            fps: Frames a second of the video; how often to call `add` is the caller's to decide.
            size: Width and height, even [px].

        Raises:
            ConfigurationError: A value is wrong.
            MissingExtraError: The extra "video" is not installed.
        """
        self.path = Path(path)
        if self.path.suffix.lower() != ".mp4":
            raise ConfigurationError("VideoWriter", "path", str(path), "a name that ends in .mp4")
        if not 1 <= fps <= 120:
            raise ConfigurationError("VideoWriter", "fps", fps, "1 to 120 frames a second")
        # imageio would find ffmpeg by itself, but say late and unclearly that it cannot
        require("video", "a video", "imageio.v2", "imageio_ffmpeg")
        import imageio.v2 as imageio

        self._open_file = imageio.get_writer
        self._strip = CaptionStrip(size[0])
        self.scene, self.fps, self.size = scene, fps, size
        self.frames = 0
        self._partial = self.path.with_name(f".{self.path.stem}.{os.getpid()}.partial.mp4")
        self._camera: Camera | None = None
        self._file: Any = None

    def __enter__(self) -> VideoWriter:
        self._camera = Camera(self.scene, self.size)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._open_file(
                self._partial,
                format="FFMPEG",
                mode="I",
                fps=self.fps,
                codec="libx264",
                pixelformat="yuv420p",
                quality=None,
                macro_block_size=2,
                output_params=["-preset", "superfast", "-crf", "21", "-threads", "1", "-movflags", "+faststart"],
            )
        except BaseException:
            self._camera.close()
            raise
        return self

    def add(self, data: Any, overlay: DangerOverlay | None = None, caption: Caption | None = None) -> Frame:
        """Append a frame of the present state and return it, (height, width, 3) RGB.

        Args:
            data: MuJoCo's state.
            overlay: What is drawn into the scene.
            caption: What is written below it.
        """
        if self._camera is None or self._file is None:
            raise RuntimeError("VideoWriter.add belongs into its with block")
        frame = np.ascontiguousarray(self._camera.picture(data, overlay))
        if caption is not None:
            strip = self._strip.draw(caption)
            frame[-len(strip) :] = strip
        self._file.append_data(frame)
        self.frames += 1
        return frame

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        complete = False
        try:
            try:
                self._file.close()
            except Exception:
                if kind is None:  # else the first error is the one to hear about
                    raise
            if kind is None and self.frames:
                os.replace(self._partial, self.path)
                complete = True
        finally:
            if not complete:
                self._partial.unlink(missing_ok=True)
            if self._camera is not None:
                self._camera.close()
            self._camera = self._file = None
