"""`qpsafe`: the command line. Heavy parts are imported by the commands that use them."""

from __future__ import annotations

import errno
import io
import signal
import sys
from typing import Annotated

import typer

from qpsafe import __version__
from qpsafe.cli import bench, check_program, compare, replay, robots, story, tune, web
from qpsafe.cli.campaign.app import app as campaigns
from qpsafe.cli.common import Group, console
from qpsafe.cli.demos.app import app as demos
from qpsafe.cli.idle import check_all
from qpsafe.cli.irc5 import irc5_faults, irc5_sim, stream
from qpsafe.cli.sensors import calibrate, calibrate_camera, place, sick_sensors
from qpsafe.errors import QpsafeError

app = typer.Typer(
    cls=Group,
    help="Danger-aware hierarchical QP control for robot arms that share their space with people.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # help is plain text: "[s]" is a unit
)
app.add_typer(demos, name="demo")
app.add_typer(campaigns, name="campaign")
app.command("compare")(compare.compare)
app.add_typer(robots.app, name="robots")
app.command("tune")(tune.tune)
app.command("bench")(bench.bench)
app.command("check")(check_program.check)
app.command("calibrate")(calibrate.calibrate)
app.command("calibrate-camera")(calibrate_camera.calibrate_camera)
app.command("story")(story.story)
app.command("replay")(replay.replay)
app.command("web")(web.web)
app.command("place")(place.place)
app.command("sick-sensors")(sick_sensors.sick_sensors)
app.command("stream")(stream.stream)
app.command("irc5-sim")(irc5_sim.irc5_sim)
app.command("irc5-faults")(irc5_faults.irc5_faults)
check_all(app)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"qpsafe {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


class _Interrupted(BaseException):
    """Ctrl-C; a class of its own, since typer would turn KeyboardInterrupt into a bare exit code 1."""


def _interrupt(*_: object) -> None:
    raise _Interrupted


def main() -> None:
    """Entry point: errors a person can mend are one line, without a traceback; Ctrl-C leaves no half files."""
    signal.signal(signal.SIGINT, _interrupt)
    signal.signal(signal.SIGTERM, _interrupt)
    if isinstance(sys.stdout, io.TextIOWrapper):  # what it cannot show is spelt, as on standard error
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        app()
    except QpsafeError as error:
        _say(f"qpsafe: {error}", "red")
        sys.exit(1)
    except OSError as error:  # a full disk, a folder that has gone meanwhile
        if error.filename is None and error.errno not in _FULL:
            raise
        _say(f"qpsafe: {error.filename or 'writing'}: {error.strerror}", "red")
        sys.exit(1)
    except (_Interrupted, KeyboardInterrupt):
        _say("qpsafe: interrupted, nothing unfinished was left behind", "yellow")
        sys.exit(130)


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def _say(line: str, style: str) -> None:
    """One line on standard error."""
    console(True).print(line, style=style, soft_wrap=True)
