"""Draw the picture of the IRB 14000 in the documentation: ``MUJOCO_GL=egl python robots/irb14000/picture.py``."""

from pathlib import Path

from qpsafe.robots.portrait import View, main

HOME = [-58, -79, 53, 47, 114, 85, 0, 58, -79, -53, 47, -114, 85, 0]
REACH = [-30, -60, 60, 20, 100, 60, 0, 80, -100, -60, 60, -110, 85, 0]
VIEWS = [View(HOME, 150, -22, 2.6, [0.12, 0.0, 0.27]), View(REACH, 40, -22, 2.6, [0.10, 0.0, 0.27])]

if __name__ == "__main__":
    main(Path(__file__).resolve().parent, VIEWS, __doc__)
