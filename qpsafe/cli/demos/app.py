"""`qpsafe demo`: the paper's experiments in MuJoCo."""

from __future__ import annotations

import typer

from qpsafe.cli.common import Group
from qpsafe.cli.demos.fast_person import fast_person
from qpsafe.cli.demos.fixed import fixed
from qpsafe.cli.demos.path import path
from qpsafe.cli.demos.pick_and_place import pick_and_place

app = typer.Typer(cls=Group, help="Run the paper's experiments in MuJoCo.", no_args_is_help=True)
app.command("fixed")(fixed)
app.command("path")(path)
app.command("fast-person")(fast_person)
app.command("pick-and-place")(pick_and_place)
