"""A page beside a loop is read-only: whatever a browser sends, the loop does the same, bit by bit."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import qpsafe
from qpsafe.sim.web.frame import EVERY
from qpsafe.sim.web.watch import Watch

ROBOT = qpsafe.load_robot("irb140")
TICKS = 60 * EVERY


def run(watch: Watch | None, between: Any = lambda k: None) -> list[bytes]:
    """References of a loop with somebody near, beside a page or not."""
    here = qpsafe.FixedPose(ROBOT.pose("tcp", ROBOT.home))
    controller = qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("tcp", here)])
    q, qd, sent = ROBOT.home, np.zeros(6), []
    for k in range(TICKS):
        hand = here.pose[:3, 3] + (0.5 - 0.3 * k / TICKS, 0.0, 0.0)
        tick = controller.step(q, qd, points=[hand])
        if watch is not None:
            watch.observe(tick, q, "running", 1e-3)
        between(k)
        q, qd = tick.reference.q, tick.reference.qd
        sent.append(q.tobytes() + qd.tobytes())
    return sent


@pytest.fixture(scope="module")
def watch() -> Iterator[Watch]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    watch = Watch("irb140", None, "127.0.0.1", port)
    assert watch.wait()
    yield watch
    watch.close()


def hostile(rng: np.random.Generator) -> bytes:
    """Something that a browser could send: noise, or a message that viser understands."""
    if rng.random() < 0.3:
        return rng.bytes(int(rng.integers(1, 200)))
    kinds = [
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1e9}},
        {"type": "TransformControlsUpdateMessage", "name": "/cell", "wxyz": (1, 0, 0, 0), "position": (9, 9, 9)},
        {"type": "RunJavascriptMessage", "source": "1"},
        {"type": "ShareUrlRequest"},
    ]
    return msgspec.msgpack.encode(kinds[int(rng.integers(len(kinds)))])


def test_what_a_browser_sends_changes_no_bit_of_the_loop(watch: Watch) -> None:
    rng, sockets, sent = np.random.default_rng(5), list[Any](), 0

    def bother(k: int) -> None:
        nonlocal sent
        if k % 60 == 0:  # the page closes the door after the first noise
            address, own = f"ws://127.0.0.1:{watch.port}", f"viser-v{viser.__version__}"
            sockets.append(connect(address, subprotocols=[own], max_size=None, close_timeout=0.05))
        with suppress(ConnectionClosed):
            sockets[-1].send(hostile(rng))
            sent += 1

    assert run(watch, bother) == run(None)
    for one in sockets:
        one.close()
    assert sent > len(sockets) == TICKS // 60


def test_the_loop_has_no_end_of_anything_that_the_page_can_write(watch: Watch) -> None:
    writing = watch.outbound.fileno()
    with pytest.raises(OSError):
        os.read(writing, 1)
    if not Path("/proc/self/fd").is_dir():
        pytest.skip("descriptors of another process can be looked at on Linux only")
    pipe = os.readlink(f"/proc/self/fd/{writing}")
    modes = []
    for link in Path(f"/proc/{watch.number}/fd").iterdir():
        if os.readlink(link) == pipe:
            flags = Path(f"/proc/{watch.number}/fdinfo/{link.name}").read_text().split("flags:")[1].split()[0]
            modes.append(int(flags, 8) & os.O_ACCMODE)
    assert modes == [os.O_RDONLY]


def test_a_page_that_is_killed_is_no_trouble() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    watch = Watch("irb140", None, "127.0.0.1", port)
    watch._process.kill()
    watch._process.join()
    assert not watch.wait(1.0)
    assert run(watch) == run(None)
    watch.close()
