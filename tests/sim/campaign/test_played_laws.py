"""Whole runs in one compiled call, with every law: the same as tick by tick."""

import numpy as np
import pytest
from amounts import first

from qpsafe.sim.campaign.opponents.registry import opponent
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.play import play
from qpsafe.sim.campaign.trials.recording import record
from qpsafe.sim.campaign.trials.senses import Senses


@pytest.mark.parametrize("name", first(2, ["paper", "weighted", "nullspace"]))
def test_a_run_is_the_same_in_one_compiled_call(name: str) -> None:
    """1.6 s of an encounter with somebody near, in the line motion."""
    met, entry = meeting(Plan(motions=("line",)), 5), opponent(name)
    senses = [Senses(met.station, met.tracks, "ideal", met.seed) for _ in range(2)]
    played = play(met.station, entry, senses[0], 400, 0.02)
    asked = record(met.station, entry, senses[1], 400, 0.02)
    assert played is not None
    for one, other in zip(played[1:5], asked[1:5], strict=True):
        assert np.abs(one - other).max() <= 1e-12
    assert (played.phase == asked.phase).all()
    assert (played.status == asked.status).all()
