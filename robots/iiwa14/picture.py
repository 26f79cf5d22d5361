"""Draw the picture of the LBR iiwa 14 in the documentation: ``MUJOCO_GL=egl python robots/iiwa14/picture.py``."""

from pathlib import Path

from qpsafe.robots.portrait import View, main

VIEWS = [
    View([0, 25, 0, -90, 0, 65, 0], 138, -14, 3.0, [0.20, 0.0, 0.40]),
    View([-20, -20, 50, -80, 40, 50, 0], 55, -14, 3.2, [0.05, 0.0, 0.55]),
]

if __name__ == "__main__":
    main(Path(__file__).resolve().parent, VIEWS, __doc__)
