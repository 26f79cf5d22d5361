"""What the controller sees and its danger, on a page: rays, points, danger vectors, links in danger's colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.drawing.film import overlay
from qpsafe.sim.drawing.overlay import DangerOverlay, danger_colour
from qpsafe.sim.engine.world import owners_of

if TYPE_CHECKING:
    from qpsafe.sensing.skin.spots import SpotArray
    from qpsafe.sim.web.bodies import Bodies
    from qpsafe.sim.world.scene import Scene
    from qpsafe.tick import Tick

Array = NDArray[np.float64]

HIT, FREE = np.array([205, 30, 50]), np.array([90, 140, 190])  # rays
LONGEST = 0.6  # of an arrow [m]
SHARE = 0.8  # of the danger's colour in a link's at most


class _Here(NamedTuple):
    """Of a plant what an overlay needs."""

    scene: Scene
    q: Array


def link_danger(tick: Tick, links: int) -> Array:
    """The largest danger at the points of each link of the wire (links,): |CDF vector|, 0 for a link that sees nothing.

    Args:
        tick: The tick.
        links: How many there are.
    """
    found = np.zeros(links)
    np.maximum.at(found, tick.links, np.sqrt((tick.vectors * tick.vectors).sum(axis=1)))  # |(6)| = CDF
    return found


class Danger:
    """Draws ticks.

    Args:
        server: Viser's.
        scene: The scene.
        spots: The distance sensors; None without.
        bodies: Of the scene.
        thresholds: From where danger is medium, and high.
    """

    def __init__(
        self, server: Any, scene: Scene, spots: SpotArray | None, bodies: Bodies, thresholds: tuple[float, float]
    ) -> None:
        self._server, self._scene, self._spots, self._bodies = server, scene, spots, bodies
        self.thresholds = thresholds
        self.rays, self.points, self.vectors, self.colours = True, True, True, True
        self._links = _links_of_bodies(scene)
        one, grey = np.zeros((1, 2, 3)), np.zeros((1, 3), np.uint8)  # hidden: nothing at all cannot be drawn
        self._rays = server.scene.add_line_segments(
            "/danger/rays", one, np.zeros((1, 2, 3), np.uint8), thickness=1.5, thickness_units="screen", visible=False
        )
        self._vectors = server.scene.add_arrows(
            "/danger/vectors", one, grey, shaft_radius=0.008, head_radius=0.022, head_length=0.05, visible=False
        )
        self._points = server.scene.add_point_cloud(
            "/danger/points", one[:, 0], grey, point_size=0.035, point_shape="circle", precision="float32",
            point_shading="flat", visible=False,
        )  # fmt: skip

    def show(self, tick: Tick, q: Array) -> None:
        """Draw a tick.

        Args:
            tick: The tick.
            q: Where the robot was (n,) [rad].
        """
        drawn = DangerOverlay(tick.points, tick.vectors, thresholds=self.thresholds)
        if self._spots is not None:
            drawn = overlay(tick, _Here(self._scene, q), self._spots, self.thresholds)  # type: ignore[arg-type]
        self._show_rays(drawn)
        good = np.isfinite(drawn.points).all(axis=1) & np.isfinite(drawn.vectors).all(axis=1)
        points, vectors = drawn.points[good], drawn.vectors[good]
        sizes = np.linalg.norm(vectors, axis=1)
        colours = np.array([danger_colour(size, *self.thresholds) for size in sizes]).reshape(-1, 3)
        colours = np.round(255.0 * colours).astype(np.uint8)
        _draw(self._points, self.points, points.astype(np.float32), colours)
        lengths = np.minimum(2.0 * drawn.arrow_scale * sizes, LONGEST)
        tips = points + vectors / np.maximum(sizes, 1e-12)[:, None] * lengths[:, None]
        long = lengths > 1e-3
        _draw(self._vectors, self.vectors, np.stack((points, tips), axis=1)[long], colours[long])
        self._colour(link_danger(tick, len(self._scene.robot.wire_frames)))

    def _show_rays(self, drawn: DangerOverlay) -> None:
        hits = np.zeros(len(drawn.ray_starts), bool) if drawn.ray_hits is None else drawn.ray_hits
        ends = np.stack((drawn.ray_starts, drawn.ray_ends), axis=1)
        colours = np.where(hits[:, None], HIT, FREE).astype(np.uint8)
        _draw(self._rays, self.rays, ends, np.repeat(colours[:, None], 2, axis=1))

    def _colour(self, dangers: Array) -> None:
        """Links in danger's colours; the robot's own ones are taken out of it then, since a robot may be orange."""
        medium, high = self.thresholds
        for body, meshes in self._bodies.coloured.items():
            danger = max((float(dangers[link]) for link in self._links.get(body, [])), default=0.0)
            share = SHARE * min(danger / medium, 1.0)
            wanted = 255.0 * danger_colour(danger, medium, high)
            for mesh, own in meshes:
                mixed = (1.0 - share) * grey(own) + share * wanted if self.colours else np.array(own)
                red, green, blue = np.round(mixed).astype(int).tolist()
                mesh.color = (red, green, blue)


def grey(colour: tuple[int, int, int]) -> Array:
    """A light grey for a colour, darker for a darker one, tinted slightly with the colour (3,)."""
    luma = float(np.dot((0.30, 0.59, 0.11), colour)) / 255.0
    return 0.12 * np.array(colour) + 0.88 * 235.0 * np.sqrt(luma)


def _draw(handle: Any, wanted: bool, points: Array, colours: NDArray[np.uint8]) -> None:
    """Draw some of a kind; what is not wanted, or none, is hidden."""
    handle.visible = wanted and len(points) > 0
    if handle.visible:
        handle.points, handle.colors = points, colours


def _links_of_bodies(scene: Scene) -> dict[int, list[int]]:
    """Links of the wire that end on each body of the scene's robot, or on the one that it is fixed to."""
    robot = scene.robot
    ends = [robot.mounting(end)[0] for _, end in robot.wire_frames]
    owners, _ = owners_of(scene)
    moving = {body: owner for body, owner in enumerate(owners) if 0 < owner <= robot.nq}
    return {body: [link for link, end in enumerate(ends) if end == owner] for body, owner in moving.items()}
