"""Draw docs/img/check.png: the second experiment's program with a table that stands too high.

What the page says of it goes into docs/data/check.json.
"""

from pathlib import Path

from noted import note

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
    (trouble,) = troubles(result)
    note("check", {"distance": result.furniture.distance, "time": result.furniture.time, "trouble": trouble})
    check_figure(result, Path(__file__).parent / "img" / "check.png", "path.toml, irb140, a table too high")
