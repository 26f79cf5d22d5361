"""The group of commands; without the name of one, a campaign is run."""

from __future__ import annotations

import os
from typing import Any

import typer

from qpsafe.cli.campaign.limit import limit
from qpsafe.cli.campaign.run import report, run
from qpsafe.cli.campaign.single import show, worst
from qpsafe.cli.common import Group
from qpsafe.errors import ConfigurationError


class CampaignGroup(Group):
    """`qpsafe campaign FILE.toml` is `qpsafe campaign run FILE.toml`."""

    default = "run"

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Name the commands where a word is none of them and no plan's file."""
        word = next(iter(args), "")
        known = not word or word.startswith("-") or word in self.commands or _may_be_file(word)
        if not (known or ctx.resilient_parsing):  # which completes words
            expected = f"a plan's TOML file that is there, or a command: {', '.join(self.commands)}"
            raise ConfigurationError("qpsafe campaign", "COMMAND", word, expected)
        return super().parse_args(ctx, args)


def _may_be_file(word: str) -> bool:
    return word.endswith(".toml") or os.path.exists(word)


app = typer.Typer(cls=CampaignGroup, help="Judge controllers by thousands of encounters with people.")
app.command("run")(run)
app.command("show")(show)
app.command("worst")(worst)
app.command("limit")(limit)
app.command("report")(report)
