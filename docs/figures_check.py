"""Draw docs/img/check.png: the second experiment's program with a table that stands too high."""

from pathlib import Path

import qpsafe
from qpsafe.check.check import check_path
from qpsafe.check.report import troubles
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sim.drawing.checks import check_figure
from qpsafe.sim.experiments.path.experiment import PROGRAM
from qpsafe.tasks.program_file import load_program

if __name__ == "__main__":
    robot = qpsafe.load_robot("irb140")
    table = Obstacle.box("table", (0.3, 0.3, 0.04), (0.5, 0.0, 0.525))
    result = check_path(robot, load_program(PROGRAM, robot), known=[table])
    print(*troubles(result), sep="\n")
    check_figure(result, Path(__file__).parent / "img" / "check.png", "path.toml, irb140, a table too high")
