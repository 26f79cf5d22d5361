"""Write the body of the LBR iiwa 14 into robot.xml: what is seen (group 2) and what collides (group 3).

Run it from anywhere: ``python robots/iiwa14/build_body.py`` rewrites the blocks between the "body" markers of robot.xml
and nothing else; with ``--check`` it only says whether they are up to date (exit code 1 if not).

Everything is made here from a few figures chosen by us: the axes are where the published kinematics has them, the shape
around them is our own. No public mesh was used. Figures below are metres in the BASE frame with all joints at zero: the
arm then stands straight up along z. Each body's origin is subtracted on writing.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from qpsafe.robots.bodywork import Part, Points, block, dispenser, drum, lathe, rewrite, write_blocks

XML = Path(__file__).resolve().parent / "robot.xml"

# Origins of the bodies at the zero pose; must agree with robot.xml (a test compares).
SHOULDER, ELBOW, WRIST, FLANGE = 0.360, 0.780, 1.180, 1.306
ORIGIN = {
    "base": (0.0, 0.0, 0.0),
    "link_1": (0.0, 0.0, SHOULDER),
    "link_2": (0.0, 0.0, SHOULDER),
    "link_3": (0.0, 0.0, ELBOW),
    "link_4": (0.0, 0.0, ELBOW),
    "link_5": (0.0, 0.0, WRIST),
    "link_6": (0.0, 0.0, WRIST),
    "link_7": (0.0, 0.0, FLANGE),
    "tool": (0.0, 0.0, 0.0),  # drawn in its own frame, z out of the flange
}

MATERIALS = {
    "paint": 'rgba="0.66 0.68 0.71 1" specular="0.4" shininess="0.5"',
    "accent": 'rgba="0.95 0.42 0.08 1" specular="0.3" shininess="0.4"',
    "graphite": 'rgba="0.17 0.175 0.18 1" specular="0.3" shininess="0.4"',
    "steel": 'rgba="0.66 0.67 0.69 1" specular="0.7" shininess="0.7"',
}


def parts() -> list[Part]:
    """All pieces of the robot."""
    pieces: list[Part] = []

    def add(body: str, name: str, points: Points, material: str = "paint", collides: bool = False) -> None:
        pieces.append(Part(body, name, points, material, collides))

    # base: foot plate, round column up to axis 1, plugs behind
    add("base", "plate", lathe("z", (0.0, 0.0), (0.0, 0.130), (0.022, 0.130), (0.030, 0.122)), collides=True)
    column = lathe("z", (0.0, 0.0), (0.028, 0.112), (0.060, 0.108), (0.130, 0.098), (0.150, 0.090))
    add("base", "column", column, collides=True)
    add("base", "box", block((-0.140, -0.06), (-0.055, 0.055), (0.012, 0.095), 0.008), collides=True)
    for i, cy in enumerate((-0.028, 0.028)):
        add("base", f"plug_{i}", drum("x", (cy, 0.055), -0.149, -0.135, 0.018, 0.002), "graphite")

    # A joint across the arm is two half drums, one of either link; along it, two collars with a ring of colour between.
    _along(add, "link_1", 0.152, 0.155, SHOULDER, 0.090, 0.095, side=-1.0)
    _across(add, "link_2", SHOULDER, 0.574, 0.095, 0.086, side=1.0)
    _along(add, "link_3", 0.576, 0.579, ELBOW, 0.084, 0.089, side=1.0)
    _across(add, "link_4", ELBOW, 0.984, 0.089, 0.078, side=-1.0)

    # link 5: forearm's upper half, narrowing to a tongue behind the wrist, which leaves axis 6 room to turn
    add("link_5", "ring", drum("z", (0.0, 0.0), 0.985, 0.990, 0.0775, 0.001), "accent")
    tube = lathe("z", (0.0, 0.0), (0.989, 0.072), (0.993, 0.076), (1.040, 0.074), (1.090, 0.060), (1.095, 0.055))
    add("link_5", "tube", tube, collides=True)
    eye = drum("y", (0.0, WRIST), -0.078, -0.050, 0.052, 0.008)
    root = block((-0.045, 0.045), (-0.072, -0.030), (1.030, 1.080), 0.008)
    add("link_5", "tongue", np.vstack([eye, root]), collides=True)
    add("link_5", "cap", drum("y", (0.0, WRIST), -0.083, -0.070, 0.040, 0.003), "graphite")

    # link 6: a ball of a housing beside the tongue; link 7: the flange with its ring of holes
    housing = np.vstack([
        lathe("y", (0.0, WRIST), (-0.048, 0.056), (-0.020, 0.070), (0.030, 0.070), (0.062, 0.052), (0.068, 0.040)),
        lathe("z", (0.0, 0.0), (1.225, 0.060), (1.258, 0.052)),
    ])  # fmt: skip
    add("link_6", "housing", housing, collides=True)
    add("link_6", "cap", drum("y", (0.0, WRIST), 0.060, 0.074, 0.034, 0.003), "graphite")
    add("link_7", "ring", drum("z", (0.0, 0.0), 1.259, 1.264, 0.0505, 0.001), "accent")
    flange = lathe("z", (0.0, 0.0), (1.262, 0.045), (1.266, 0.049), (1.292, 0.049), (FLANGE, 0.0315))
    add("link_7", "flange", flange, "steel", collides=True)
    for i, angle in enumerate(np.deg2rad(np.arange(7) * 45.0)):  # seven holes, as on an ISO 9409 flange of 50 mm
        place = (0.025 * np.cos(angle), 0.025 * np.sin(angle))
        add("link_7", f"hole_{i}", drum("z", place, 1.300, 1.3063, 0.003, 0.0005), "graphite")

    dispenser(add)
    return pieces


def _along(add, body: str, ring: float, low: float, joint: float, radius: float, drum_radius: float, side: float):  # type: ignore[no-untyped-def]
    """A link that turns about z on a ring and carries the next axis across: collar, neck and half a drum at its top."""
    add(body, "ring", drum("z", (0.0, 0.0), ring, ring + 0.006, radius + 0.001, 0.001), "accent")
    outer, inner = side * drum_radius, -side * 0.012
    hinge = drum("y", (0.0, joint), min(outer, inner), max(outer, inner), drum_radius, 0.012)
    collar = lathe("z", (0.0, 0.0), (low + 0.002, radius - 0.003), (low + 0.006, radius), (joint - 0.13, radius))
    add(body, "neck", np.vstack([collar, hinge]), collides=True)
    face = (outer - side * 0.010, outer + side * 0.004)
    cap = drum("y", (0.0, joint), min(face), max(face), 0.7 * drum_radius, 0.003)
    add(body, "cap", cap, "graphite")


def _across(add, body: str, joint: float, high: float, drum_radius: float, radius: float, side: float):  # type: ignore[no-untyped-def]
    """A link that turns about y: the other half of the drum, a neck and the collar on which the next link turns."""
    outer, inner = side * drum_radius, side * 0.015
    hinge = drum("y", (0.0, joint), min(outer, inner), max(outer, inner), drum_radius, 0.012)
    shoulder = lathe("z", (0.0, side * 0.02), (joint + 0.10, radius - 0.012), (joint + 0.13, radius - 0.006))
    add(body, "hinge", np.vstack([hinge, shoulder]), collides=True)
    rings = ((joint + 0.112, radius - 0.010), (joint + 0.135, radius), (high - 0.004, radius), (high, radius - 0.003))
    collar = lathe("z", (0.0, 0.0), *rings)
    add(body, "neck", collar, collides=True)
    face = (outer - side * 0.010, outer + side * 0.004)
    cap = drum("y", (0.0, joint), min(face), max(face), 0.7 * drum_radius, 0.003)
    add(body, "cap", cap, "graphite")


def build(text: str) -> str:
    """The text of robot.xml with its marked blocks written anew."""
    return write_blocks(text, parts(), ORIGIN, MATERIALS)


if __name__ == "__main__":
    sys.exit(rewrite(XML, build, __doc__))
