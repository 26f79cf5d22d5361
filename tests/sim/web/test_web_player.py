"""Where somebody has put the slider of a recorded run, it stays: whatever plays it meanwhile, in another thread."""

import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace

import numpy as np
import pytest

import qpsafe
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.recording.run_file import FPS, StateRecorder, read_run, write_run
from qpsafe.sim.replay.replay import replay
from qpsafe.sim.replay.settings import settings_of
from qpsafe.sim.web import player as module
from qpsafe.sim.web.player import Kept, Player
from qpsafe.sim.web.server import Page

pytestmark = pytest.mark.long

LENGTH = 2.0  # of the run [s]


@pytest.fixture
def player(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Player]:
    """One that plays as if somebody looked, with nothing to draw; whoever asks for that gives way to other threads."""
    experiment, states = FixedExperiment(qpsafe.load_robot("irb140"), duration=LENGTH), StateRecorder()
    file = tmp_path / "run.npz"
    write_run(file, experiment.run(states.observe), settings_of(experiment), experiment.robot, states)
    run = read_run(file)
    kept = Kept(run, experiment)
    replay(run, kept.watch, experiment)
    monkeypatch.setattr(Page, "watched", property(lambda _: time.sleep(2e-4) is None))
    monkeypatch.setattr(module, "IDLE", 0.0)
    page = Page("127.0.0.1", 0, "a run")
    made, end = Player(kept, page), Event()
    monkeypatch.setattr(made.view, "show", lambda *_, **__: None)
    monkeypatch.setattr(made.view.plots, "put", lambda _: None)
    thread = Thread(target=made.serve, args=(end.is_set,))
    thread.start()
    yield made
    end.set()
    thread.join()
    page.close()


def test_no_seek_is_lost_to_a_run_that_plays(player: Player) -> None:
    for at in np.random.default_rng(0).integers(0, round(LENGTH * FPS), 300) / FPS:
        player.playing = True
        time.sleep(1e-4)
        player._sought(SimpleNamespace(client=0, target=SimpleNamespace(value=at)))
        time.sleep(1e-3)
        assert player.position == round(at * FPS)
