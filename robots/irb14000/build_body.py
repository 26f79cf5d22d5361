"""Write the body of the IRB 14000 into robot.xml: what is seen (group 2) and what collides (group 3).

Run it from anywhere: ``python robots/irb14000/build_body.py`` rewrites the blocks between the "body" markers of
robot.xml and nothing else; with ``--check`` it only says whether they are up to date (exit code 1 if not).

Everything is made here from a few figures chosen by us: the axes are where the published kinematics has them, the shape
around them is our own. No public mesh was used. Figures below are metres; those of the torso in the base frame, those
of each link in its own frame, whose z axis is the link's joint. Both arms are alike.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from qpsafe.robots.bodywork import Part, Points, block, dispenser, drum, lathe, rewrite, ring, write_blocks

XML = Path(__file__).resolve().parent / "robot.xml"
ORDER = (1, 2, 7, 3, 4, 5, 6)  # joints along an arm, as the maker numbers them
ARMS = ("left", "right")

# Every body is drawn in its own frame.
ORIGIN = {"torso": (0.0, 0.0, 0.0)}
ORIGIN |= {f"{arm}_link_{joint}": (0.0, 0.0, 0.0) for arm in ARMS for joint in ORDER}
ORIGIN |= {f"{arm}_tool": (0.0, 0.0, 0.0) for arm in ARMS}

MATERIALS = {
    "paint": 'rgba="0.80 0.81 0.82 1" specular="0.35" shininess="0.45"',
    "graphite": 'rgba="0.17 0.175 0.18 1" specular="0.3" shininess="0.4"',
    "pad": 'rgba="0.47 0.49 0.51 1" specular="0.1" shininess="0.2"',
    "steel": 'rgba="0.66 0.67 0.69 1" specular="0.7" shininess="0.7"',
}


def parts() -> list[Part]:
    """All pieces of the robot."""
    pieces: list[Part] = []

    def add(body: str, name: str, points: Points, material: str = "paint", collides: bool = False) -> None:
        pieces.append(Part(body, name, points, material, collides))

    # torso: foot plate, controller cabinet behind, a chest that leans forwards to the shoulders
    add("torso", "plate", block((-0.20, 0.14), (-0.17, 0.17), (0.0, 0.03), 0.010), collides=True)
    add("torso", "cabinet", block((-0.19, 0.05), (-0.135, 0.135), (0.025, 0.30), 0.025), collides=True)
    waist = block((-0.17, 0.03), (-0.11, 0.11), (0.28, 0.32), 0.015)
    chest = np.vstack([block((-0.115, 0.045), (-0.085, 0.085), (0.36, 0.46), 0.025), waist])
    add("torso", "chest", chest, collides=True)
    add("torso", "panel", block((0.047, 0.054), (-0.10, 0.10), (0.08, 0.25), 0.003), "graphite")

    for arm in ARMS:
        links = {joint: f"{arm}_link_{joint}" for joint in ORDER}

        # axis 1: shoulder on the torso; axis 2 lies across it at (0.03, 0, 0.1)
        neck = lathe("z", (0.0, 0.0), (0.002, 0.044), (0.010, 0.050), (0.060, 0.050))
        hub = drum("y", (0.03, 0.10), -0.050, 0.050, 0.044, 0.006)
        add(links[1], "shoulder", np.vstack([neck, hub]), collides=True)

        # axis 2: the upper arm runs along y to axis 7
        hinge = drum("z", (0.0, 0.0), -0.040, 0.040, 0.052, 0.006)
        sleeve = np.vstack([ring("y", 0.085, (-0.03, 0.0), 0.046), ring("y", 0.100, (-0.03, 0.0), 0.044)])
        add(links[2], "arm", np.vstack([hinge, sleeve]), collides=True)

        # axis 7: the upper arm's other half, to the elbow, axis 3 across at (-0.0405, 0, 0.2515)
        sleeve = lathe("z", (0.0, 0.0), (0.102, 0.042), (0.108, 0.046), (0.170, 0.046), (0.185, 0.043))
        add(links[7], "arm", sleeve, collides=True)
        hub = drum("y", (-0.0405, 0.2515), -0.046, 0.046, 0.036, 0.006)
        yoke = block((-0.045, 0.030), (-0.036, 0.036), (0.160, 0.190), 0.008)
        add(links[7], "elbow", np.vstack([hub, yoke]), collides=True)

        # axis 3: the forearm runs along y to axis 4
        hinge = drum("z", (0.0, 0.0), -0.036, 0.036, 0.044, 0.006)
        sleeve = np.vstack([ring("y", 0.070, (0.0405, 0.0), 0.041), ring("y", 0.085, (0.0405, 0.0), 0.039)])
        add(links[3], "forearm", np.vstack([hinge, sleeve]), collides=True)

        # axis 4: the forearm's other half, to the wrist, axis 5 across at (-0.027, 0, 0.265)
        sleeve = lathe("z", (0.0, 0.0), (0.087, 0.037), (0.093, 0.040), (0.170, 0.037), (0.200, 0.034))
        add(links[4], "forearm", sleeve, collides=True)
        hub = drum("y", (-0.027, 0.265), -0.038, 0.038, 0.026, 0.005)
        yoke = block((-0.030, 0.020), (-0.029, 0.029), (0.185, 0.210), 0.006)
        add(links[4], "wrist", np.vstack([hub, yoke]), collides=True)

        # axis 5: a small housing; axis 6: the flange, 0.036 m along it
        hinge = drum("z", (0.0, 0.0), -0.030, 0.030, 0.031, 0.005)
        nose = ring("y", 0.014, (0.027, 0.0), 0.029)
        add(links[5], "housing", np.vstack([hinge, nose]), collides=True)
        add(links[6], "flange", lathe("z", (0.0, 0.0), (0.015, 0.027), (0.018, 0.029), (0.036, 0.029)), "steel", True)

        # grey pads on both halves of the arm, and dark caps on the axes that lie across it
        add(links[2], "pad", lathe("y", (-0.03, 0.0), (0.052, 0.0462), (0.082, 0.0475)), "pad")
        add(links[7], "pad", drum("z", (0.0, 0.0), 0.118, 0.155, 0.0472, 0.002), "pad")
        add(links[3], "pad", lathe("y", (0.0405, 0.0), (0.045, 0.0415), (0.068, 0.0422)), "pad")
        add(links[4], "pad", lathe("z", (0.0, 0.0), (0.105, 0.0405), (0.107, 0.0410), (0.140, 0.0395)), "pad")
        for joint, centre, out, radius in (
            (1, (0.03, 0.10), 0.046, 0.034),
            (7, (-0.0405, 0.2515), 0.042, 0.027),
            (4, (-0.027, 0.265), 0.035, 0.019),
        ):
            for side in (-1.0, 1.0):
                low, high = sorted((side * out, side * (out + 0.007)))
                add(
                    links[joint],
                    f"cap_{'right' if side < 0 else 'left'}",
                    drum("y", centre, low, high, radius, 0.002),
                    "graphite",
                )

        dispenser(add, f"{arm}_tool")
    return pieces


def build(text: str) -> str:
    """The text of robot.xml with its marked blocks written anew."""
    return write_blocks(text, parts(), ORIGIN, MATERIALS)


if __name__ == "__main__":
    sys.exit(rewrite(XML, build, __doc__))
