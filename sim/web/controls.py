"""The page's switches: every change becomes a wish, and the newest wish states everything."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.laws.by_name import LAWS, PROJECTIONS
from qpsafe.robot.loader import bundled_robots, load_robot
from qpsafe.sim.web.live import PACES, RECORDING, Wish
from qpsafe.sim.web.setup import HOLD, MOVE, NOBODY, RANDOM, STRAIGHT, Setup, own_thresholds
from qpsafe.sim.world.sensor import SENSORS

if TYPE_CHECKING:
    from qpsafe.sim.web.channel import Outbound
    from qpsafe.sim.web.frame import Frame

CAP = (5.0, 40.0, 15.0)  # of the barrier: smallest, largest, first


class Wishes:
    """The newest wish, and its way to the simulation; callbacks of any thread change it.

    Args:
        setup: What is simulated first.
        outbound: To the simulation.
    """

    def __init__(self, setup: Setup, outbound: Outbound) -> None:
        self.now = Wish(setup=setup)
        self._outbound, self._lock, self._sent = outbound, threading.Lock(), 0

    def change(self, **fields: Any) -> None:
        """Change the wish: fields of `Wish`, or of its setup."""
        with self._lock:
            own = {name: value for name, value in fields.items() if name in Wish._fields}
            others = {name: value for name, value in fields.items() if name not in own}
            if others:
                own["setup"] = replace(self.now.setup, **others)
            self.now = self.now._replace(number=self.now.number + 1, **own)
            self._send()

    def remind(self) -> None:
        """Send the wish again if there was no room for it."""
        with self._lock:
            if self._sent != self.now.number:
                self._send()

    def _send(self) -> None:
        if self._outbound.offer(self.now):
            self._sent = self.now.number


class Controls:
    """Buttons, choices and sliders.

    Args:
        gui: Viser's.
        wishes: What they change.
        tabs: Where they go.
    """

    def __init__(self, gui: Any, wishes: Wishes, tabs: Any) -> None:
        self._gui, self._wishes = gui, wishes
        self._inputs: dict[str, tuple[Any, Callable[[Any], Any]]] = {}
        setup = wishes.now.setup
        with tabs.add_tab("Run"):
            self._run(setup)
        with tabs.add_tab("Control"):
            self._control(setup)

    def _run(self, setup: Setup) -> None:
        gui, wishes = self._gui, self._wishes
        self._go = gui.add_button_group("clock", ("pause", "step", "again"))
        self._go.on_click(lambda event: self._clock(event.target.value))
        paces = {f"{pace:g} x": pace for pace in PACES}
        pace = gui.add_dropdown("speed", tuple(paces))
        pace.on_update(lambda event: wishes.change(pace=paces[event.target.value]))
        self._record = gui.add_button("record (begins anew)")
        self._record.on_click(lambda _: wishes.change(record=not wishes.now.record))
        self._choice("robot", "robot", tuple(dict.fromkeys((setup.robot, *bundled_robots()))), setup.robot)
        tasks = _files(setup.task, HOLD, MOVE)
        self._choice("task", "task", tuple(tasks), _key(tasks, setup.task), tasks.__getitem__)
        stories = _files(setup.story, NOBODY, STRAIGHT, RANDOM)
        self._choice("people", "story", tuple(stories), _key(stories, setup.story), stories.__getitem__)
        others = gui.add_button("other people at random")
        others.on_click(lambda _: wishes.change(story=RANDOM, seed=wishes.now.setup.seed + 1))

    def _clock(self, what: str) -> None:
        now = self._wishes.now
        if what == "step":
            self._wishes.change(paused=True, steps=now.steps + 1)
        elif what == "again":
            self._wishes.change(restarts=now.restarts + 1)
        else:
            self._wishes.change(paused=not now.paused)

    def _control(self, setup: Setup) -> None:
        gui = self._gui
        self._choice("law", "law", LAWS, setup.law)
        self._choice("projection", "projection", PROJECTIONS, setup.projection)
        self._choice("sensors", "sight", SENSORS, setup.sight)
        self._switch("gate", setup.gate, gate=bool)
        self._barrier = gui.add_checkbox("barrier", setup.cap is not None)
        self._cap = gui.add_slider("cap of CDFₙ", CAP[0], CAP[1], 0.5, setup.cap or CAP[2])
        for handle in (self._barrier, self._cap):
            handle.on_update(self._said(lambda _: {"cap": float(self._cap.value) if self._barrier.value else None}))
        self._slider("lag [ms]", "lag", (0.0, 40.0, 4.0), 1e3 * setup.lag, lambda value: 1e-3 * value)
        with gui.add_folder("Parameters"):
            self._thresholds = [
                gui.add_slider("Δ", 2.0, 40.0, 0.1, 11.5, hint="danger at which the first task is half released"),
                gui.add_slider("ε", 0.05, 0.5, 0.01, 0.15),
                gui.add_slider("Δ_f", 1.0, 30.0, 0.1, 7.5, hint="the same for the second task"),
                gui.add_slider("ε_f", 0.05, 0.5, 0.01, 0.25),
            ]
            self.fit(setup)
            for slider in self._thresholds:
                slider.on_update(self._said(lambda _: {"thresholds": tuple(float(s.value) for s in self._thresholds)}))
            self._slider("mass M, x own", "mass", (0.2, 5.0, 0.1), setup.mass, float)
            self._slider("damping D, x own", "damping", (0.2, 5.0, 0.1), setup.damping, float)
            own = gui.add_button("the robot's own")
            own.on_click(lambda _: self._wishes.change(thresholds=None, mass=1.0, damping=1.0))

    def fit(self, setup: Setup) -> None:
        """Set the threshold sliders to the thresholds in effect."""
        values = setup.thresholds or own_thresholds(load_robot(setup.robot))
        for slider, value in zip(self._thresholds, values, strict=True):
            if slider.value != value:
                slider.value = min(max(value, slider.min), slider.max)

    def follow(self, frame: Frame) -> None:
        """Show what is in effect, where a wish was refused or means something else now."""
        self._record.label = "stop recording" if frame.state == RECORDING else "record (begins anew)"
        setup, now = frame.setup, self._wishes.now
        if setup is None or frame.wish != now.number or setup == now.setup:
            return
        self._wishes.now = now._replace(setup=setup)
        self.reset(setup)

    def reset(self, setup: Setup) -> None:
        """Set all inputs to the values of a setup."""
        for name, (handle, shown) in self._inputs.items():
            value = shown(getattr(setup, name))
            if handle.value != value:
                handle.value = value
        self._barrier.value = setup.cap is not None
        self.fit(setup)

    def _said(self, fields: Callable[[Any], dict[str, Any]]) -> Callable[[Any], None]:
        """A callback that takes notice of browsers only, not of values that this program has set."""

        def changed(event: Any) -> None:
            if event.client is not None:
                self._wishes.change(**fields(event.target.value))

        return changed

    def _choice(
        self, label: str, name: str, options: tuple[str, ...], first: str, meaning: Callable[[str], Any] = str
    ) -> None:
        handle = self._gui.add_dropdown(label, options, initial_value=first)
        names = {meaning(option): option for option in options}
        self._inputs[name] = handle, lambda value: names.get(value, value)
        handle.on_update(self._said(lambda value: {name: meaning(value)}))

    def _switch(self, label: str, first: bool, **kind: Callable[[Any], Any]) -> None:
        ((name, meaning),) = kind.items()
        handle = self._gui.add_checkbox(label, first)
        self._inputs[name] = handle, meaning
        handle.on_update(self._said(lambda value: {name: meaning(value)}))

    def _slider(
        self, label: str, name: str, ends: tuple[float, float, float], first: float, meaning: Callable[[float], float]
    ) -> None:
        handle = self._gui.add_slider(label, *ends, first)
        scale = meaning(1.0)
        self._inputs[name] = handle, lambda value: value / scale
        handle.on_update(self._said(lambda value: {name: meaning(value)}))


def _files(chosen: str, *named: str) -> dict[str, str]:
    """Label -> value of choices that have names, and of a file that was given."""
    return {name: name for name in named} | ({} if chosen in named else {Path(chosen).name: chosen})


def _key(choices: dict[str, str], value: str) -> str:
    return next(key for key, found in choices.items() if found == value)
