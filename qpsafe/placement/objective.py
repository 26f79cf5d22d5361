"""What can be asked of a placement, checked before anything takes long."""

from __future__ import annotations

from enum import StrEnum

from qpsafe.errors import ConfigurationError


class Objective(StrEnum):
    """What a placement of a given number of spots is to be best at."""

    cost = "cost"  # (10) to (12)
    detection = "detection"  # the probability that any spot detects: (13) the other way round
    nearest = "nearest"  # the probability that a point close to the person's nearest one is detected
    danger = "danger"  # the danger that each link sees; what another node of the link sees already does not pay
    evasion = "evasion"  # the same, by the torque (14), (15) it makes instead of the danger


class SensorName(StrEnum):
    """What can be placed, see `qpsafe.placement.sensors`."""

    sharp = "sharp"  # a spot, which looks along one axis
    vl53l5cx = "vl53l5cx"  # an array of 8 x 8 zones


def check_request(nodes: int, spots: int | None, probability: float | None) -> None:
    """Refuse what cannot be asked.

    Args:
        nodes: How many there are.
        spots: How many are wanted, or None.
        probability: Detection probability wanted, or None.

    Raises:
        ConfigurationError: No spots, more spots than nodes, a probability that is none, or both given.
    """
    if not nodes >= 1:
        raise ConfigurationError("placement", "nodes", nodes, "at least 1")
    if spots is not None and not 1 <= spots <= nodes:
        raise ConfigurationError("placement", "spots", spots, f"1 to {nodes}, the number of candidate nodes")
    if probability is None:
        return
    if not 0.0 < probability <= 1.0:
        raise ConfigurationError("placement", "probability", probability, "above 0 and at most 1")
    if spots is not None:
        raise ConfigurationError("placement", "spots", spots, "nothing: a probability decides how many, eq. (13)")
