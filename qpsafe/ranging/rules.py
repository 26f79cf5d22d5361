"""What of an image counts, and what makes a sensor of many zones sick: all numbers in one place."""

from __future__ import annotations

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.text.words import call

FREE, OCCUPIED = "free", "occupied"


class RangeRules(Fixed):
    """Numbers for images; times and tolerances that spots have too are in `SensingRules`.

    Args:
        most: How many points of each link and sensor count in eq. (8), the most dangerous ones: with 1 a spot is a
            sensor of one zone, and the paper's thresholds keep their meaning.
        apart: Of points of one link that are as near to each other as that only the most dangerous one counts, however
            many sensors see them [m]. The size of a hand's palm; ours.
        each: How many points of an image are kept for each link, the nearest ones.
        spread: So far apart [m]. Half the palm; ours.
        reach: Points farther than that from the wire do not matter [m].
        deviations: By how many standard deviations a reading may be wrong.
        through: A sensor that sees through more than this share of the known things before it is misplaced, or its
            rows are shifted, or its optics are others.
        few: But not if fewer zones than these should see known things.
        misplaced: Nor if fewer images than these in a row say so.
        dense: An image of more zones is reduced by tiles first, to at most this many.
        support: How many pixels of a tile have to see a surface; of tiles that are fewer pixels high or wide as many as
            that, so that nothing is lost which a whole row or column sees.
        budget: How many zones are taken in one tick, at most; later images wait for the next one.
        predict: Whether things are tracked from image to image, so that their velocities count.
        horizon: How far ahead of now a thing that comes nearer counts, at its velocity [s].
        acceleration: How fast people become faster, a_h [m/s²]; ours.
        fastest: How fast anybody becomes [m/s]; a run.
        unseen: What the gate takes for granted of places near the robot that a sensor covers (`RangeSensor.covers`) but
            none looks through, behind things and where zones tell nothing: "free", or "occupied", that somebody may
            stand there. Around what no sensor covers nothing is taken for granted.

    Raises:
        ConfigurationError: A number out of range.
    """

    def __init__(
        self, most: int = 1, *, apart: float = 0.08, each: int = 1, spread: float = 0.04, reach: float = 1.0,
        deviations: float = 3.0, through: float = 0.3, few: int = 4, misplaced: int = 3, dense: int = 5000,
        support: int = 3, budget: int = 400_000, predict: bool = True, horizon: float = 0.0,
        acceleration: float = 1.0, fastest: float = 2.5, unseen: str = FREE,
    ) -> None:  # fmt: skip
        whole = {
            "most": (most, 1, 10**9), "each": (each, 1, 100), "few": (few, 1, 10**9),
            "misplaced": (misplaced, 1, 10**9), "dense": (dense, 64, 10**9), "support": (support, 1, 4),
            "budget": (budget, 1, 10**9),
        }  # fmt: skip
        for key, (count, least, greatest) in whole.items():
            if isinstance(count, bool) or not isinstance(count, int) or not least <= count <= greatest:
                raise ConfigurationError("RangeRules", key, count, f"a whole number from {least} to {greatest}")
            setattr(self, key, count)
        if not isinstance(predict, bool):
            raise ConfigurationError("RangeRules", "predict", predict, "True or False")
        if not isinstance(unseen, str) or unseen not in (FREE, OCCUPIED):
            raise ConfigurationError("RangeRules", "unseen", unseen, f"{FREE} or {OCCUPIED}")
        self.predict, self.unseen = predict, unseen
        real = {
            "apart": apart, "spread": spread, "reach": reach, "deviations": deviations, "through": through,
            "horizon": horizon, "acceleration": acceleration, "fastest": fastest,
        }  # fmt: skip
        for key, number in real.items():
            if isinstance(number, bool) or not isinstance(number, int | float) or not 0.0 <= number < 1e3:
                raise ConfigurationError("RangeRules", key, number, "a finite number >= 0")
            setattr(self, key, float(number))

    most: int
    apart: float
    each: int
    spread: float
    reach: float
    deviations: float
    through: float
    few: int
    misplaced: int
    dense: int
    support: int
    budget: int
    predict: bool
    horizon: float
    acceleration: float
    fastest: float
    unseen: str

    def __repr__(self) -> str:
        rest = {key: getattr(self, key) for key in self.__annotations__ if key != "most"}
        return call(self, self.most, **rest)
