"""Tables of a `robot.toml` that a controller's parameters stand in; `qpsafe tune` writes them."""

from __future__ import annotations

from typing import Annotated

import pydantic

Number = Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, ge=0)]
Fraction = Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, gt=0, lt=1)]
Share = Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, gt=0, le=1)]


class Table(pydantic.BaseModel):
    """A TOML table in which an unknown key is an error."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class DangerTable(Table):
    """Thresholds of the danger field for this robot: Δ, ε of eq. (19) and Δ_f, ε_f of eq. (21)."""

    delta: Positive
    epsilon: Fraction
    delta_f: Positive
    epsilon_f: Fraction


class EvasionTable(Table):
    """M and D of eq. (16), and friction, one value a joint, in SI whatever the file's units (N m s²/rad and so on)."""

    mass: Annotated[list[Positive], pydantic.Field(min_length=1)]
    damping: Annotated[list[Positive], pydantic.Field(min_length=1)]
    friction: Annotated[list[NotNegative], pydantic.Field(min_length=1)] | None = None


class RecoveryTable(Table):
    """Rules of the way back that differ from the default ones, see `qpsafe.recovery.returns.RecoveryRules`."""

    speed: Positive | None = None
    angular_speed: Positive | None = None
    joint_speed: Positive | None = None
    shortest: Positive | None = None
    acceleration: Share | None = None
    ramp: Positive | None = None
    calm: Share | None = None
    dwell: NotNegative | None = None


class SensingTable(Table):
    """How long what a spot saw still counts, see `qpsafe.sensing.rules.SensingRules`."""

    hold_time: Annotated[float, pydantic.Field(strict=True, allow_inf_nan=False, ge=0, le=3600)]


class GateTable(Table):
    """What the gate asks for, see `qpsafe.gate.rules.VerifiedMotion`: nothing of what it assumes of people."""

    approach: Positive | None = None
    sidestep: NotNegative | None = None
    escape: NotNegative | None = None
