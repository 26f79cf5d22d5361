"""The strip below a video frame: time, regime, danger against both thresholds, and the activations m and f."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.extras import require
from qpsafe.sim.drawing.overlay import danger_colour

HEIGHT = 66  # of the strip, in pixels of a 960 pixel wide frame

_PAPER, _INK, _GREY, _RAIL = (24, 27, 31), (240, 242, 244), (150, 157, 165), (62, 68, 75)
_REGIMES = {"low": (51, 150, 82), "medium": (226, 170, 20), "high": (205, 40, 40)}


class Caption(NamedTuple):
    """What the strip says.

    Attributes:
        time: [s].
        regime: "low", "medium" or "high"; any other word is shown in grey.
        cdf_n: The danger that decides.
        thresholds: Danger at which medium and high begin.
        m: Activation (19), 1 = the task counts fully.
        f: Activation (21).
        note: A few words at the right end, e.g. the law.
    """

    time: float
    regime: str
    cdf_n: float
    thresholds: tuple[float, float]
    m: float
    f: float
    note: str = ""


class CaptionStrip:
    """Draws captions of one size."""

    def __init__(self, width: int) -> None:
        """Prepare fonts for frames of a width [px].

        Raises:
            MissingExtraError: pillow is not installed.
        """
        require("video", "a caption", "PIL")
        import matplotlib
        from PIL import Image, ImageDraw, ImageFont

        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._scale = s = width / 960
        self._image, self._draw = Image, ImageDraw
        self._big = ImageFont.truetype(str(fonts / "DejaVuSans-Bold.ttf"), round(17 * s))
        self._text = ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), round(15 * s))
        self._small = ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), round(12 * s))
        self.width, self.height = width, 2 * round(HEIGHT * s / 2)

    def draw(self, caption: Caption) -> NDArray[np.uint8]:
        """The strip as an RGB picture, (height, width, 3)."""
        picture = self._image.new("RGB", (self.width, self.height), _PAPER)
        pen, s = self._draw.Draw(picture), self._scale
        middle = self.height / 2

        pen.text((20 * s, middle), f"{caption.time:5.1f} s", font=self._big, fill=_INK, anchor="lm")
        chip = (100 * s, middle - 15 * s, 214 * s, middle + 15 * s)
        pen.rounded_rectangle(chip, radius=6 * s, fill=_REGIMES.get(caption.regime.lower(), _RAIL))
        pen.text((157 * s, middle), caption.regime.upper(), font=self._big, fill=(255, 255, 255), anchor="mm")

        self._danger(pen, caption, 300 * s, 640 * s)
        self._activation(pen, "m", caption.m, 690 * s)
        self._activation(pen, "f", caption.f, 796 * s)
        pen.text((self.width - 16 * s, middle), caption.note, font=self._small, fill=_GREY, anchor="rm")
        return np.asarray(picture)

    def _danger(self, pen: Any, caption: Caption, left: float, right: float) -> None:
        """CDF_n as a bar, with a tick at each threshold."""
        s, top, bottom = self._scale, 15 * self._scale, 35 * self._scale
        medium, high = caption.thresholds
        full = 1.6 * high
        pen.text((left - 12 * s, 25 * s), "CDFₙ", font=self._text, fill=_INK, anchor="rm")
        pen.rounded_rectangle((left, top, right, bottom), radius=4 * s, fill=_RAIL)
        if math.isfinite(caption.cdf_n) and caption.cdf_n > 0.0:
            end = left + (right - left) * min(caption.cdf_n / full, 1.0)
            colour = tuple(int(255 * c) for c in danger_colour(caption.cdf_n, medium, high))
            pen.rounded_rectangle((left, top, max(end, left + 4 * s), bottom), radius=4 * s, fill=colour)
        pen.text((right - 8 * s, 25 * s), f"{caption.cdf_n:.1f}", font=self._text, fill=_INK, anchor="rm")
        for value, name, regime in ((medium, "medium", "medium"), (high, "high", "high")):
            x = left + (right - left) * value / full
            pen.line((x, top - 4 * s, x, bottom + 4 * s), fill=_REGIMES[regime], width=max(round(2 * s), 1))
            label = f"{name} {value:.1f}"
            pen.text((x, bottom + 14 * s), label, font=self._small, fill=_GREY, anchor="mm")

    def _activation(self, pen: Any, name: str, value: float, left: float) -> None:
        """An activation from 0 to 1 as a small bar with its number."""
        s = self._scale
        top, bottom, right = 15 * s, 35 * s, left + 76 * s
        pen.text((left - 8 * s, 25 * s), name, font=self._text, fill=_INK, anchor="rm")
        pen.rounded_rectangle((left, top, right, bottom), radius=4 * s, fill=_RAIL)
        if math.isfinite(value) and value > 0.0:
            end = left + (right - left) * min(value, 1.0)
            pen.rounded_rectangle((left, top, max(end, left + 4 * s), bottom), radius=4 * s, fill=(88, 150, 206))
        pen.text(((left + right) / 2, bottom + 14 * s), f"{value:.2f}", font=self._small, fill=_GREY, anchor="mm")
