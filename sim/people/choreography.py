"""When the person is where: the first experiment's 60 s as data.

The person stands at home, walks up to the robot with the board held towards it, pauses at a medium distance, steps
closer, pauses, withdraws, walks round to the next direction, and so on. Everything that can be tuned is a field of
`Approach` or `Choreography`.

The root's polar coordinates (radius, azimuth) about the robot's base axis and the turn away from "facing the robot" are
three tracks of smooth glides, so position and velocity are continuous. A board's distance is measured horizontally from
the robot's base axis to the board's face.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.people.footsteps import Footsteps
from qpsafe.sim.people.glide import Track
from qpsafe.sim.people.person import Board, Person, PersonPose, PersonPoses

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Approach:
    """One approach to the robot.

    Attributes:
        azimuth: Direction from the robot's base to the person; 0 is straight ahead (+x), positive to its left [rad].
        start: When the person starts to walk in; later if not yet back from walking round [s].
        medium_distance: Of the board's face from the base axis at the first pause [m].
        close_distance: The same at the second pause [m].
        medium_pause: Length of the first pause [s].
        close_pause: Length of the second pause [s].
    """

    azimuth: float
    start: float
    medium_distance: float
    close_distance: float
    medium_pause: float = 2.0
    close_pause: float = 2.0


class Phase(NamedTuple):
    """A named stretch of the choreography.

    Attributes:
        start, end: [s].
        name: "home", "walk in", "medium", "step closer", "close", "withdraw" or "walk round".
        approach: Index of the approach it belongs to, -1 for none.
    """

    start: float
    end: float
    name: str
    approach: int


#: The first experiment: front, left, right. The first pause leaves medium danger, the second high danger.
FIRST_EXPERIMENT: tuple[Approach, ...] = (
    Approach(math.radians(0.0), start=3.3, medium_distance=0.90, close_distance=0.72, close_pause=2.5),
    Approach(math.radians(72.0), start=18.5, medium_distance=0.72, close_distance=0.50, close_pause=2.5),
    Approach(math.radians(-72.0), start=36.0, medium_distance=0.70, close_distance=0.50, close_pause=2.5),
)


@dataclass(frozen=True)
class Choreography:
    """A person's walk as a function of time.

    Attributes:
        approaches: In the order of their start times.
        person: Who walks, and the board.
        duration: [s].
        home_radius: Distance of the person's root from the base axis between approaches [m].
        approach_speed, close_speed, withdraw_speed, round_speed: Walking in, stepping closer, withdrawing, and walking
            round the robot on the arc of radius `home_radius` [m/s].
        ramp: Time to reach such a speed [s].
        turn: How far the person turns away from the robot to walk round [rad].
        turn_time: Time of that turn [s].
        max_speed: The board's centre and the person's root never go faster [m/s]; checked on construction.

    Raises:
        ConfigurationError: If a value is not finite or out of range, or `max_speed` would be exceeded.
    """

    approaches: Sequence[Approach] = FIRST_EXPERIMENT
    person: Person = field(default_factory=Person)
    duration: float = 60.0
    home_radius: float = 2.2
    approach_speed: float = 0.60
    close_speed: float = 0.40
    withdraw_speed: float = 0.60
    round_speed: float = 0.90
    ramp: float = 0.60
    turn: float = math.radians(65.0)
    turn_time: float = 1.6
    max_speed: float = 1.0

    def __post_init__(self) -> None:
        for key in ("duration", "home_radius", "approach_speed", "close_speed", "withdraw_speed", "round_speed"):
            _check(key, getattr(self, key), lambda v: v > 0.0, "a finite number above 0")
        for key in ("ramp", "turn_time", "max_speed"):
            _check(key, getattr(self, key), lambda v: v > 0.0, "a finite number above 0")
        _check("turn", self.turn, lambda v: 0.0 <= v <= math.pi / 2, "0 to pi/2 rad")
        if self.person.board is None:
            raise ConfigurationError("Choreography", "person", self.person, "a person with a board")
        if not self.approaches:
            raise ConfigurationError("Choreography", "approaches", self.approaches, "at least one Approach")
        home = self.home_radius - self.board.reach
        for i, a in enumerate(self.approaches):
            where = f"approaches[{i}]."
            _check(where + "azimuth", a.azimuth, lambda v: abs(v) <= math.pi, "-pi to pi rad")
            _check(where + "medium_distance", a.medium_distance, lambda v: 0.0 < v < home, f"0 to {home:.2f} m")
            _check(
                where + "close_distance",
                a.close_distance,
                lambda v, a=a: 0.0 < v <= a.medium_distance,
                "above 0 and at most medium_distance [m]",
            )
            for key in ("medium_pause", "close_pause"):
                _check(where + key, getattr(a, key), lambda v: v >= 0.0, "0 s or more")
            _check(where + "start", a.start, lambda v: v >= 0.0, "0 s or more")
        self._plan  # noqa: B018  plan now: a wrong choreography must fail where it is written down
        if not self.peak_speed <= self.max_speed:
            raise ConfigurationError(
                "Choreography", "max_speed", self.max_speed, f"at least {self.peak_speed:.3f} m/s, or slower moves"
            )

    @cached_property
    def _plan(self) -> tuple[Track, Track, Track, tuple[Phase, ...]]:
        """Radius, azimuth and turn of the root over time, and the phases."""
        reach = self.board.reach
        radius, azimuth, turn = Track(self.home_radius), Track(self.approaches[0].azimuth), Track(0.0)
        phases: list[Phase] = []
        time = 0.0
        for i, approach in enumerate(self.approaches):
            start = max(approach.start, time)
            phases.append(Phase(time, start, "home", -1))
            at_medium = radius.glide(start, approach.medium_distance + reach, self.approach_speed, self.ramp)
            closer = at_medium + approach.medium_pause
            at_close = radius.glide(closer, approach.close_distance + reach, self.close_speed, self.ramp)
            leave = at_close + approach.close_pause
            time = radius.glide(leave, self.home_radius, self.withdraw_speed, self.ramp)
            phases += [
                Phase(start, at_medium, "walk in", i),
                Phase(at_medium, closer, "medium", i),
                Phase(closer, at_close, "step closer", i),
                Phase(at_close, leave, "close", i),
                Phase(leave, time, "withdraw", i),
            ]
            # ... and round to the next one, after the last back to the first. Facing the robot, its azimuth grows to
            # the person's right: turn right (negative) to walk that way.
            goal = self.approaches[(i + 1) % len(self.approaches)].azimuth
            if goal != azimuth.value:
                turn_speed = max(self.turn, 1e-9) / (0.5 * self.turn_time)
                away = -math.copysign(self.turn, goal - azimuth.value)
                turn.glide(time, away, turn_speed, 0.5 * self.turn_time)
                arrive = azimuth.glide(
                    time + 0.5 * self.turn_time, goal, self.round_speed / self.home_radius, self.ramp
                )
                back = max(arrive - 0.5 * self.turn_time, time + self.turn_time)
                end = turn.glide(back, 0.0, turn_speed, 0.5 * self.turn_time)
                phases.append(Phase(time, max(end, arrive), "walk round", -1))
                time = max(end, arrive)
        if time < self.duration:
            phases.append(Phase(time, self.duration, "home", -1))
        return radius, azimuth, turn, tuple(phase for phase in phases if phase.end > phase.start)

    @property
    def board(self) -> Board:
        """What the person carries."""
        assert self.person.board is not None  # checked on construction
        return self.person.board

    @property
    def persons(self) -> tuple[Person, ...]:
        """Who is there, for `build_scene(robot, people=...)`."""
        return (self.person,)

    @property
    def people(self) -> tuple[Choreography, ...]:
        """Who moves, like a story's."""
        return (self,)

    def poses(self, time: float) -> tuple[PersonPose, ...]:
        """Everybody at a time [s], for `scene.place_people`."""
        return (self.pose(time),)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """What happens when, without gaps, from 0 to at least `duration`."""
        return self._plan[3]

    @property
    def windows(self) -> tuple[tuple[float, float], ...]:
        """Start and end of each approach, from walking in to having withdrawn [s]."""
        return tuple(
            (min(p.start for p in self.phases if p.approach == i), max(p.end for p in self.phases if p.approach == i))
            for i in range(len(self.approaches))
        )

    @property
    def clear_time(self) -> float:
        """When the last withdrawal is complete [s]."""
        return self.windows[-1][1]

    def root(self, times: Array | float) -> tuple[Array, Array, Array]:
        """The person's root at times [s]: x [m], y [m], heading [rad], each in the shape of the times."""
        radius, azimuth, turn, _ = self._plan
        r, phi = radius(times), azimuth(times)
        return r * np.cos(phi), r * np.sin(phi), phi + math.pi + turn(times)

    def board_distance(self, time: float) -> float:
        """Horizontal distance from the robot's base axis to the nearest point of the board's face at a time [m]."""
        x, y, heading = self.root(time)
        board = self.board
        ahead = x * math.cos(heading) + y * math.sin(heading) + board.reach  # the axis, seen from the board's face
        aside = max(abs(float(y * math.cos(heading) - x * math.sin(heading))) - board.width / 2, 0.0)
        return math.hypot(ahead, aside)

    @cached_property
    def peak_speed(self) -> float:
        """Largest speed of the root and of the board's centre, sampled every 10 ms [m/s]."""
        x, y, heading = self.root(np.arange(0.0, self.duration + 0.005, 0.01))
        board = x + self.board.reach * np.cos(heading), y + self.board.reach * np.sin(heading)
        speeds = [np.hypot(np.diff(px), np.diff(py)) / 0.01 for px, py in ((x, y), board)]
        return float(np.max(speeds))

    @cached_property
    def _footsteps(self) -> Footsteps:
        return Footsteps(self.person, self.root, self.duration)

    def poses_at(self, times: Array) -> PersonPoses:
        """The person and the board at times (T,) [s]."""
        return self.person.poses(np.stack(self.root(times), axis=-1), self._footsteps.at(times))

    def pose(self, time: float) -> PersonPose:
        """The person and the board at a time [s]."""
        return self.poses_at(np.array([time]))[0]

    def varied(self, seed: int) -> Choreography:
        """The same choreography as another day would see it: a few centimetres, tenths of a second, degrees off.

        Args:
            seed: 0 is this choreography itself; the same seed gives the same one.
        """
        if seed == 0:
            return self
        rng = np.random.default_rng(seed)
        approaches = []
        for a in self.approaches:
            d_azimuth, d_start, d_medium, d_close, d_pause1, d_pause2 = rng.uniform(-1.0, 1.0, 6).tolist()
            medium = a.medium_distance + 0.03 * d_medium
            approaches.append(
                replace(
                    a,
                    azimuth=math.remainder(a.azimuth + math.radians(3.0) * d_azimuth, 2.0 * math.pi),
                    start=max(a.start + 0.3 * d_start, 0.0),
                    medium_distance=medium,
                    close_distance=min(a.close_distance + 0.02 * d_close, medium),
                    medium_pause=max(a.medium_pause + 0.2 * d_pause1, 0.0),
                    close_pause=max(a.close_pause + 0.2 * d_pause2, 0.0),
                )
            )
        return replace(self, approaches=tuple(approaches))


def _check(key: str, value: float, holds: object, expected: str) -> None:
    """Raise unless a configured number is finite and in range (written so that NaN fails)."""
    if not (isinstance(value, (int, float)) and math.isfinite(value) and holds(value)):  # type: ignore[operator]
        raise ConfigurationError("Choreography", key, value, expected)
