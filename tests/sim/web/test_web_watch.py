"""A page beside a loop is read-only: whatever a browser sends, the loop does the same, bit by bit."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import qpsafe
from qpsafe.sensing.cell_file import load_cell
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sim.web.bodies import Bodies
from qpsafe.sim.web.frame import EVERY
from qpsafe.sim.web.watch import Watch, scene_of, show_all
from qpsafe.sim.world.furniture import add_obstacles
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.scene import build_scene

pytestmark = pytest.mark.long

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
    watch = Watch("irb140", None, None, "127.0.0.1", port)
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
    watch = Watch("irb140", None, None, "127.0.0.1", port)
    watch._process.kill()
    watch._process.join()
    assert not watch.wait(1.0)
    assert run(watch) == run(None)
    watch.close()


@pytest.mark.parametrize("late", [True, False])
def test_whoever_looks_when_the_last_frame_has_come_sees_all_of_it(late: bool) -> None:
    """A stopped stream may send nothing more: the page shows how it ended, also to who opens it afterwards."""
    came, shown, asked = [[1, 2], [3], [], [], []], list[tuple[int, bool]](), list[bool]()

    class Came:
        @property
        def closed(self) -> bool:
            return not came

        def received(self, patience: float) -> list[int]:
            return came.pop(0)

    class Page:
        @property
        def watched(self) -> bool:
            asked.append(True)
            return not late or len(asked) > 3

    taken: list[int] = []
    view = SimpleNamespace(take=taken.append, show=lambda frame, at_once: shown.append((frame, at_once)))
    show_all(Came(), view, Page())  # type: ignore[arg-type]
    assert taken == [1, 2, 3]
    assert shown == ([(3, True)] if late else [(2, False), (3, False), (3, True)])


class Drawing:
    """A server's scene that keeps the vertices of its meshes."""

    def __init__(self) -> None:
        self.scene, self.vertices = self, list[Any]()

    def add_mesh_simple(self, _: str, vertices: Any, *__: Any, **___: Any) -> None:
        self.vertices.append(vertices)

    def add_frame(self, *_: Any, **__: Any) -> Any:
        return SimpleNamespace()

    def add_grid(self, *_: Any, **__: Any) -> None: ...


def test_furniture_of_the_cells_file_is_drawn_where_it_stands(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(
        '[[box]]\nname = "table"\nsize = [0.8, 1.2, 0.05]\ncentre = [0.9, 0.1, 0.1]\n'
        '[[hull]]\nname = "ramp"\nvertices = [[1, 0, 0], [1, 0.4, 0], [1.4, 0, 0], [1.4, 0.4, 0.3]]\n'
    )
    known, drawing = load_cell(file), Drawing()
    Bodies(drawing, scene_of("irb140", cell=file))
    drawn = np.vstack(drawing.vertices)
    for obstacle in known:
        apart = np.linalg.norm(drawn[:, None] - obstacle.vertices, axis=2).min(axis=0)
        assert apart.max() < 1e-6, obstacle.name  # MuJoCo keeps single precision
    bare = Drawing()
    Bodies(bare, scene_of("irb140"))
    assert sum(map(len, drawing.vertices)) > sum(map(len, bare.vertices))


def test_what_is_drawn_is_what_is_known() -> None:
    """Obstacles put into a scene come out of it again, beside its floor and pedestal."""
    known = (
        Obstacle.box("table", (0.8, 1.2, 0.05), (0.9, 0.1, 0.1)),
        Obstacle("ramp", np.array([[1, 0, 0], [1, 0.4, 0], [1.4, 0, 0], [1.4, 0.4, 0.3]])),
    )
    found = known_obstacles(build_scene(ROBOT, people=(), furnish=partial(add_obstacles, obstacles=known)))
    here = {obstacle.name: obstacle.vertices for obstacle in found}
    rng = np.random.default_rng(3)
    for k, obstacle in enumerate(known):
        for way in rng.normal(size=(200, 3)):  # convex hulls are equal if they reach equally far everywhere
            assert np.isclose(
                (here[f"cell {k} {obstacle.name}"] @ way).max(), (obstacle.vertices @ way).max(), atol=1e-6
            )
