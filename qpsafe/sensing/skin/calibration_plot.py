"""Picture of a calibration: the pairs with their curves, and what is left over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from qpsafe.extras import require
from qpsafe.sensing.skin.calibration import FITTED, Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def calibration_figure(fits: Sequence[Fit]) -> Figure:
    """Curves of all spots on the left, residuals in distance on the right."""
    require("plots", "a figure", "matplotlib")
    import matplotlib
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.3), layout="constrained")
    left, right = figure.subplots(1, 2)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, max(len(fits), 1)))
    d = np.linspace(*FITTED, 200)
    for fit, colour in zip(fits, colours, strict=True):
        left.plot(100 * d, fit.curve.voltage(d), color=colour, linewidth=0.8)
        left.plot(100 * fit.distances, fit.voltages, "o", color=colour, markersize=2.5)
        right.plot(100 * fit.distances, 100 * fit.errors, "o", color=colour, markersize=2.5)
    for edge in (-1.0, 1.0):
        right.axhline(edge, color="#c0392b", linestyle="--", linewidth=1.0)
    left.set(xlabel="distance [cm]", ylabel="voltage [V]", title="pairs and fitted curves")
    shown = max(1.5, 1.1 * max((100 * float(np.abs(fit.errors).max()) for fit in fits), default=0.0))
    share = np.mean(np.concatenate([np.abs(fit.errors) <= 0.01 for fit in fits]))
    title = f"residuals: {100 * share:.1f} % within 1 cm"
    right.set(xlabel="distance [cm]", ylabel="by the curve - true [cm]", title=title, ylim=(-shown, shown))
    for axis in (left, right):
        axis.grid(True, color="#d0d0d0", linewidth=0.5)
        axis.set_axisbelow(True)
    return figure
