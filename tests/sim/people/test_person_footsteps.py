import itertools
import math

import numpy as np
import pytest
from amounts import some

from qpsafe.sim.people.footsteps import Footsteps
from qpsafe.sim.people.person import Person

WALKS = {
    "forwards": lambda t: (0.7 * t, 0.0, 0.0),
    "backwards": lambda t: (-0.5 * t, 0.0, 0.0),
    "sideways": lambda t: (0.0, 0.4 * t, 0.0),
    "turning": lambda t: (0.0, 0.0, 0.8 * t),
    "arc": lambda t: (2.0 * np.cos(0.3 * t), 2.0 * np.sin(0.3 * t), 0.3 * t + math.pi / 2),
    "standing": lambda t: (1.0, 2.0, 0.5),
}


@pytest.fixture(params=WALKS)
def walk(request):
    return WALKS[request.param]


def test_one_foot_always_stands_and_standing_feet_do_not_slip(walk):
    steps = Footsteps(Person(), walk, 8.0)
    ordered = sorted((s for side in steps.steps for s in side), key=lambda s: s.start)
    assert all(a.end < b.start for a, b in itertools.pairwise(ordered))  # never both in the air
    before = steps(0.0)
    for t in np.arange(0.01, 8.0, some(2, of=1) / 100):
        now = steps(t)
        for side in (0, 1):
            swinging = any(s.start < t <= s.end + some(2, of=1) / 100 for s in steps.steps[side])
            assert swinging or now[side] == before[side]
        before = now


def test_feet_keep_up_with_the_body(walk):
    person = Person()
    steps = Footsteps(person, walk, 8.0)
    for t in np.arange(0.0, 8.0, some(4, of=2) / 100):
        for foot, home in zip(steps(t), person.standing_feet(*walk(t)), strict=True):
            assert math.hypot(foot.x - home.x, foot.y - home.y) < 0.42
            assert abs(math.remainder(foot.yaw - home.yaw, 2 * math.pi)) < 0.8


def test_feet_move_without_jumps(walk):
    steps = Footsteps(Person(), walk, 8.0)
    feet = steps.at(np.arange(0.0, 8.0, 0.005))  # (time, side, x y yaw lift)
    assert np.abs(np.diff(feet[:, :, :2], axis=0)).max() < 0.005 * 4.0
    assert np.abs(np.diff(feet[:, :, 3], axis=0)).max() < 0.005 * 1.0
    assert feet[:, :, 3].min() >= 0.0


def test_who_stands_does_not_step():
    assert Footsteps(Person(), WALKS["standing"], 8.0).steps == ([], [])
