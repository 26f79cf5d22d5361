"""Encounters with people at random: a model of who comes, how, and what for, over the unit cube."""

from qpsafe.sim.campaign.people.model import BUNDLED, EncounterModel

__all__ = ["BUNDLED", "EncounterModel"]
