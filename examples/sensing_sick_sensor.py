"""A sensor dies while somebody stands before it: what was seen is held and comes nearer, then the robot goes slowly."""

import numpy as np

import qpsafe


def main() -> None:
    robot = qpsafe.load_robot("irb140")
    here = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    controller = qpsafe.SafetyController(robot, tasks)
    assert controller.spots is not None
    names = controller.spots.names
    broken = names.index("wrist top 8")

    q, qd = robot.home, np.zeros(6)
    print(" time   reads  points  CDF_n   status    severity")
    for k in range(120):
        distances = np.full(len(names), np.inf)
        distances[broken] = 0.45 if k < 30 else np.nan  # its cable breaks at 0.12 s
        tick = controller.step(q, qd, distances)
        q, qd = tick.reference.q, tick.reference.qd  # a robot that follows perfectly
        if k % 10 == 0 or k in (30, 34):
            row = f"{tick.reference.time:5.2f}  {distances[broken]:6.2f}  {len(tick.points):6d}  {tick.cdf_n:5.2f}"
            print(f"{row}   {tick.status:8s}  {tick.severity}")
    print(tick.messages[0])

    mended = np.full(len(names), np.inf)
    print("mended:", controller.step(q, qd, mended).severity)  # severity only rises ...
    controller.acknowledge()  # ... until a person has looked
    print("acknowledged:", controller.step(q, qd, mended).severity)


if __name__ == "__main__":
    main()
