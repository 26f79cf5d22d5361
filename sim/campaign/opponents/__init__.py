"""What the controller is compared with: no control, monitors that stop or slow down, other laws."""

from qpsafe.sim.campaign.opponents.registry import Opponent, names, opponent, register

__all__ = ["Opponent", "names", "opponent", "register"]
