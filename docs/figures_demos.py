"""Draw docs/img/demo-fixed*.png, demo-path*.png: figures that the commands write, and four frames of the first run."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import qpsafe
from qpsafe.sim.drawing.film import Film
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

IMG = Path(__file__).parent / "img"
#: Of each command, what it writes and what that is called here.
FIGURES = {
    "fixed --no-video": {"figure.png": "demo-fixed", "distance.png": "demo-fixed-distance"},
    "fixed --no-video --robot irb14000": {"figure.png": "irb14000-fixed"},
    "path": {"figure.png": "demo-path", "side-by-side.png": "demo-path-laws"},
}
TIMES = (6.52, 9.6, 26.0, 45.0)  # medium and high danger in front, high on the left and on the right [s]


def commands() -> None:
    """Run the commands and take their figures."""
    for words, figures in FIGURES.items():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-m", "qpsafe", "demo", *words.split(), "--out", folder], check=True)
            for name, target in figures.items():
                shutil.copy(Path(folder) / name, IMG / f"{target}.png")


def frames() -> None:
    """Four moments of the first experiment."""
    robot = qpsafe.load_robot("irb140")
    experiment = FixedExperiment(robot, duration=TIMES[-1] + 0.1)
    spots, shown = qpsafe.load_spots(robot), []
    assert spots is not None
    with (
        tempfile.TemporaryDirectory() as folder,
        Film(Path(folder) / "film.mp4", experiment.scene, spots, qpsafe.Activation()) as film,
    ):
        wanted = {10 * round(time / 0.04) for time in TIMES}

        def watch(tick: qpsafe.Tick, *rest: object) -> None:
            if tick.reference.seq in wanted:
                shown.append(film.observe(tick, *rest))

        experiment.run(watch)
    sheet = np.vstack([np.hstack(shown[:2]), np.hstack(shown[2:])])
    Image.fromarray(sheet).resize((1280, 720)).save(IMG / "demo-fixed-frames.png")


if __name__ == "__main__":
    commands()
    frames()
