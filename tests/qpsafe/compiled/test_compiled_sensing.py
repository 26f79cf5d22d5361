"""The compiled tick of the sensors against the rules of docs/reference/sensing.md, written plainly, bad data too."""

import copy
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.body import body_hulls
from qpsafe.sensing.hulls import Obstacle, half_spaces
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing

DT = 0.004
FLOOR = Obstacle.box("floor", (6, 6, 0.5), (0, 0, -0.4))


class Plain:
    """One spot at a time, in words that are as close to the page as Python allows."""

    def __init__(self, robot: Any, rules: SensingRules) -> None:
        self.robot, self.rules, self.spots = robot, rules, qpsafe.load_spots(robot)
        hulls = [(0, FLOOR.name, FLOOR.vertices), *(body_hulls(robot) if rules.self_detection else ())]
        self.hulls = [(body, half_spaces(name, corners)) for body, name, corners in hulls]
        k = len(self.spots)
        self.last, self.same, self.anchor = [np.nan] * k, [0] * k, np.zeros((k, 3))
        self.sick, self.dead, self.aged = [0] * k, [False] * k, [np.nan] * k
        self.seen, self.age, self.held = [np.inf] * k, [0] * k, np.zeros((k, 3))

    def known(self, p: np.ndarray, tolerance: float, poses: np.ndarray) -> bool:
        for body, planes in self.hulls:
            here = poses[body, :3, :3].T @ (p - poses[body, :3, 3])
            if (planes[:, :3] @ here + planes[:, 3] <= tolerance).all():
                return True
        return False

    def update(self, state: Any, wire: Any, distances: np.ndarray, ages: np.ndarray) -> dict[int, np.ndarray]:
        rules, ticks = self.rules, self.rules.ticks
        origins, directions = self.spots.rays(state)
        poses = state.body_poses()
        points = {}
        for i, d in enumerate(distances):
            usable = d >= 0.0 and -rules.clock_error <= ages[i] <= rules.max_age
            usable = usable and not ages[i] > self.aged[i] + DT + rules.clock_error
            self.aged[i] = ages[i]
            if 0.0 <= d <= self.spots.range_max[i]:
                point = origins[i] + d * directions[i]
                if d != self.last[i]:
                    self.anchor[i], self.same[i] = point, 0
                self.same[i] += 1
                self.last[i] = d
                with np.errstate(over="ignore"):
                    moved = np.linalg.norm(point - self.anchor[i])
                stuck = self.same[i] >= max(ticks(rules.stuck_after, DT), 3) and moved >= rules.stuck_motion
                usable = usable and not stuck
            else:
                self.same[i], self.last[i] = 0, np.nan
            self.sick[i] = 0 if usable else self.sick[i] + 1
            self.dead[i] = self.dead[i] or self.sick[i] >= max(ticks(rules.dead_after, DT), 1)

            hit = usable and d <= self.spots.range_max[i]
            p = origins[i] + (d if hit else 0.0) * directions[i]
            tolerance = rules.tolerance + np.tan(0.5 * self.spots.field_of_view[i]) * (d if hit else 0.0)
            counts = hit and (d < rules.d_min or not self.known(p, tolerance, poses))

            limit = ticks(rules.hold_time, DT)
            reading = (d if hit else np.inf) if usable else np.nan
            if usable and (reading <= self.seen[i] + rules.jump or self.age[i] >= limit):
                self.age[i], self.seen[i], self.held[i] = 0, d if counts else np.inf, p
            else:
                if self.age[i] >= limit:
                    self.seen[i] = np.inf
                self.age[i] += 1
                gone = self.seen[i] + rules.jump > self.spots.range_max[i] and usable and not hit
                if self.seen[i] < np.inf and not gone:
                    way = origins[i] - self.held[i]
                    length, step = np.linalg.norm(way), rules.approach_speed * DT
                    if length > step:
                        nearer = self.held[i] + step / length * way
                        along = wire.ends - wire.starts
                        t = np.sum((nearer - wire.starts) * along, axis=1) / np.maximum(
                            np.sum(along**2, axis=1), 1e-300
                        )
                        gaps = nearer - wire.starts - np.clip(t, 0.0, 1.0)[:, None] * along
                        if np.linalg.norm(gaps, axis=1).min() >= rules.d_min:
                            self.held[i] = nearer
            if self.seen[i] < np.inf:
                points[i] = self.held[i].copy()
        return points


def drifting(rng: np.random.Generator, ticks: int) -> np.ndarray:
    """Readings that drift, vanish, stick and fall sick, (ticks, 20)."""
    d = rng.uniform(0.1, 0.9, 20) + np.cumsum(rng.normal(0.0, 0.01, (ticks, 20)), axis=0)
    for _ in range(25):
        i, start, length = rng.integers(20), rng.integers(ticks), rng.integers(1, 50)
        spoilt = rng.choice([np.nan, np.inf, -np.inf, -0.1, 1e300, 1.5, 0.0, 0.55, 0.3])
        d[start : start + length, i] = spoilt
    return d


@pytest.mark.parametrize("velocities", [False, True])
@settings(max_examples=some(2, of=8), deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_every_tick_is_what_the_rules_say(irb140: Any, velocities: bool, seed: int, own: bool) -> None:
    rng = np.random.default_rng(seed)
    rules = SensingRules(velocities=velocities, self_detection=own, hold_time=float(rng.choice([0.0, 0.05, 0.15])))
    sensing, plain = DistanceSensing(irb140, qpsafe.load_spots(irb140), DT, rules, [FLOOR]), Plain(irb140, rules)
    q, speed = rng.uniform(irb140.lower, irb140.upper), rng.normal(size=6)
    for k, distances in enumerate(drifting(rng, 80)):
        state = irb140.at(q + 0.2 * np.sin(0.05 * k) * speed)
        wire = state.wire(speed)
        strange = rng.choice([1.0, np.nan, np.inf, -np.inf, -1.0, -0.011, -0.009, 0.013, 0.015, 0.03], 20)
        ages = np.where(rng.random(20) < 0.05, strange, 0.0)
        seen, expected = sensing.update(state, wire, distances, ages), plain.update(state, wire, distances, ages)
        assert seen.links.tolist() == [int(sensing.spots.links[i]) for i in expected]
        assert np.abs(seen.points - np.array(list(expected.values())).reshape(-1, 3)).max(initial=0.0) < 1e-12
        assert sensing.health.dead.tolist() == plain.dead
        out = [i for i in range(20) if plain.dead[i] or plain.sick[i]]
        assert sensing.unseen == tuple(sensing.spots.names[i] for i in out)
        assert bool(seen.notes) == bool(out) or sensing.health.stopped
        assert (seen.velocities is not None) == velocities
        if k % 20 == 10:  # a copy goes on as the original does: nothing is shared, nothing is torn apart
            sensing = copy.deepcopy(sensing)
        if velocities:
            assert np.isfinite(seen.velocities).all()
