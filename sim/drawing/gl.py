"""Whether pictures can be rendered without a display, and with which OpenGL back end."""

from __future__ import annotations

import functools
import importlib
import os
import subprocess
import sys
from typing import Any

#: Back ends of MuJoCo that need no window, in the order they are tried.
BACKENDS: tuple[str, ...] = ("egl", "osmesa") if sys.platform.startswith("linux") else ("cgl", "glfw")

_PROBE = """
import importlib, sys
import mujoco
context = importlib.import_module("mujoco." + sys.argv[1]).GLContext(64, 64)
context.make_current()
model = mujoco.MjModel.from_xml_string(
    "<mujoco><visual><global offwidth='64' offheight='64'/></visual><worldbody><light pos='0 0 3'/>"
    "<geom type='sphere' size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
import numpy as np
scene, camera = mujoco.MjvScene(model, 10), mujoco.MjvCamera()
mujoco.mjv_defaultFreeCamera(model, camera)
render = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, render)
mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
rect, pixels = mujoco.MjrRect(0, 0, 64, 64), np.zeros((64, 64, 3), np.uint8)
mujoco.mjr_render(rect, scene, render)
mujoco.mjr_readPixels(pixels, None, rect, render)
sys.exit(0 if pixels.max() > 0 else "rendered a black picture")
"""


@functools.lru_cache(maxsize=1)
def gl_available() -> tuple[bool, str]:
    """Try the OpenGL back ends, each in a process of its own: a failed start can spoil the process it happens in.

    Only the back end that the environment variable MUJOCO_GL names is tried if it is set; with "disable" none.

    Returns:
        True and the back end's name, or False and why there is none.
    """
    chosen = os.environ.get("MUJOCO_GL", "").lower().strip()
    if chosen in ("disable", "disabled", "off", "false", "0"):
        return False, f"OpenGL is switched off by MUJOCO_GL={chosen}"
    known = (*BACKENDS, "glfw")
    if chosen in known:
        backends: tuple[str, ...] = (chosen,)
    elif chosen in ("", "enable", "enabled", "on", "true", "1"):
        backends = BACKENDS
    else:
        return False, f"MUJOCO_GL={chosen} is none of {', '.join(dict.fromkeys(known))}"
    reasons = []
    for backend in backends:
        failure = _probe(backend)
        if failure is None:
            return True, backend
        reasons.append(f"{backend}: {failure}")
    return False, "no OpenGL back end works (" + "; ".join(reasons) + ")"


def _probe(backend: str) -> str | None:
    """Why a back end does not work, None if it does."""
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE, backend], env=environment, capture_output=True, text=True, timeout=60
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{type(error).__name__}"
    if done.returncode == 0:
        return None
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    # mujoco reports failures of its clean-up after the one that matters
    errors = [line for line in lines if "Error" in line and not line.startswith(("Exception ignored", "File"))]
    return (errors or lines or [f"exit code {done.returncode}"])[0][:160]


def make_context(width: int, height: int) -> Any:
    """An OpenGL context for off-screen rendering, current in this thread; free it with `.free()`.

    Raises:
        RuntimeError: There is no back end; the message says why. Ask `gl_available` first.
    """
    available, backend = gl_available()
    if not available:
        raise RuntimeError(backend)
    context = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
    context.make_current()
    return context


if __name__ == "__main__":  # for MUJOCO_GL, which MuJoCo's own renderer reads
    works, word = gl_available()
    print(word) if works else sys.exit(word)
