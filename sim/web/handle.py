"""Who is dragged with the mouse: handles in the scene, and what they ask for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.sim.web.people import AWAY, HAND, PERSON, QUICKEST, WIDEST, Drag

if TYPE_CHECKING:
    from qpsafe.sim.web.controls import Wishes

BOARD = "person with a card board"
WHO = (PERSON, HAND, BOARD, AWAY)
SIZE = {PERSON: 0.45, HAND: 0.25}
FIRST = {PERSON: (1.6, 0.5, 0.0), HAND: (0.9, 0.25, 0.4)}  # where a handle appears [m]


class Handle:
    """Arrows to drag somebody by.

    Args:
        server: Viser's.
        wishes: What they change.
    """

    def __init__(self, server: Any, wishes: Wishes) -> None:
        self._server, self._wishes = server, wishes
        who = server.gui.add_dropdown("drag with the mouse", WHO)
        who.on_update(lambda event: self._choose(event.target.value))
        self._speed = server.gui.add_slider("at most [m/s]", 0.1, QUICKEST, 0.1, 2.0)
        self._speed.on_update(lambda event: self._drag(speed=float(event.target.value)))
        self._choose(PERSON)

    def _choose(self, who: str) -> None:
        mode = PERSON if who == BOARD else who
        self._server.scene.remove_by_name("/drag")
        place = FIRST.get(mode, FIRST[PERSON])
        if mode != AWAY:
            level = mode == PERSON  # feet stay on the floor
            arrows = self._server.scene.add_transform_controls(
                "/drag", SIZE[mode], position=place, disable_rotations=True, depth_test=False, line_width=3.0,
                active_axes=(True, True, not level), translation_limits=((-WIDEST, WIDEST),) * 3,
            )  # fmt: skip

            async def dragged(event: Any) -> None:  # in its order, and at once
                self._drag(place=tuple(np.clip(event.target.position, -WIDEST, WIDEST).tolist()))

            arrows.on_update(dragged)
        self._wishes.change(drag=Drag(mode, place, float(self._speed.value)), board=who == BOARD)

    def _drag(self, **fields: Any) -> None:
        self._wishes.change(drag=self._wishes.now.drag._replace(**fields))
