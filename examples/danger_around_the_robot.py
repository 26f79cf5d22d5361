"""How dangerous is the robot for a point in space? At rest, moving towards it, moving away from it."""

import numpy as np
from rich.console import Console
from rich.table import Table

import qpsafe

robot = qpsafe.load_robot("irb140")
field = qpsafe.DangerField()  # eq. (5); weights of the paper
tip = robot.pose("tcp", robot.home)[:3, 3]

# the joint velocity of least norm that moves the tip forward at 0.5 m/s
J = robot.jacobian("tcp", robot.home)[:3]
forward = np.linalg.pinv(J) @ [0.5, 0.0, 0.0]
wires = [robot.wire(robot.home, speed * forward) for speed in (0.0, 1.0, -1.0)]

table = Table("CDF at", "at rest", "tip comes", "tip goes")
for name, offset in {
    "0.2 m before the tip": (0.2, 0.0, 0.0),
    "0.5 m before the tip": (0.5, 0.0, 0.0),
    "1.0 m before the tip": (1.0, 0.0, 0.0),
    "0.5 m beside the tip": (0.0, 0.5, 0.0),
    "0.5 m above the tip, by the arm": (0.0, 0.0, 0.5),
}.items():
    values = [float(field.value([tip + offset], wire)[0]) for wire in wires]
    table.add_row(name, *(f"{value:.2f}" for value in values))
Console().print(table)

activation = qpsafe.Activation()
for task, threshold in zip(("position", "orientation"), activation.thresholds, strict=True):
    print(f"{task:11} is released from {threshold.start:.3f} on, completely at {threshold.end:.3f}")
