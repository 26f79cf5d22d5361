"""The page's numbers, plots and words: what a tick says, updated slowly enough to be read."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.irc5.process.latency import Latency
from qpsafe.sim.web.frame import Every, Row

if TYPE_CHECKING:
    from qpsafe.sim.web.frame import Frame

Array = NDArray[np.float64]

WINDOW = 20.0  # of the plots [s]
NUMBERS, PLOTS, WORDS = 0.1, 0.2, 0.4  # least time between two of each [s]
BLUE, ORANGE, YELLOW, RED, GREY = "#2f7fd1", "#e0701b", "#d99a00", "#d5352f", "#8a9199"
REGIMES = {"low": "#2a8c4a", "medium": "#b67d00", "high": "#c22f2f"}
HEIGHT = 118  # of a plot [px]


class Numbers:
    """A table of figures; those that tests read have an id.

    Args:
        gui: Viser's.

    Attributes:
        ticks: How long the controller has taken, all ticks since the page began.
        cycles: Likewise from when a tick was due until all of it was done.
    """

    def __init__(self, gui: Any) -> None:
        self._html = gui.add_html("")
        self.ticks, self.cycles = Latency(), Latency()
        self._look, self._said = Every(1.0), ("", "")

    def take(self, frame: Frame) -> None:
        """Count with a frame's times, even if it is never shown."""
        for tick, cycle in frame.times.tolist():
            self.ticks.record(tick)
            self.cycles.record(cycle)

    def show(self, frame: Frame, thresholds: tuple[float, float], asked: int = 0) -> None:
        """Show a frame's.

        Args:
            frame: The frame.
            thresholds: From where danger is medium, and high.
            asked: Number of the newest wish.
        """
        tick, row = frame.tick, frame.row
        colour = REGIMES.get(tick.regime.split("-")[0], GREY)
        medium, high = thresholds
        lines = [
            ("danger CDF<sub>n</sub>", f"{row.cdf_n:.2f}", "qp-cdf", f"medium from {medium:.1f}, high from {high:.1f}"),
            ("distance", _millimetres(row.distance), "qp-distance", "robot to people, true"),
            ("m, f", f"{row.m:.2f}, {row.f:.2f}", "qp-mf", "how much the tasks count"),
            ("position error", _millimetres(row.position), "qp-position", ""),
            ("orientation error", _degrees(row.orientation), "qp-orientation", ""),
        ]
        if self.ticks.count:
            if self._look():
                late = self.cycles.above(frame.period)
                told = f"99.9 %: {1e3 * self.ticks.percentile(99.9):.2f} ms; late: {late} of {self.ticks.count}"
                self._said = f"{1e3 * self.ticks.percentile(50.0):.2f} ms", told
            lines.append(("tick, median", self._said[0], "qp-tick", self._said[1]))
        cells = "".join(
            f'<tr><td style="padding-right:.6em;white-space:nowrap">{name}</td>'
            f'<td id="{key}" style="font-weight:600;white-space:nowrap;padding-right:.6em">{value}</td>'
            f'<td style="opacity:.7;font-size:.85em">{note}</td></tr>'
            for name, value, key, note in lines
        )
        joints = " ".join(f"{value:.4f}" for value in frame.q)
        self._html.content = (
            f'<div style="padding:.2em .6em .4em .6em;font-size:.9em;line-height:1.5"><div style="margin-bottom:.3em">'
            f'<span id="qp-regime" style="background:{colour};color:#fff;border-radius:.3em;padding:.1em .5em;'
            f'font-weight:600">{tick.regime} danger</span> <span id="qp-phase">{tick.phase}</span>, '
            f'<span id="qp-status">{tick.status}</span>, <span id="qp-time">{tick.reference.time:.2f}</span> s '
            f'<span id="qp-state" style="opacity:.7">{frame.state}</span></div>'
            f"<table style='border-collapse:collapse'>{cells}</table>"
            f'<div id="qp-note" style="color:{ORANGE};font-size:.85em;overflow-wrap:anywhere">'
            f"{_escaped(frame.note)}</div>"
            f'<span id="qp-joints" style="display:none">{joints}</span>'
            f'<span id="qp-wish" style="display:none">{frame.wish} {frame.since:.6f}</span>'
            f'<span id="qp-exact" style="display:none">{tick.reference.time:.3f}</span>'
            f'<span id="qp-asked" style="display:none">{asked}</span></div>'
        )


class Plots:
    """Plots of the last `WINDOW` seconds of danger, switches, errors and distance.

    Args:
        gui: Viser's; the plots go where its context is.
        distance: Whether the true distance to people is known.
    """

    def __init__(self, gui: Any, distance: bool = True) -> None:
        self._rows: deque[Row] = deque()
        axis = {"size": 44, "stroke": GREY, "grid": {"stroke": "rgba(128,128,128,.2)"}, "font": "11px sans-serif"}
        below = axis | {"size": 26}

        def plot(title: str, *series: tuple[str, str], low: float | None = 0.0, high: float | None = None) -> Any:
            lines = tuple({"label": name, "stroke": colour, "width": 1.5} for name, colour in series)
            empty = np.zeros(1)
            return gui.add_uplot(
                (empty,) * (1 + len(lines)),
                ({"label": "t"}, *lines),
                title=title,
                scales={"x": {"time": False, "auto": True}, "y": {"range": (low, high), "auto": True}},
                axes=(below, axis),
                legend={"show": True, "live": False},
                height=HEIGHT,
                padding=(4, 12, 0, 0),
            )

        self._danger = plot("danger CDFₙ [1/m]", ("CDFₙ", BLUE), ("medium", YELLOW), ("high", RED))
        self._switches = plot("switches m, f", ("m", BLUE), ("f", ORANGE), high=1.05)
        self._errors = plot("errors [mm], [deg]", ("position", BLUE), ("orientation", ORANGE))
        self._distance = distance and plot("true distance to people [m]", ("distance", BLUE), low=None)

    def add(self, row: Row) -> None:
        """Take a row; where time goes back, the plots begin anew."""
        if self._rows and row.time == self._rows[-1].time:
            return
        if self._rows and row.time < self._rows[-1].time:
            self._rows.clear()
        self._rows.append(row)
        while row.time - self._rows[0].time > WINDOW:
            self._rows.popleft()

    def put(self, rows: Sequence[Row]) -> None:
        """Show these rows and no others."""
        self._rows = deque(rows)

    def clear(self) -> None:
        """Forget all rows."""
        self._rows.clear()

    def show(self, thresholds: tuple[float, float]) -> None:
        """Draw the rows.

        Args:
            thresholds: From where danger is medium, and high.
        """
        if not self._rows:
            return
        time_, cdf_n, m, f, distance, position, orientation = np.array(self._rows).T
        level = np.ones_like(time_)
        self._danger.data = (time_, cdf_n, thresholds[0] * level, thresholds[1] * level)
        self._switches.data = (time_, m, f)
        self._errors.data = (time_, 1e3 * position, np.degrees(orientation))
        if self._distance:
            self._distance.data = (time_, np.where(distance < 5.0, distance, np.nan))


class Words:
    """`tick.explain()`.

    Args:
        gui: Viser's.
    """

    def __init__(self, gui: Any) -> None:
        self._html = gui.add_html("")

    def show(self, frame: Frame) -> None:
        """Explain a frame's tick."""
        text = _escaped(str(frame.tick))
        self._html.content = (
            '<pre id="qp-words" style="white-space:pre-wrap;overflow-wrap:anywhere;font-size:.78em;line-height:1.4;'
            f'padding:.2em .6em;margin:0">{text}</pre>'
        )


def _millimetres(value: float) -> str:
    return "not known" if not math.isfinite(value) else f"{1e3 * value:.0f} mm" if value < 5.0 else "nobody near"


def _degrees(value: float) -> str:
    return "not known" if not math.isfinite(value) else f"{math.degrees(value):.1f}°"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
