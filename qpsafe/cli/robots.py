"""`qpsafe robots`: list the bundled robots, or inspect one."""

from __future__ import annotations

from typing import Annotated

import typer

from qpsafe.cli.common import console, print_json


def robots(
    name: Annotated[str | None, typer.Argument(help="A bundled name, or a path to a robot folder.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON to standard output.")] = False,
) -> None:
    """List the bundled robots, or show joints, frames, wire and spots of one (which checks all its files)."""
    import numpy as np
    from rich.table import Table

    from qpsafe.robot.loader import bundled_robots, load_robot
    from qpsafe.sensing.spots import load_spots

    screen = console(json)
    if name is None:
        names = bundled_robots()
        if json:
            print_json(names)
        else:
            for item in names:
                screen.print(f"{item}: {load_robot(item).title}", highlight=False)
        return
    robot = load_robot(name)
    spots = load_spots(robot)
    if json:
        print_json(
            {
                "name": robot.name,
                "title": robot.title,
                "joints": {
                    joint: {
                        "lower": robot.lower[i],
                        "upper": robot.upper[i],
                        "max_velocity": robot.max_velocity[i],
                        "max_acceleration": robot.max_acceleration[i],
                        "home": robot.home[i],
                    }
                    for i, joint in enumerate(robot.joint_names)
                },
                "frames": robot.frame_names,
                "wire": robot.wire_frames,
                "spots": spots.names if spots else [],
            }
        )
        return
    table = Table(title=f"{robot.title}: joints")
    for heading in ("joint", "lower [deg]", "upper [deg]", "speed [deg/s]", "acceleration [deg/s²]", "home [deg]"):
        table.add_column(heading, justify="left" if heading == "joint" else "right")
    columns = (robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, robot.home)
    for i, joint in enumerate(robot.joint_names):
        table.add_row(joint, *(f"{np.rad2deg(column[i]):.1f}" for column in columns))
    screen.print(table)
    screen.print("frames: " + ", ".join(robot.frame_names), highlight=False)
    screen.print("wire:   " + ", ".join(f"{a}-{b}" for a, b in robot.wire_frames), highlight=False)
    if spots is not None:
        ranges = f"range {spots.range_min.min()} to {spots.range_max.max()} m"
        screen.print(f"spots:  {len(spots)}, {ranges}: {', '.join(spots.names)}")
