"""What people come to do, as steps of a story: one function a kind of encounter."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from qpsafe.sim.campaign.people.draws import Draw
from qpsafe.sim.campaign.people.floor_plan import FloorPlan, Place
from qpsafe.sim.campaign.people.within_reach import within_reach
from qpsafe.sim.people.walker import EASE

Step = dict[str, Any]
SHOULDER = 0.4  # height of the robot's shoulder above its base, in shares of the reach
PHONE = (0.35, 0.7)  # where a phone is held: ahead [m], height in shares of the body's
ROUTED = 1.0  # those who go round furniture take corners in this time [s]
ROUND = 1.6  # ... and are no faster than this [m/s]
SHORTEST = 0.2  # nobody stops in less [s]
BACK = 0.8  # people walk backwards no faster than this [m/s]
FAR = 3.0  # how far those who turn round walk away [m]


class Visit:
    """One person's encounter on a floor plan.

    Args:
        draw: What they are like.
        plan: Where.
    """

    def __init__(self, draw: Draw, plan: FloorPlan) -> None:
        self.draw, self.plan = draw, plan
        self.at: Place = (0.0, 0.0)
        self.heading = draw.azimuth + math.pi
        self.steps: list[Step] = []

    def table(self, name: str) -> dict[str, Any]:
        """Of a story's person.

        Args:
            name: The person's.
        """
        KINDS[self.draw.kind](self)
        start, heading = self.start, math.degrees(math.remainder(self.first, 2.0 * math.pi))
        person: dict[str, Any] = {"name": name, "start": start, "heading": heading, "height": self.draw.height}
        if self.draw.board:
            person["board"] = {}
        return person | {"step": self.steps}

    # ---- where

    def polar(self, distance: float, angle: float, aside: float = 0.0) -> Place:
        """A place so far from the base axis in a direction, and so far to the left of who comes from there.

        Args:
            distance: [m].
            angle: Direction from the base axis [rad].
            aside: To the left of somebody who looks at the robot [m].
        """
        (x, y), c, s = self.plan.base, math.cos(angle), math.sin(angle)
        return x + distance * c + aside * s, y + distance * s - aside * c

    def far(self) -> float:
        """How far from the base axis people set out, so that they are at full speed where `start` says [m]."""
        speed = self.draw.speed
        return self.plan.reach + self.draw.start + 0.5 * speed * (EASE[0] + EASE[1] * speed)

    def come(self, aside: float = 0.0, turned: float = 0.0) -> None:
        """Stand where they set out.

        Args:
            aside: So far to the left of the line to the base axis [m].
            turned: Away from where the robot is [rad].
        """
        self.start = self.at = self.plan.out(self.polar(self.far(), self.draw.azimuth, aside), self.draw.azimuth)
        self.first = self.heading = self.draw.azimuth + math.pi + turned
        if self.draw.delay > 0.0:
            self.wait(self.draw.delay)

    def edge(self, beyond: float) -> Place:
        """A place this far in front of whatever stands between the robot and where they come from [m]."""
        place = self.plan.out(self.plan.base, self.draw.azimuth)
        beyond += 0.42 if self.draw.board else 0.0  # which is carried so far ahead
        ahead = (place[0] + beyond * math.cos(self.draw.azimuth), place[1] + beyond * math.sin(self.draw.azimuth))
        return self.plan.out(ahead, self.draw.azimuth)

    # ---- what

    def wait(self, time: float) -> None:
        """Stand [s]."""
        self.steps.append({"do": "wait", "time": time})

    def walk(self, goal: Place, speed: float, keep: bool = False) -> None:
        """Walk to a place, round what is in the way.

        Args:
            goal: Where.
            speed: [m/s].
            keep: Without turning.
        """
        points = self.plan.way(self.at, goal)
        points = [b for a, b in zip([self.at, *points], points, strict=False) if math.dist(a, b) > 0.05]
        if points:
            before = points[-2] if len(points) > 1 else self.at
            step = {"do": "walk", "to": points, "speed": speed, "facing": "keep" if keep else "travel"}
            step["stop"] = max(self.draw.ease * speed, SHORTEST)
            if len(points) > 1:
                step |= {"ease": ROUTED, "speed": min(speed, ROUND)}
            self.steps.append(step)
            if not keep:
                self.heading = math.atan2(points[-1][1] - before[1], points[-1][0] - before[0])
            self.at = points[-1]

    def go(self) -> None:
        """Stay, then leave: to where they came from or beside it, forwards or backwards."""
        self.wait(self.draw.stay)
        angle, back = self.draw.azimuth + self.draw.leave, self.draw.back
        goal = self.plan.out(self.polar(self.far(), angle), angle)
        self.walk(goal, min(self.draw.leaving, BACK) if back else self.draw.leaving, keep=back)

    def look(self, ahead: float, height: float) -> None:
        """Look at a point ahead [m], so high above the floor [m]."""
        x, y = self.at[0] + ahead * math.cos(self.heading), self.at[1] + ahead * math.sin(self.heading)
        self.steps.append({"do": "look", "at": (x, y, self.plan.floor + height)})


def past(visit: Visit) -> None:
    """Walk past on a straight line, or on the way round what stands there."""
    aside = visit.draw.side * visit.plan.reach
    visit.come(aside)
    if visit.draw.kind == "inattentive":
        visit.look(PHONE[0], PHONE[1] * visit.draw.height)
    opposite = visit.draw.azimuth + math.pi
    visit.walk(visit.plan.out(visit.polar(visit.far(), opposite, -aside), opposite), visit.draw.speed)


def straight(visit: Visit) -> None:
    """Walk straight at the robot until pedestal or table, stay, leave."""
    visit.come()
    visit.walk(visit.edge(visit.draw.near), visit.draw.speed)
    visit.go()


def backwards(visit: Visit) -> None:
    """Come in backwards, stay, walk out forwards."""
    visit.come(turned=math.pi)
    visit.walk(visit.edge(visit.draw.near), visit.draw.speed, keep=True)
    visit.wait(visit.draw.stay)
    angle = visit.draw.azimuth + visit.draw.leave
    visit.walk(visit.plan.out(visit.polar(visit.far(), angle), angle), visit.draw.leaving)


def stumble(visit: Visit) -> None:
    """Walk in, trip, fall forwards with the hands ahead, rise, leave."""
    draw = visit.draw
    visit.come()
    visit.walk(visit.edge(draw.near), draw.speed)
    visit.steps.append({"do": "stumble", "early": draw.early, "lean": draw.lean, "speed": draw.hand_speed})
    visit.go()


def reach(visit: Visit) -> None:
    """Walk up, reach in with a hand to the robot or near it, stay, withdraw, leave."""
    draw, plan = visit.draw, visit.plan
    shoulder = (*plan.base, SHOULDER * plan.reach)
    x, y, z = (a + draw.along * (b - a) + d for a, b, d in zip(shoulder, plan.tool, draw.aside, strict=True))
    visit.come((y - plan.base[1]) * -math.cos(draw.azimuth) + (x - plan.base[0]) * math.sin(draw.azimuth))
    place = (x + draw.near * math.cos(draw.azimuth), y + draw.near * math.sin(draw.azimuth))
    visit.walk(plan.out(place, draw.azimuth), draw.speed)
    here = visit.at
    if abs(math.remainder(math.atan2(y - here[1], x - here[0]) - visit.heading, 2.0 * math.pi)) > 1e-6:
        visit.steps.append({"do": "turn", "towards": (x, y)})
        visit.heading = math.atan2(y - here[1], x - here[0])
    point = within_reach(draw.height, plan.floor, (*here, visit.heading), (x, y, z), draw.left)
    hand = {"arm": "left" if draw.left else "right", "speed": draw.hand_speed}
    pace = {"profile": "minimum-jerk", "late": draw.late}
    visit.steps.append({"do": "reach", "to": point, "early": draw.early} | hand | pace)
    visit.wait(draw.stay)
    visit.steps.append({"do": "retract"} | hand | pace)
    visit.go()


def turn(visit: Visit) -> None:
    """Walk up, turn round suddenly, walk away."""
    draw, plan = visit.draw, visit.plan
    visit.come()
    away = max(draw.near * plan.reach, math.dist(visit.edge(0.0), plan.base))
    visit.walk(plan.out(visit.polar(away, draw.azimuth), draw.azimuth), draw.speed)
    visit.heading += draw.turned
    degrees = math.degrees(math.remainder(visit.heading, 2.0 * math.pi))
    visit.steps.append({"do": "turn", "heading": degrees, "rate": draw.turning})
    ahead = (visit.at[0] + FAR * math.cos(visit.heading), visit.at[1] + FAR * math.sin(visit.heading))
    visit.walk(plan.out(ahead, visit.heading), draw.speed)


KINDS: dict[str, Callable[[Visit], None]] = {
    "past": past,
    "straight": straight,
    "inattentive": past,
    "backwards": backwards,
    "stumble": stumble,
    "reach": reach,
    "turn": turn,
}
