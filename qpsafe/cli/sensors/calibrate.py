"""`qpsafe calibrate`: identify the curves of the distance sensors from a person's own measurements."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import console, print_json, write_text
from qpsafe.cli.outputs import DRAWN, keep_apart, output_file, try_file
from qpsafe.extras import require

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sensing.skin.calibration import Fit


def calibrate(
    file: Annotated[
        Path,
        typer.Argument(help="CSV with the columns spot, distance [m, cm or mm], voltage [V or mV]."),
    ],
    robot: Annotated[
        str | None, typer.Option(help="Robot folder to write calibration.toml to; the file must cover all its spots.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the curves to this file instead.", callback=output_file())
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Also draw curves and residuals to this PNG file.", callback=output_file(*DRAWN)),
    ] = None,
    tolerance: Annotated[float, typer.Option(min=0.0, help="Tolerance that 95 % of the pairs must meet [m].")] = 0.01,
    any_sensor: Annotated[
        bool, typer.Option("--any-sensor", help="Accept voltages unlike those of a Sharp GP2Y0A02YK.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Fit each spot's curve V(d) = gain/(d + offset) + bias robustly to the pairs between 20 and 80 cm.

    Shows the residuals. Exit code 1 if those of a spot exceed the tolerance, the pairs left out that are plainly wrong,
    or if these are more than a tenth (the curves are written all the same).
    """
    from qpsafe.sensing.skin.calibration import calibration_text, fit_all
    from qpsafe.sensing.skin.pairs_file import read_pairs

    screen = console(json)
    target = _target(robot, out)
    keep_apart("qpsafe calibrate", ("FILE", file), ("--robot" if out is None else "--out", target), ("--plot", plot))
    fits = fit_all(read_pairs(file))
    if not any_sensor:
        _check_plausible(fits, file)
    if robot is not None:
        _check_names(robot, [fit.spot for fit in fits], file)
    write_text(target, calibration_text(fits))
    if plot is not None:
        _plot(fits, plot)
    good = all(_is_good(fit, tolerance) for fit in fits)
    if json:
        print_json({"file": str(target), "good": good, "spots": [_row(fit) for fit in fits]})
    else:
        _show(fits, tolerance, screen)
        screen.print(f"written to {target}" + (f", {plot}" if plot else ""))
    if not good:
        raise typer.Exit(1)


def _target(robot: str | None, out: Path | None) -> Path:
    """Where to write: never into an installed package without being told so."""
    from qpsafe.errors import ConfigurationError
    from qpsafe.robot.loader import bundled_robots
    from qpsafe.sensing.skin.calibration import FILE_NAME

    if out is not None:
        return out
    if robot is None:
        raise ConfigurationError("calibrate", "--robot", None, "a robot folder to write into, or a file by --out")
    if robot in bundled_robots() and not os.path.isdir(robot):
        expected = "a path of your own copy of the robot's folder, or a file by --out: bundled robots are not changed"
        raise ConfigurationError("calibrate", "--robot", robot, expected)
    if not os.path.isfile(Path(robot) / "robot.toml"):
        raise ConfigurationError("calibrate", "--robot", robot, "a folder with a robot.toml")
    try_file("qpsafe calibrate", "--robot", Path(robot) / FILE_NAME)
    return Path(robot) / FILE_NAME


def _check_names(robot: str, found: list[str], file: Path) -> None:
    from qpsafe.errors import ConfigurationError
    from qpsafe.robot.loader import load_robot
    from qpsafe.sensing.skin.spots import load_spots

    spots = load_spots(load_robot(robot))
    names = spots.names if spots is not None else ()
    for name in found:
        if name not in names:
            expected = f"a spot of {robot}: {', '.join(names) or 'it has none'}"
            raise ConfigurationError(file, "spot", name, expected)
    for name in names:
        if name not in found:
            raise ConfigurationError(file, "spot", None, f"pairs of spot {name!r} too")


def _check_plausible(fits: list[Fit], file: Path) -> None:
    from qpsafe.errors import ConfigurationError
    from qpsafe.sensing.skin.calibration import implausible

    for fit in fits:
        odd = implausible(fit)
        if odd is not None:
            expected = "metres and volts of a Sharp GP2Y0A02YK; for another sensor say --any-sensor"
            raise ConfigurationError(file, f"pairs of {fit.spot}", odd, expected)


def _is_good(fit: Fit, tolerance: float) -> bool:
    return fit.error_95 <= tolerance and fit.few_wrong


def _row(fit: Fit) -> dict[str, float | str | int]:
    curve = fit.curve
    return {
        "spot": fit.spot,
        "gain": curve.gain,
        "offset": curve.offset,
        "bias": curve.bias,
        "pairs": len(fit.distances),
        "ignored": fit.ignored,
        "wrong": int(fit.wrong.sum()),
        "rms": float((fit.errors**2).mean() ** 0.5),
        "error_95": fit.error_95,
        "worst": float(abs(fit.errors).max()),
        "within_1_cm": fit.share_within_1_cm,
    }


def _show(fits: list[Fit], tolerance: float, screen: Console) -> None:
    from rich.text import Text

    from qpsafe.cli.sheet import Sheet

    headings = ("spot", "pairs", "ignored", "wrong", "rms [cm]", "95 % [cm]", "worst [cm]", "within 1 cm")
    sheet = Sheet("Distance by the fitted curve minus true distance", headings)
    for fit in fits:
        row = _row(fit)
        colour = "green" if _is_good(fit, tolerance) else "red"
        sheet.add_row(
            fit.spot,
            str(row["pairs"]),
            str(row["ignored"]),
            str(row["wrong"]),
            f"{100 * float(row['rms']):.2f}",
            Text(f"{100 * fit.error_95:.2f}", colour),
            f"{100 * float(row['worst']):.2f}",
            f"{100 * fit.share_within_1_cm:.1f} %",
        )
    screen.print(sheet)
    for fit in fits:
        for d, v in zip(fit.distances[fit.wrong], fit.voltages[fit.wrong], strict=True):
            screen.print(f"{fit.spot}: the pair of {d:.3f} m and {v:.3f} V is left out as wrong", style="yellow")


def _plot(fits: list[Fit], path: Path) -> None:
    require("plots", "--plot", "matplotlib")
    import matplotlib

    matplotlib.use("Agg")
    from qpsafe.sensing.skin.calibration_plot import calibration_figure
    from qpsafe.text.figure_file import save

    with matplotlib.rc_context({"savefig.dpi": 160}):
        save(calibration_figure(fits), path)
