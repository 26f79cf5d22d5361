"""`qpsafe calibrate-camera`: where a camera that is fixed in space is, from the robot's own motion in its view."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import RobotName, console, load_named, print_json, write_text
from qpsafe.cli.outputs import keep_apart, output_file

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.ranging.extrinsics.calibrate import CameraCalibration


def calibrate_camera(
    file: Annotated[Path, typer.Argument(help=".npz file, or a folder of them: q, and depth or distances.")],
    cell: Annotated[Path, typer.Argument(help="TOML file of the cell, with a [[camera]] table.")],
    camera: Annotated[str | None, typer.Option(help="Name of the camera; the cell's only one by default.")] = None,
    robot: RobotName = "irb140",
    guess: Annotated[
        bool, typer.Option("--guess", help="Begin with the pose in the file, right within 0.2 m and 20 degrees.")
    ] = False,
    tolerance: Annotated[
        float, typer.Option(min=0.0, help="Largest root mean square residual along the rays [m].")
    ] = 0.03,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the cell with the camera's pose to this file.", callback=output_file(".toml")),
    ] = None,
    write: Annotated[bool, typer.Option("--write", help="Write the pose into the cell's own file.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Find the pose of a camera fixed in space: what moves in its images is laid on the robot's own geometry.

    Exit code 1, and nothing is written, if the residual is above the tolerance, or if the images do not tell the pose:
    says which direction they leave open.
    """
    own = ("CELL, which --write writes into", cell)
    keep_apart("qpsafe calibrate-camera", ("FILE", file), own, ("--out", out))
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.ranging.extrinsics import calibrate
    from qpsafe.ranging.extrinsics.cell_text import pose_lines, with_pose
    from qpsafe.ranging.extrinsics.recording import load_recording

    text, number, sensor, has_pose = _camera(cell, camera)
    if guess and not has_pose:
        from qpsafe.errors import ConfigurationError

        raise ConfigurationError(cell, f"camera[{number}].position", "nothing", "a pose to begin with, or no --guess")
    if write or out is not None:
        with_pose(text, number, sensor.pose)  # whether it can be put there
    found = load_named(robot, screen)
    images = load_recording(file, sensor, found)
    result = calibrate.calibrate_camera(found, images, sensor.pose if guess else None)
    good = not result.weak and result.rms <= tolerance
    target = (cell if write else out) if good else None
    if target is not None:
        remark = f"calibrated: {result.images} images, residual {1e3 * result.rms:.1f} mm"
        write_text(target, with_pose(text, number, result.pose, remark))
    if json:
        print_json(_row(sensor.name, result) | {"good": good, "file": None if target is None else str(target)})
    else:
        _show(sensor.name, result, tolerance, screen)
        if target is not None:
            screen.print(f"written to {target}")
        elif good:
            screen.print("\n".join(pose_lines(result.pose)))
        elif write or out is not None:
            screen.print("nothing is written", style="yellow")
    if not good:
        raise typer.Exit(1)


def _camera(cell: Path, name: str | None) -> tuple[str, int, Any, bool]:
    """Text of the cell's file, number of the camera in it, the camera, and whether it has a pose."""
    from qpsafe.errors import ConfigurationError
    from qpsafe.ranging.cell_cameras import camera_of
    from qpsafe.sensing.cell_file import read_cell

    text, content = read_cell(cell)
    names = [table.name for table in content.camera]
    if name is None and len(names) != 1:
        raise ConfigurationError(cell, "camera", f"{len(names)} of them", "one, or its name by --camera")
    if name is not None and names.count(name) != 1:
        raise ConfigurationError(cell, "--camera", name, f"the name of one: {', '.join(names) or 'there is none'}")
    number = 0 if name is None else names.index(name)
    table = content.camera[number]
    return text.text, number, camera_of(table, text, number), table.position is not None


def _row(name: str, result: CameraCalibration) -> dict[str, Any]:
    from qpsafe.ranging.cell_cameras import quaternion_of

    place, turn = result.deviation
    return {
        "camera": name,
        "position": result.pose[:3, 3],
        "quaternion": quaternion_of(result.pose[:3, :3]),
        "covariance": result.covariance,
        "centre": result.centre,
        "deviation": place,
        "deviation_angle": turn,
        "rms": result.rms,
        "explained": result.explained,
        "through": result.through,
        "images": result.images,
        "rays": result.points,
        "weak": list(result.weak),
    }


def _show(name: str, result: CameraCalibration, tolerance: float, screen: Console) -> None:
    from rich.text import Text

    from qpsafe.cli.sheet import Sheet

    row = _row(name, result)
    place, turn = result.deviation
    sheet = Sheet(f"Pose of the camera {name} in the robot's base frame", ("", "value"))
    sheet.add_row("position [m]", ", ".join(f"{x:.4f}" for x in row["position"]))
    sheet.add_row("quaternion w, x, y, z", ", ".join(f"{x:.5f}" for x in row["quaternion"]))
    sheet.add_row("deviation at the robot, worst direction [mm]", f"{1e3 * place:.2f}")
    sheet.add_row("deviation, worst axis [deg]", f"{degrees(turn):.3f}")
    colour = "green" if result.rms <= tolerance else "red"
    sheet.add_row("residual along the rays, rms [mm]", Text(f"{1e3 * result.rms:.1f}", colour))
    sheet.add_row("of what moves, where the robot should be", f"{100 * result.explained:.1f} %")
    sheet.add_row("of the robot, seen through", f"{100 * result.through:.1f} %")
    sheet.add_row("images with motion", str(result.images))
    sheet.add_row("rays that meet the robot", str(result.points))
    screen.print(sheet)
    for line in result.weak:
        screen.print(f"not told by these images: {line}", style="red")
