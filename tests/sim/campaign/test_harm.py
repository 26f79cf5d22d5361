"""Energy, force and effective mass of a contact."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.campaign.trials.contact import classified
from qpsafe.sim.campaign.trials.harm import REGIONS, blow, effective_mass
from qpsafe.sim.people.anatomy import SEGMENTS
from qpsafe.sim.world.contact_point import point_jacobian

regions = st.sampled_from(sorted(REGIONS))


def test_every_part_of_a_person_has_a_region() -> None:
    names = {s.name.removeprefix("left_").removeprefix("right_") for s in SEGMENTS}
    assert names | {"board"} == set(REGIONS)


@pytest.mark.parametrize(("region", "energy"), [("torso", 1.6), ("upper_arm", 1.5), ("forearm", 1.3), ("hand", 0.49)])
def test_limits_agree_with_those_of_a_published_shield(region: str, energy: float) -> None:
    assert REGIONS[region].limits(clamped=False)[1] == pytest.approx(energy, rel=0.07)


@given(regions, st.floats(0.0, 3.0), st.floats(0.5, 50.0))
def test_at_the_limit_of_energy_the_force_is_at_its_limit(region: str, speed: float, mass: float) -> None:
    hit = blow(region, speed, mass, clamped=False)
    assert hit.energy / hit.energy_limit == pytest.approx((hit.force / hit.force_limit) ** 2, rel=1e-9, abs=1e-12)


@given(regions, st.floats(0.01, 3.0), st.floats(0.5, 50.0))
def test_a_clamped_part_is_never_better_off(region: str, speed: float, mass: float) -> None:
    free, clamped = blow(region, speed, mass, False), blow(region, speed, mass, True)
    assert clamped.energy >= free.energy
    assert clamped.energy_limit <= free.energy_limit
    assert blow(region, -speed, mass, False).energy == 0.0


def test_the_effective_mass_is_what_an_impulse_meets(irb140: Any, rng: np.random.Generator) -> None:
    """An impulse p along n changes q̇ by M⁻¹ Jᵀ n p, and the point's speed along n by p / m."""
    import pinocchio as pin

    for _ in range(20):
        q = rng.uniform(0.5 * irb140.lower, 0.5 * irb140.upper)
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        J = irb140.jacobian("tcp", q)[:3]
        model = irb140.model
        minv = pin.computeMinverse(model, pin.Data(model), q)
        minv = np.triu(minv) + np.triu(minv, 1).T
        change = normal @ J @ minv @ J.T @ normal
        assert effective_mass(irb140, q, J, normal) == pytest.approx(1.0 / change, rel=1e-9)


def test_the_jacobian_of_a_point_is_that_of_the_frame_there(irb140: Any, rng: np.random.Generator) -> None:
    for _ in range(20):
        q = rng.uniform(irb140.lower, irb140.upper)
        state = irb140.at(q)
        body = irb140.mounting("tcp")[0]
        J = point_jacobian(state, body, state.position("tcp"))
        assert np.abs(J - state.jacobian("tcp")[:3]).max() < 1e-12


@pytest.mark.parametrize(
    ("speed", "towards", "clamped", "expected"),
    [
        (0.0, 0.0, True, "rest"),
        (0.5, 0.4, False, "towards"),
        (0.5, 0.05, False, "sideways"),
        (0.5, -0.3, False, "away"),
        (0.5, 0.01, True, "clamped"),
        (0.0009, 0.0009, True, "rest"),
    ],
)
def test_classes_of_contact(speed: float, towards: float, clamped: bool, expected: str) -> None:
    assert classified(speed, towards, clamped) == expected
