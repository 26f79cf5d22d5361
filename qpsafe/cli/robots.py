"""`qpsafe robots`: list the robots, inspect one, or write a first robot.toml for a model of your own."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import Group, console, print_json, write_text
from qpsafe.cli.outputs import output_folder, try_folder
from qpsafe.text.whole_file import whole_file
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class _NameOrCommand(Group):
    """`qpsafe robots NAME` means `qpsafe robots inspect NAME`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        words = [word for word in args if not word.startswith("-")]
        if words and words[0] not in self.commands:
            args = ["inspect", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(cls=_NameOrCommand)


@app.callback(invoke_without_command=True)
def robots(
    context: typer.Context,
    json: Annotated[bool, typer.Option("--json", help="Write JSON to standard output.")] = False,
) -> None:
    """List the bundled robots; `robots NAME` inspects one, `robots add FILE` begins one of your own."""
    if context.invoked_subcommand is not None:
        context.default_map = {context.invoked_subcommand: {"json": json}}  # --json before the command is meant for it
        return
    from qpsafe.robot.loader import bundled_robots, load_robot

    names = bundled_robots()
    if json:
        print_json(names)
        return
    for item in names:
        console(json).print(f"{item}: {load_robot(item).title}")


@app.command()
def inspect(
    name: Annotated[str, typer.Argument(help="A bundled name, a robot folder, an MJCF or URDF file, PACKAGE:MODEL.")],
    json: Annotated[bool, typer.Option("--json", help="Write JSON to standard output.")] = False,
) -> None:
    """Show joints, frames, wire and spots of a robot (which checks all its files), and what is doubtful in them."""
    import numpy as np

    from qpsafe.cli.sheet import Sheet
    from qpsafe.danger.thresholds import robot_thresholds
    from qpsafe.ranging.sensor_file import load_range_sensors, range_sensor_files
    from qpsafe.sensing.skin.spots import load_spots

    screen = console(json)
    robot = _load(name)
    spots = load_spots(robot)
    arrays = {sensor: load_range_sensors(robot, file) for sensor, file in range_sensor_files(robot).items()}
    high, low = robot_thresholds(robot)
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
                "range_sensors": {sensor: [item.name for item in items] for sensor, items in arrays.items()},
                "tools": robot.tool_frames,
                "held": {joint: value for joint, (value, _) in robot.held.items()},
                "danger": {"delta": high.delta, "delta_f": low.delta},
                "notes": robot.notes,
            }
        )
        return
    headings = ("joint", "lower [deg]", "upper [deg]", "speed [deg/s]", "acceleration [deg/s²]", "home [deg]")
    sheet = Sheet(f"{robot.title}: joints", headings)
    columns = (robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, robot.home)
    for i, joint in enumerate(robot.joint_names):
        scale, name = (1e3, f"{joint} (slides: mm)") if robot.sliding[i] else (180.0 / np.pi, joint)
        sheet.add_row(name, *(f"{scale * column[i]:.1f}" for column in columns))
    screen.print(sheet)
    screen.print("frames: " + ", ".join(robot.frame_names))
    screen.print("wire:   " + ", ".join(f"{a}-{b}" for a, b in robot.wire_frames))
    if spots is not None:
        ranges = f"range {spots.range_min.min()} to {spots.range_max.max()} m"
        screen.print(f"spots:  {len(spots)}, {ranges}: {', '.join(spots.names)}")
    for sensor, items in arrays.items():
        zones = ", ".join(sorted({f"{item.shape[0]} x {item.shape[1]} zones" for item in items}))
        ranges = f"{zones}, range {min(i.range_min for i in items)} to {max(i.range_max for i in items)} m"
        screen.print(f"arrays: {len(items)} {sensor}, {ranges}: {', '.join(item.name for item in items)}")
    screen.print("tools:  " + ", ".join(robot.tool_frames))
    screen.print(f"danger: Δ = {high.delta:g}, Δ_f = {low.delta:g}")
    for note in robot.notes:
        screen.print(f"note:   {note}", style="yellow")


@app.command()
def add(
    file: Annotated[str, typer.Argument(help="An MJCF or URDF file, or PACKAGE:MODEL.")],
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the robot.toml; by default the model file's.", callback=output_folder),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing robot.toml.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write JSON to standard output.")] = False,
) -> None:
    """Write a first robot folder for a model file: limits, wire and frames as found, a home posture and sensors chosen.

    What was assumed and chosen is noted in it. Sensors that are there already, as spots.toml, are kept.
    """
    from qpsafe.errors import ConfigurationError
    from qpsafe.robot.loader import find_robot, load_quietly

    if find_robot(file).suffix == ".toml":
        raise ConfigurationError("robots add", "FILE", file, "an MJCF or URDF file: this robot has its robot.toml")
    robot = _load(file)
    folder = robot.folder if out is None else out
    path = folder / "robot.toml"
    if path.exists() and not force:
        raise ConfigurationError("robots add", "robot.toml", str(path), "no such file yet; --force writes over it")
    try_folder("qpsafe robots add", "FILE" if out is None else "--out", folder)
    text, spots, said = _first_files(robot, folder)
    folder.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
        again = load_quietly(robot.model_path, part)  # what does not load is not written
        if spots is not None:
            write_text(folder / "spots.toml", spots)  # before the file that names it
    if json:
        print_json({"file": str(path), "name": again.name, "joints": again.nq, "notes": said})
        return
    screen = console(json)
    screen.print(f"written: {path}" + ("" if spots is None else ", spots.toml"), soft_wrap=True)
    for note in said:
        screen.print(f"note: {note}", style="yellow")
    size = f"{counted(again.nq, 'joint')}, {counted(len(again.wire_frames), 'link')}"
    named = shlex.quote(str(folder))
    screen.print(f"{again.name}: {size}, see `qpsafe robots {named}`; it is the --robot {named}", soft_wrap=True)


def _first_files(robot: Robot, folder: Path) -> tuple[str, str | None, list[str]]:
    """Texts of a robot.toml and a spots.toml, None for no new one, and what was assumed and chosen.

    What is no arm, or is added where nothing can be simulated, gets what its file says.

    Args:
        robot: Loaded from the model file alone.
        folder: Where the files will stand.
    """
    from qpsafe.errors import ConfigurationError, MissingExtraError
    from qpsafe.extras import require
    from qpsafe.robot.robot_file.starting_file import starting_robot_toml

    there = "spots.toml" if (folder / "spots.toml").exists() else None
    try:
        require("sim", "the choice of a home posture and of sensors", "mujoco")
        from qpsafe.sim.experiments.shared.ready import check_arm, choices

        check_arm("robots add", robot, 1)
    except MissingExtraError as missing:
        said = [*robot.notes, str(missing)]
    except ConfigurationError as odd:
        said = [*robot.notes, f"no home posture and no sensors are chosen for {odd.value}: for {odd.expected} they are"]
    else:
        found = choices(robot, there is None)
        new = None if there or not found.sensors else found.spots_toml
        return found.robot_toml(folder, there if new is None else "spots.toml"), new, found.said
    return starting_robot_toml(robot, folder, spots=there, assumed=said), None, said


def _load(name: str) -> Robot:
    """The robot; its notes are printed, not warned of."""
    from qpsafe.robot.loader import load_quietly

    return load_quietly(name)
