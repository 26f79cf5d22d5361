"""How hard a contact is: transferred energy and force by body region, against the limits of the standard.

The model is that of ISO/TS 15066 for a free (transient) contact: two masses and the region's spring. With v the closing
speed along the contact normal n,

    E = µ v²/2,   F = v sqrt(µ k),   1/µ = 1/m_H + 1/m_R,   m_R = 1 / (nᵀ J M(q)⁻¹ Jᵀ n)

m_R is the mass that the robot shows at the contact point in the direction of n (joints free, controller ignored). The
limit of a region is F_max, so its energy is F_max²/(2 k). In a free contact F_max is twice the quasi-static value, but
for the head; a clamped part has the quasi-static value itself.

Figures: spring constants, masses and forces as papers quote them from ISO/TS 15066:2016, tables A.2 and A.3; second
hand, we have not seen the standard itself. They agree with the energies that a published verified shield was built
with (torso 1.6 J, upper arm 1.5, forearm 1.3, hand 0.49). The head, where contact is to be excluded, has the lowest
value of skull and face and no factor: 0.03 J, a quarter of the 0.11 J that the same shield has. What our person has
and the table has not (foot, board) is marked as ours.

The harm of a whole encounter is one number without a unit, ours:

    h = s/(1 + s) + ¼ exp(-max(d, 0)/0.1 m),

with s the energy of the first contact over what the touched region may take (0 without contact), d the smallest true
distance. The first term is the harm of a blow: ½ at the limit, never above 1, so that a single blow on a head, whose
limit is low, is no more than one. The second gives a slope where contacts are rare.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.robot.models.mujoco_spec import weighed_model

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
NEAR, SHARE = 0.1, 0.25  # of h: [m], and what a contact without energy has


class Region(NamedTuple):
    """A body region.

    Attributes:
        mass: Effective mass m_H [kg].
        stiffness: k [N/m].
        force: Quasi-static limit [N].
        transient: What a free contact may reach of it, 2 but for the head.
    """

    mass: float
    stiffness: float
    force: float
    transient: float = 2.0

    def limits(self, clamped: bool) -> tuple[float, float]:
        """Force [N] and energy [J] that are permitted."""
        force = self.force * (1.0 if clamped else self.transient)
        return force, force * force / (2.0 * self.stiffness)


REGIONS: dict[str, Region] = {
    "head": Region(4.4, 75e3, 65.0, 1.0),  # the face, lower than the skull's 130 N at 150 N/mm
    "neck": Region(1.2, 50e3, 150.0),
    "torso": Region(40.0, 25e3, 140.0),  # chest
    "shoulders": Region(40.0, 35e3, 210.0),
    "pelvis": Region(40.0, 25e3, 180.0),
    "upper_arm": Region(3.0, 30e3, 150.0),
    "forearm": Region(2.0, 40e3, 160.0),
    "hand": Region(0.6, 75e3, 140.0),
    "thigh": Region(75.0, 50e3, 220.0),
    "shank": Region(75.0, 60e3, 130.0),
    "foot": Region(75.0, 60e3, 130.0),  # ours: as the shank
    "board": Region(2.0, 40e3, 160.0),  # ours: what holds it are the forearms
}


class Blow(NamedTuple):
    """What a contact does.

    Attributes:
        energy, energy_limit: [J].
        force, force_limit: [N].
    """

    energy: float
    energy_limit: float
    force: float
    force_limit: float


def blow(region: str, closing: float, robot_mass: float, clamped: bool) -> Blow:
    """Energy and force of a contact.

    Args:
        region: A key of `REGIONS`.
        closing: Speed at which both came together along the normal [m/s]; below 0 counts as 0.
        robot_mass: m_R [kg].
        clamped: Whether the part could not give way; then it has no mass to be moved, and m_H is infinite.
    """
    part = REGIONS[region]
    mass = robot_mass if clamped else 1.0 / (1.0 / part.mass + 1.0 / robot_mass)
    speed = max(closing, 0.0)
    force_limit, energy_limit = part.limits(clamped)
    return Blow(0.5 * mass * speed * speed, energy_limit, speed * math.sqrt(mass * part.stiffness), force_limit)


def effective_mass(robot: Robot, q: Array, jacobian: Array, normal: Array, payload: float = 0.0) -> float:
    """m_R = 1 / (nᵀ J M(q)⁻¹ Jᵀ n) of the robot at a point, plus what it carries [kg].

    Args:
        robot: With the inertias of its file; of what it states none for, those that the simulation has.
        q: (n,) [rad].
        jacobian: Linear Jacobian of the point (3, n).
        normal: Unit vector (3,).
        payload: [kg].

    Returns:
        +inf where the point cannot move along the normal: the robot is as hard as its base.
    """
    import pinocchio as pin

    model = weighed_model(robot)
    M = pin.crba(model, pin.Data(model), q)
    M = np.triu(M) + np.triu(M, 1).T  # crba fills the upper half
    row = normal @ jacobian
    mobility = float(row @ np.linalg.solve(M, row))
    return math.inf if mobility < 1e-9 else 1.0 / mobility + payload


def harm(shares: ArrayLike, distances: ArrayLike) -> Array:
    """h of encounters, as they come: numbers or (n,).

    Args:
        shares: Energy of the contact over the limit; NaN or 0 without one.
        distances: Smallest true distance [m].
    """
    given = np.asarray(shares, dtype=float)
    s = np.where(given > 0.0, given, 0.0)  # NaN: no contact
    blows = np.divide(s, 1.0 + s, out=np.ones_like(s), where=np.isfinite(s))
    return blows + SHARE * np.exp(-np.maximum(distances, 0.0) / NEAR)
