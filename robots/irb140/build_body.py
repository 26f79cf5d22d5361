"""Write the body of the IRB 140 into robot.xml: what is seen (group 2) and what collides (group 3).

Run it from anywhere: ``python robots/irb140/build_body.py`` rewrites the blocks between the "body" markers of robot.xml
and nothing else; with ``--check`` it only says whether they are up to date (exit code 1 if not).

Everything is made here from a few dozen figures, chosen by us so that each link's outer extents at the zero pose are
those of the real arm within 10 mm (a test measures them). No public mesh was used. Figures below are metres in the BASE
frame with all joints at zero, where every link's frame is parallel to the base's; each body's origin is subtracted on
writing.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from qpsafe.robots.bodywork import Part, Points, block, dispenser, drum, lathe, lettering, rewrite, slab, write_blocks

XML = Path(__file__).resolve().parent / "robot.xml"

# Origins of the bodies at the zero pose; must agree with robot.xml (a test compares).
ORIGIN = {
    "base": (0.0, 0.0, 0.0),
    "link_1": (0.0, 0.0, 0.352),
    "link_2": (0.07, 0.0, 0.352),
    "link_3": (0.07, 0.0, 0.712),
    "link_4": (0.45, 0.0, 0.712),
    "link_5": (0.45, 0.0, 0.712),
    "link_6": (0.515, 0.0, 0.712),
    "tool": (0.0, 0.0, 0.0),  # drawn in its own frame, z out of the flange
}

MATERIALS = {
    "paint": 'rgba="0.95 0.36 0.04 1" specular="0.35" shininess="0.45"',
    "graphite": 'rgba="0.17 0.175 0.18 1" specular="0.3" shininess="0.4"',
    "steel": 'rgba="0.66 0.67 0.69 1" specular="0.7" shininess="0.7"',
    "lettering": 'rgba="0.96 0.96 0.95 1" specular="0.1" shininess="0.1"',
}


def parts() -> list[Part]:
    """All pieces of the robot."""
    x, _, z = np.eye(3)
    pieces: list[Part] = []

    def add(body: str, name: str, points: Points, material: str = "paint", collides: bool = False) -> None:
        pieces.append(Part(body, name, points, material, collides))

    # base: foot plate with ears, round pedestal, connector box at the back
    add("base", "plate", block((-0.175, 0.175), (-0.201, 0.201), (0.0, 0.026), 0.012), collides=True)
    add(
        "base",
        "pedestal",
        lathe("z", (0.0, 0.0), (0.02, 0.174), (0.05, 0.168), (0.082, 0.166), (0.087, 0.160)),
        collides=True,
    )
    add("base", "bridge", block((-0.300, -0.05), (-0.105, 0.105), (0.0, 0.084)), collides=True)
    add("base", "rear", block((-0.308, -0.197), (-0.115, 0.115), (0.0, 0.153), 0.010), collides=True)
    add("base", "panel", block((-0.311, -0.300), (-0.098, 0.098), (0.025, 0.135), 0.002), "graphite")
    for i, (cy, cz, r) in enumerate(
        [(-0.06, 0.095, 0.022), (0.0, 0.095, 0.022), (0.06, 0.095, 0.016), (-0.03, 0.05, 0.012)]
    ):
        add("base", f"plug_{i}", drum("x", (cy, cz), -0.316, -0.305, r, 0.002), "steel")
    for i, (cx, cy) in enumerate([(-0.145, -0.17), (-0.145, 0.17), (0.145, -0.17), (0.145, 0.17)]):
        add("base", f"bolt_{i}", drum("z", (cx, cy), 0.02, 0.034, 0.012, 0.002), "steel")

    # link 1: turntable, upright around the shoulder, motor of axis 1 behind, motor of axis 2 on the left
    turntable = lathe("z", (0.016, 0.0), (0.089, 0.168), (0.097, 0.176), (0.165, 0.176), (0.185, 0.166), (0.195, 0.145))
    add("link_1", "turntable", turntable, collides=True)
    foot = lathe("z", (0.03, 0.038), (0.17, 0.097), (0.19, 0.097)) * [1.4, 1, 1] - [0.012, 0, 0]
    shoulder = drum("y", (0.07, 0.352), -0.060, 0.132, 0.1, 0.008)
    chest = drum("y", (0.103, 0.285), -0.040, 0.112, 0.089, 0.015)
    add("link_1", "upright", np.vstack([foot, chest, shoulder]), collides=True)
    add("link_1", "motor_1", drum("z", (-0.085, 0.035), 0.15, 0.352, 0.058, 0.008), collides=True)
    add("link_1", "cap_1", drum("z", (-0.085, 0.035), 0.34, 0.362, 0.050, 0.006), "graphite")
    add("link_1", "motor_2", drum("y", (0.07, 0.352), 0.12, 0.196, 0.078, 0.010), collides=True)
    add("link_1", "cap_2", drum("y", (0.07, 0.352), 0.18, 0.204, 0.058, 0.006), "graphite")

    # link 2: the lower arm, a curved slab on the right side of shoulder and elbow
    back = [(0.07, 0.352, 0.068), (0.045, 0.47, 0.074), (0.045, 0.56, 0.072)]
    add("link_2", "arm_low", slab(-0.172, -0.067, back, 0.014), collides=True)
    add(
        "link_2", "arm_high", slab(-0.1705, -0.0685, [(0.048, 0.52, 0.075), (0.07, 0.712, 0.085)], 0.014), collides=True
    )
    add("link_2", "hub", drum("y", (0.07, 0.352), -0.08, 0.098, 0.060), collides=True)
    add("link_2", "cover_low", drum("y", (0.07, 0.352), -0.176, -0.16, 0.046, 0.003), "graphite")
    add("link_2", "cover_high", drum("y", (0.07, 0.712), -0.176, -0.16, 0.062, 0.003), "graphite")

    # link 3: elbow housing, motors of the wrist behind it, tapered forearm
    elbow = drum("y", (0.07, 0.710), -0.062, 0.082, 0.099, 0.008)
    add(
        "link_3",
        "elbow",
        np.vstack([elbow, block((-0.070, 0.0), (-0.052, 0.074), (0.642, 0.782), 0.014)]),
        collides=True,
    )
    for i, (cy, cz) in enumerate([(-0.016, 0.745), (0.040, 0.745), (0.012, 0.680)]):
        add("link_3", f"motor_{i}", drum("x", (cy, cz), -0.078, -0.04, 0.026, 0.004), "graphite")
    add("link_3", "cover", drum("y", (0.07, 0.712), 0.07, 0.088, 0.066, 0.003), "graphite")
    cone = lathe("x", (0.0, 0.712), (0.09, 0.085), (0.17, 0.083), (0.24, 0.070), (0.300, 0.060), (0.308, 0.056))
    add("link_3", "forearm", cone, collides=True)

    # link 4: tube and fork
    add("link_4", "collar", drum("x", (0.0, 0.712), 0.309, 0.317, 0.0545, 0.001), "graphite")
    tube = lathe("x", (0.0, 0.712), (0.315, 0.052), (0.322, 0.056), (0.370, 0.056), (0.388, 0.052), (0.394, 0.045))
    add("link_4", "tube", tube, collides=True)
    for name, side in (("left", 1.0), ("right", -1.0)):
        eye = drum("y", (0.45, 0.712), 0.044, 0.062, 0.055, 0.004)
        root = block((0.345, 0.395), (0.024, 0.052), (0.674, 0.750), 0.006)
        add("link_4", f"fork_{name}", np.vstack([eye, root]) * [1, side, 1], collides=True)
        add("link_4", f"cover_{name}", drum("y", (0.45, 0.712), 0.055, 0.0655, 0.036, 0.002) * [1, side, 1], "graphite")

    # link 5: barrel and neck; link 6: flange
    add("link_5", "barrel", drum("y", (0.45, 0.712), -0.042, 0.042, 0.042), collides=True)
    add("link_5", "neck", drum("x", (0.0, 0.712), 0.44, 0.4855, 0.036), collides=True)
    add("link_6", "flange", drum("x", (0.0, 0.712), 0.486, 0.515, 0.025, 0.001), "steel", collides=True)
    for i, angle in enumerate(np.deg2rad([45.0, 135.0, 225.0, 315.0])):
        place = (0.0 + 0.0195 * np.cos(angle), 0.712 + 0.0195 * np.sin(angle))
        add("link_6", f"bolt_{i}", drum("x", place, 0.505, 0.5153, 0.003, 0.0005), "graphite")

    # tool: a slim dispenser whose needle ends in the tool centre point, 0.14 m from the flange
    dispenser(add)

    # the type's name, reading up the lower arm
    points, faces = lettering("IRB 140", np.array([0.066, -0.1715, 0.43]), z, -x, 0.030)
    pieces.append(Part("link_2", "name", points, "lettering", faces=faces))
    return pieces


def build(text: str) -> str:
    """The text of robot.xml with its marked blocks written anew."""
    return write_blocks(text, parts(), ORIGIN, MATERIALS)


if __name__ == "__main__":
    sys.exit(rewrite(XML, build, __doc__))
