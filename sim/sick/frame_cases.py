"""Sick images: what is wrong with them, and the reaction that docs/reference/vl53l5cx.md promises for each case.

An image that cannot be used is left out, and said so; what the sensor saw before still counts for as long as its
`max_age`. Then the sensor does not see: it is named, what it saw last is held as a spot's point is, and a little later
it is dead and the robot capped, until acknowledged.
"""

from __future__ import annotations

import numpy as np

from qpsafe.sensing.health import CLEAR, STOPPED
from qpsafe.sim.sick import frames
from qpsafe.sim.sick.cases import BRAKE, WINDOW, Reaction, Window, first_tick
from qpsafe.sim.sick.frames import Spoil, SpoilsFrames

ONE = 17  # ticks in which a sensor of 15 Hz has at least one image
#: Ticks until a sensor does not see: `max_age`, 0.2 s, since its last good image was taken; and until it is dead.
DEAD = 58


class FrameCase:
    """One line of the table; a `qpsafe.sim.sick.cases.Case` for images.

    Args:
        name: What is wrong.
        spoil: What it does to an image.
        promise: The reaction.
        within: Ticks it may take.
        share: Share of the sensors that are sick, 0 for a single one.
        images: How many images of each are spoilt; all by default.

    Attributes:
        lasts: For how many ticks, at most.
    """

    lasts = WINDOW

    def __init__(
        self, name: str, spoil: Spoil, promise: str, within: int, share: float = 0.0, images: float = np.inf
    ) -> None:
        self.name, self.promise, self.within, self.share = name, promise, within, share
        self.spoil, self.images = spoil, images

    def frames(self, names: tuple[str, ...]) -> SpoilsFrames:
        """What spoils the images of the sensors of these names."""
        return SpoilsFrames(names, self.spoil, self.images)

    def reaction(self, window: Window) -> Reaction:
        """Whether and when it came."""
        return REACTIONS[self.promise](window, self)


def _named(window: Window, case: FrameCase) -> Reaction:
    """Named and capped from some tick on, or stopped if no other sensor is left; also after acknowledging it."""
    names = {window.names[i] for i in window.sick}
    last = window.ticks[-1]
    if not (names <= {*last.unseen} and last.severity != CLEAR and window.after != CLEAR):
        return Reaction(None)
    return first_tick(window, lambda record: names <= {*record.unseen} and record.severity != CLEAR)


def _frozen(window: Window, case: FrameCase) -> Reaction:
    """The same, counted from when the sensor has surely moved enough since the image that stays was taken, which may be
    some ticks before the fault; time must be left for it, and the sensor must have something before it.
    """
    moved = [k for k, r in enumerate(window.ticks) if r.moved >= 3.0 * window.rules.stuck_motion]
    blank = not window.before[window.sick[0]] < np.inf
    if blank or not moved or moved[0] + case.within >= len(window.ticks):
        return Reaction(1, applies=False)
    found = _named(window, case)
    return Reaction(None if found.tick is None else max(found.tick - moved[0], 1))


def _kept(window: Window, case: FrameCase) -> Reaction:
    """Nobody is named, nothing is slowed, and what counted goes on counting."""
    good = all(not record.unseen and record.severity == CLEAR for record in window.ticks)
    seen = window.healthy.cdf_n > 0.0
    return Reaction(1 if good and all(r.cdf_n > 0.0 or not seen for r in window.ticks[:ONE]) else None)


def _stopped(window: Window, case: FrameCase) -> Reaction:
    """At rest for good from some tick on, and stopped until acknowledged; if so many of all sensors are sick."""
    if len(window.sick) <= window.rules.dead_share * len(window.names) + 1e-9:
        return Reaction(1, applies=False)
    if window.ticks[-1].severity != STOPPED or window.ticks[-1].status != "bad_input":
        return Reaction(None)
    moving = [k for k, record in enumerate(window.ticks) if np.abs(record.qd).max() > 0.0]
    last = max(moving, default=-1) + 2
    return Reaction(last if last <= len(window.ticks) else None)


def _harmless(window: Window, case: FrameCase) -> Reaction:
    """Who would count does; whether it is noticed depends on what is known before the sensor."""
    pairs = zip(window.ticks, window.run, strict=True)
    return Reaction(1 if all(now.cdf_n > 0.0 or not would.cdf_n > 0.0 for now, would in pairs) else None)


NAMED, FROZEN, KEPT, STOPS, HARMLESS = (
    "left out, then named, capped", "named, capped, once it moved", "what was seen counts on", "controlled stop",
    "counts as it is; named if it sees through known things",
)  # fmt: skip
REACTIONS = {NAMED: _named, FROZEN: _frozen, KEPT: _kept, STOPS: _stopped, HARMLESS: _harmless}

FRAME_CASES: tuple[FrameCase, ...] = (
    FrameCase("one image blind", frames.blind, KEPT, 1, images=1),
    FrameCase("one image missing", frames.silent, KEPT, 1, images=1),
    FrameCase("blind in all zones, for good", frames.blind, NAMED, DEAD),
    FrameCase("not a number in all zones, for good", frames.no_numbers, NAMED, DEAD),
    FrameCase("minus infinity in a zone, for good", frames.negative, NAMED, DEAD),
    FrameCase("silent, for good", frames.silent, NAMED, DEAD),
    FrameCase("stale by 0.5 s, for good", frames.stale, NAMED, DEAD),
    FrameCase("from the future by 0.5 s, for good", frames.ahead, NAMED, DEAD),
    FrameCase("a stamp that is not a number, for good", frames.timeless, NAMED, DEAD),
    FrameCase("the same image again and again", frames.repeated, NAMED, DEAD + ONE + 1),
    FrameCase("frozen, with new stamps", frames.frozen, FROZEN, DEAD + 2 * ONE),
    FrameCase("a row missing, for good", frames.misshapen, NAMED, DEAD),
    FrameCase("other optics than declared, by its driver", frames.other_optics, NAMED, DEAD),
    FrameCase("shifted by one row, for good", frames.shifted, HARMLESS, 1),
    FrameCase("wrong intrinsics: focal length by 1.25", frames.other_lens, HARMLESS, 1),
    FrameCase("a quarter of the sensors blind", frames.blind, STOPS, DEAD + BRAKE, share=0.25),
    FrameCase("all sensors silent", frames.silent, STOPS, DEAD + BRAKE, share=1.0),
)
