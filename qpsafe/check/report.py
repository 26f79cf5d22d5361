"""A check in words, and as what JSON knows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from qpsafe.check.singular import SINGULAR
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.check.check import PathCheck
    from qpsafe.check.gaps import Gap

TITLES = {
    "reach": "reach",
    "joints": "joint limits",
    "singular": "singular poses",
    "furniture": "furniture",
    "self": "the robot itself",
    "sensors": "sensors",
}


def words(check: PathCheck) -> dict[str, str]:
    """One sentence for each thing that is checked, by the names of `PathCheck.kept`."""
    return {
        "reach": _reach(check),
        "joints": _joints(check),
        "singular": _singular(check),
        "furniture": _furniture(check),
        "self": _own(check),
        "sensors": _sensors(check),
    }


def troubles(check: PathCheck) -> list[str]:
    """What is not as it should be, in words, title first."""
    said = words(check)
    return [f"{TITLES[name]}: {said[name]}" for name, good in check.kept.items() if good is False]


def to_dict(check: PathCheck) -> dict[str, Any]:
    """Everything, lengths in m, angles in rad; `good` is null where there is nothing to check."""
    kept, said, path = check.kept, words(check), check.path
    errors = path.errors.max(axis=0).tolist() if len(path.times) else [None, None]
    found: dict[str, Any] = {name: {"good": kept[name], "words": said[name]} for name in kept}
    found["reach"] |= {"until": _until(check), "position_error": errors[0], "orientation_error": errors[1]}
    found["joints"]["joints"] = [joint._asdict() | {"good": joint.good} for joint in check.joints]
    if check.singular:
        found["singular"] |= check.singular._asdict() | {"least": SINGULAR}
    if check.furniture:
        found["furniture"] |= check.furniture._asdict() | {"least": check.clearance}
    if check.own:
        found["self"] |= check.own._asdict()
    if check.sightings is not None:
        found["sensors"] |= {"d_min": check.d_min, "sightings": [one._asdict() for one in check.sightings]}
    return {
        "good": check.good,
        "robot": check.robot.name,
        "frame": path.frame,
        "duration": check.duration,
        "step": path.step,
        "known": list(check.known),
        "checks": found,
    }


def _until(check: PathCheck) -> float | None:
    times = check.path.times
    return float(times[-1]) if len(times) else None


def _reach(check: PathCheck) -> str:
    path = check.path
    if path.trouble:
        until = _until(check)
        when = "its beginning cannot be taken" if until is None else f"it can be followed for {until:.2f} s only"
        return f"{when}: {path.trouble}"
    if not check.duration:
        return f"{path.frame} can be kept where it is"
    return f"{path.frame} can follow all of its {check.duration:.2f} s, position and orientation"


def _joints(check: PathCheck) -> str:
    if not check.joints:
        return "not looked at"
    sliding = dict(zip(check.robot.joint_names, check.robot.sliding.tolist(), strict=True))
    spans = check.robot.upper - check.robot.lower
    span = dict(zip(check.robot.joint_names, spans.tolist(), strict=True))
    near = min(check.joints, key=lambda joint: joint.position / span[joint.name])
    fast = max(check.joints, key=lambda joint: joint.velocity)
    hard = max(check.joints, key=lambda joint: joint.acceleration)
    text = "no joint has a limit of position"
    if math.isfinite(near.position):
        margin = f"{1e3 * near.position:.1f} mm" if sliding[near.name] else f"{math.degrees(near.position):.1f} deg"
        text = f"{near.name} comes within {margin} of a limit, at {near.position_time:.2f} s"
    if not fast.velocity > 0.0:
        return text
    speed = f"{fast.name} takes {_share(fast.velocity)} of its speed, at {fast.velocity_time:.2f} s"
    rate = f"{hard.name} {_share(hard.acceleration)} of its acceleration, at {hard.acceleration_time:.2f} s"
    return f"{text}; {speed}; {rate}"


def _share(value: float) -> str:
    return f"{100.0 * value:.0f} %" if value < 10.0 else f"{value:.0f} times all"


def _singular(check: PathCheck) -> str:
    pose = check.singular
    if pose is None:
        return "not looked at"
    who = f" ({', '.join(pose.joints)})" if pose.joints else ""
    place = ", ".join(f"{x:.3f}" for x in pose.position)
    value = f"the smallest singular value is {pose.value:.3g}, {SINGULAR} at least is asked for"
    return f"{value}, at {pose.time:.2f} s with {check.path.frame} at ({place}) m{who}"


def _near(gap: Gap) -> str:
    who = f"{gap.shape} ({gap.joint})" if gap.joint else gap.shape
    if gap.distance <= 0.0:
        return f"{who} goes {-1e3 * gap.distance:.1f} mm into {gap.other}, at {gap.time:.2f} s"
    return f"{who} comes as near as {1e3 * gap.distance:.1f} mm to {gap.other}, at {gap.time:.2f} s"


def _furniture(check: PathCheck) -> str:
    if check.furniture:
        text = f"{_near(check.furniture)}; {1e3 * check.clearance:.1f} mm at least is asked for"
        short = check.path.times[check.furniture_distances < check.clearance]
        return f"{text}, and not kept from {short[0]:.2f} s on" if len(short) else text
    if not check.known:
        return "nothing is known to stand in the cell"
    if not check.has_hulls:
        return "cannot be checked: the robot's model has no collision geometry"
    return "not looked at"


def _own(check: PathCheck) -> str:
    if check.own:
        return _near(check.own)
    return "no two parts that could meet" if check.has_hulls else "the robot's model has no collision geometry"


def _sensors(check: PathCheck) -> str:
    if check.sightings is None:
        return "there are no distance sensors"
    if not check.known:
        return "nothing is known to stand in the cell"
    if not check.sightings:
        return f"no spot sees what stands in the cell nearer than d_min, {1e3 * check.d_min:.0f} mm"
    first = check.sightings[0]
    one = f"{first.spot} sees {first.obstacle} at {1e3 * first.distance:.0f} mm at {first.time:.2f} s"
    who, least = counted(len(check.sightings), "spot"), f"d_min, {1e3 * check.d_min:.0f} mm"
    return f"{who} would take what stands in the cell, nearer than {least}, for danger: {one}"
