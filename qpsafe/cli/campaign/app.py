"""The group of commands; without the name of one, a campaign is run."""

from __future__ import annotations

import typer

from qpsafe.cli.campaign.limit import limit
from qpsafe.cli.campaign.run import report, run
from qpsafe.cli.campaign.single import show, worst
from qpsafe.cli.common import Group


class CampaignGroup(Group):
    """`qpsafe campaign FILE.toml` is `qpsafe campaign run FILE.toml`."""

    default = "run"


app = typer.Typer(cls=CampaignGroup, help="Judge controllers by thousands of encounters with people.")
app.command("run")(run)
app.command("show")(show)
app.command("worst")(worst)
app.command("limit")(limit)
app.command("report")(report)
