"""Draw the two-view picture of the IRB 140 in the documentation: ``MUJOCO_GL=egl python robots/irb140/picture.py``."""

from pathlib import Path

from qpsafe.robots.portrait import View, main

VIEWS = [
    View([0, 10, 10, 0, 60, 0], 138, -16, 2.55, [0.11, 0.0, 0.40]),
    View([-20, -35, 25, 0, 45, 0], 40, -18, 2.55, [0.06, 0.0, 0.40]),
]

if __name__ == "__main__":
    main(Path(__file__).resolve().parent, VIEWS, __doc__)
