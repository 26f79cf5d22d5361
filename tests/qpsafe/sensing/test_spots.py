"""Spots: eq. (7) against the chain of homogeneous matrices, mistakes in spots.toml, and the IRB 140's own twenty."""

import re
import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import RobotFileError

# ABB's published table for the IRB 140: theta offset [deg], d [m], a [m], alpha [deg]
TABLE = [(0, 0.352, 0.07, -90), (-90, 0, 0.36, 0), (0, 0, 0, -90), (0, 0.38, 0, 90), (0, 0, 0, -90), (180, 0.065, 0, 0)]


def dh_matrix(q: float, theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """T(i-1, i) written out, for a joint at q [rad]."""
    ct, st_ = np.cos(q + np.deg2rad(theta)), np.sin(q + np.deg2rad(theta))
    ca, sa = np.cos(np.deg2rad(alpha)), np.sin(np.deg2rad(alpha))
    return np.array(
        [[ct, -st_ * ca, st_ * sa, a * ct], [st_, ct * ca, -ct * sa, a * st_], [0, sa, ca, d], [0, 0, 0, 1]]
    )


def spot_matrix(position: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """DHiT_k: origin at the spot, z along its direction, x anywhere normal to it."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(z, [0.3, -0.5, 0.8])
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack((x, np.cross(z, x), z), axis=1)
    T[:3, 3] = position
    return T


@settings(max_examples=some(12, of=30), deadline=None)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
    st.lists(st.floats(0.0, 2.0), min_size=20, max_size=20),
)
def test_detected_points_are_those_of_equation_7(irb140: Any, q: list[float], distances: list[float]) -> None:
    frames = {"dh0": np.eye(4)}
    for i, (angle, row) in enumerate(zip(q, TABLE, strict=True)):
        frames[f"dh{i + 1}"] = frames[f"dh{i}"] @ dh_matrix(angle, *row)  # 0T_DHi
    spots = qpsafe.load_spots(irb140)
    points = spots.points(irb140.at(q), np.array(distances))
    for k, d in enumerate(distances):
        T = frames[spots.frames[k]] @ spot_matrix(spots.positions[k], spots.directions[k])
        assert points[k] == pytest.approx((T @ [0.0, 0.0, d, 1.0])[:3], abs=5e-7)  # (7); directions have 7 digits
    origins, directions = spots.rays(irb140.at(q))
    assert spots.points(irb140.at(q), np.zeros(20)) == pytest.approx(origins, abs=1e-12)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(20), abs=1e-6)


def test_detections_are_within_range(irb140: Any) -> None:
    spots = qpsafe.load_spots(irb140)
    just = np.broadcast_to(spots.range_max, (20,)).copy()
    assert spots.detected(just).all()
    assert spots.detected(np.zeros(20)).all()  # nearer than the sensor resolves is no reason to look away
    assert not spots.detected(np.nextafter(just, np.inf)).any()
    assert not spots.detected(np.full(20, np.inf)).any()
    assert not spots.detected(np.full(20, np.nan)).any()


HEADER = {"sensor": '"Any"', "range_min": "0.2", "range_max": "0.8"}
SPOT = {
    "name": '"a"',
    "link": "6",
    "frame": '"dh6"',
    "position": "[0.0, 0.2, 0.0]",
    "direction": "[0.0, 1.0, 0.0]",
}


def text(header: dict[str, str | None], spot: dict[str, str | None], more: str = "") -> str:
    """A spots.toml of two spots, the second one changed; None leaves a key out."""
    lines = [f"{key} = {value}" for key, value in (HEADER | header).items() if value is not None]
    lines += ["[[spot]]", *(f"{key} = {value}" for key, value in (SPOT | {"name": '"first"'}).items())]
    lines += ["[[spot]]", *(f"{key} = {value}" for key, value in (SPOT | spot).items() if value is not None)]
    return "\n".join([*lines, more])


def load(irb140: Any, folder: Path, content: str | bytes) -> qpsafe.SpotArray:
    path = folder / "spots.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return qpsafe.SpotArray.load(path, irb140)


MISTAKES: dict[str, tuple[str, str | None]] = {
    # key that must be named -> what stands there instead, TOML; for `spot` the second one of two
    "range_min": ("header", None),
    "range_min ": ("header", "0.0"),
    "range_min  ": ("header", "-0.2"),
    "range_min   ": ("header", "nan"),
    "range_min    ": ("header", '"20 cm"'),
    "range_min     ": ("header", "true"),
    "range_min      ": ("header", "0.8"),
    "range_min       ": ("header", "20"),
    "range_max": ("header", None),
    "range_max ": ("header", "inf"),
    "range_max  ": ("header", "-inf"),
    "range_max   ": ("header", "[0.8]"),
    "sensor": ("header", None),
    "sensor ": ("header", "2"),
    "colour": ("header", '"orange"'),
    "name": ("spot", None),
    "name ": ("spot", "1"),
    "link": ("spot", None),
    "link ": ("spot", "0"),
    "link  ": ("spot", "7"),
    "link   ": ("spot", "-1"),
    "link    ": ("spot", "1.5"),
    "link     ": ("spot", '"6"'),
    "link      ": ("spot", "true"),
    "frame ": ("spot", '"dh7"'),
    "frame  ": ("spot", "6"),
    "position": ("spot", None),
    "position ": ("spot", "[0.0, 0.2]"),
    "position  ": ("spot", "[0.0, 0.2, 0.0, 1.0]"),
    "position   ": ("spot", "[0.0, nan, 0.0]"),
    "position    ": ("spot", "[0.0, inf, 0.0]"),
    "position     ": ("spot", '["0", "0.2", "0"]'),
    "position      ": ("spot", "[true, false, true]"),
    "position       ": ("spot", "0.2"),
    "direction": ("spot", None),
    "direction ": ("spot", "[0.0, 0.0, 0.0]"),
    "direction  ": ("spot", "[0.0, 1.1, 0.0]"),
    "direction   ": ("spot", "[0.0, nan, 0.0]"),
    "direction    ": ("spot", "[0.0, 1.0]"),
    "colour ": ("spot", '"orange"'),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_spots_toml_is_named(irb140: Any, tmp_path: Path, mistake: str) -> None:
    where, value = MISTAKES[mistake]
    key = mistake.strip()
    header, spot = ({key: value}, {}) if where == "header" else ({}, {key: value})
    with pytest.raises(qpsafe.RobotFileError) as caught:
        load(irb140, tmp_path, text(header, spot))
    error = caught.value
    assert error.where == str(tmp_path / "spots.toml")
    assert key in error.key
    assert ("spot" in error.key) == (where == "spot")
    if where == "spot":
        assert "1" in error.key  # the second, not the first
    assert error.expected
    message = str(error)
    assert error.where in message
    assert error.key in message
    if value is not None and value[0] not in "[t":
        assert value.strip('"') in message


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe", "sensor = ", "[[spot]", "spot = 3", 'spot = ["a"]', "", text({}, {}, "[[spot]]")],
    ids=["not UTF-8", "not TOML", "open bracket", "a number", "names", "empty", "empty spot"],
)
def test_a_file_that_is_none_is_named(irb140: Any, tmp_path: Path, content: str | bytes) -> None:
    with pytest.raises(qpsafe.RobotFileError, match=r"spots\.toml"):
        load(irb140, tmp_path, content)


def test_a_missing_file_is_named(irb140: Any, tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(qpsafe.RobotFileError) as caught:
            qpsafe.SpotArray.load(path, irb140)
        assert (caught.value.where, caught.value.key) == (str(path), "file")


def test_what_is_written_is_what_is_loaded(irb140: Any, tmp_path: Path) -> None:
    spots = load(irb140, tmp_path, text({}, {"link": "4", "frame": '"dh4"', "position": "[0, -1, 2]"}))
    assert len(spots) == 2
    assert spots.names == ("first", "a")
    assert spots.links.tolist() == [5, 3]  # from 0
    assert spots.frames == ("dh6", "dh4")
    assert np.array_equal(spots.positions, [[0.0, 0.2, 0.0], [0.0, -1.0, 2.0]])
    assert spots.directions == pytest.approx(np.array([[0.0, 1.0, 0.0]] * 2), abs=1e-15)
    spots.check(irb140)


@pytest.fixture(scope="module")
def body(irb140: Any) -> tuple[mujoco.MjModel, mujoco.MjData, list[np.ndarray]]:
    """The visible body at zero pose, as triangles (t, 3, 3) of each of its meshes."""
    model = mujoco.MjModel.from_xml_path(str(irb140.model_path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    meshes = []
    for i in np.flatnonzero(model.geom_group == 2):
        assert model.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH
        k = model.geom_dataid[i]
        vertices = model.mesh_vert[model.mesh_vertadr[k] :][: model.mesh_vertnum[k]]
        faces = model.mesh_face[model.mesh_faceadr[k] :][: model.mesh_facenum[k]]
        meshes.append((vertices @ data.geom_xmat[i].reshape(3, 3).T + data.geom_xpos[i])[faces])
    return model, data, meshes


def winding(point: np.ndarray, triangles: np.ndarray) -> float:
    """How often a closed mesh goes around the point, by solid angles: 1 inside, 0 outside."""
    a, b, c = (triangles[:, j] - point for j in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    rest = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (a * c).sum(1) * lb
    return float(np.arctan2(volume, rest).sum() / (2.0 * np.pi))


def nearest_on(triangles: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The nearest point of a mesh: the foot of the perpendicular where it lies inside a triangle, else on an edge."""
    a, b, c = (triangles[:, j] for j in range(3))
    n = np.cross(b - a, c - a)
    area2 = np.maximum((n**2).sum(1), 1e-30)
    foot = point - ((point - a) * n).sum(1)[:, None] / area2[:, None] * n
    inside = np.ones(len(n), dtype=bool)
    candidates = []
    for p, r in ((a, b), (b, c), (c, a)):
        edge = r - p
        inside &= (np.cross(edge, foot - p) * n).sum(1) >= 0.0
        s = np.clip(((point - p) * edge).sum(1) / np.maximum((edge**2).sum(1), 1e-30), 0.0, 1.0)
        candidates.append(p + s[:, None] * edge)
    found = np.vstack((foot[inside], *candidates))
    return found[np.argmin(np.linalg.norm(found - point, axis=1))]


def test_the_tools_of_this_test(body: Any) -> None:
    """A known cube: inside, outside, distances."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    cube = np.array([[corners[i] for i in t] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    assert abs(winding(np.array([0.5, 0.2, 0.7]), cube)) == pytest.approx(1.0)
    assert winding(np.array([1.5, 0.2, 0.7]), cube) == pytest.approx(0.0, abs=1e-12)
    assert nearest_on(cube, np.array([1.5, 0.2, 0.7])) == pytest.approx([1.0, 0.2, 0.7])
    assert nearest_on(cube, np.array([2.0, 2.0, 0.5])) == pytest.approx([1.0, 1.0, 0.5])
    inner = [abs(winding(triangles.reshape(-1, 3).mean(0), triangles)) for triangles in body[2]]
    assert np.median(inner) == pytest.approx(1.0)  # the body's meshes are closed


@pytest.mark.parametrize("placed", ["by hand", "optimised"])
def test_the_bundled_spots_sit_on_the_skin_and_look_outwards(irb140: Any, by_hand: Any, body: Any, placed: str) -> None:
    model, data, meshes = body
    spots = by_hand if placed == "by hand" else qpsafe.load_spots(irb140)
    assert len(spots) == 20
    assert len(set(spots.names)) == 20
    origins, directions = spots.rays(irb140.at(np.zeros(6)))
    everything = np.concatenate(meshes)
    for name, origin, direction in zip(spots.names, origins, directions, strict=True):
        origin = origin + 1e-4 * direction  # those of `qpsafe place` lie in the surface, rounded
        assert max(abs(winding(origin, triangles)) for triangles in meshes) < 1e-6, name  # outside
        outwards = origin - nearest_on(everything, origin)
        distance = float(np.linalg.norm(outwards))
        assert distance < 0.015, name
        assert outwards @ direction > 0.25 * distance, name
        if placed == "optimised":
            continue  # by other rules, see test_placement_nodes.py
        group, hit = np.array([0, 0, 1, 0, 0, 0], dtype=np.uint8), np.zeros(1, dtype=np.int32)
        # it does not look at the robot itself: nothing of it within the sensor's range
        assert mujoco.mj_ray(model, data, origin, direction, group, 1, -1, hit, None) < 0.0, name


def test_by_hand_every_moving_link_carries_a_spot(irb140: Any) -> None:
    spots = qpsafe.load_spots(irb140.with_spots("spots-by-hand.toml"))
    assert set(spots.links.tolist()) == set(range(len(irb140.wire_frames)))


def test_optimised_spots_keep_to_what_the_regions_say(irb140: Any) -> None:
    """At most so many in each region, none beyond the wrist; `spots.toml` names a spot by its region."""
    spots, regions = qpsafe.load_spots(irb140), irb140.regions
    assert sum(region.at_most for region in regions) >= len(spots)
    for region in regions:
        own = re.compile(rf"{region.name} (front|rear|left|right|top|bottom) \d+")
        inside = [name for name in spots.names if own.fullmatch(name)]
        assert len(inside) <= region.at_most, region.name
        assert {int(spots.links[spots.names.index(name)]) for name in inside} <= {region.link}
    assert spots.links.max() == 3


def test_spots_are_those_that_stand_in_the_file_now(tmp_path: Path) -> None:
    """What has not changed is not parsed again; what has, in whatever way, counts at once, and counts back again."""
    folder = shutil.copytree(qpsafe.load_robot("irb140").folder, tmp_path / "arm")
    robot, file = qpsafe.load_robot(folder), folder / "spots.toml"
    text = file.read_text(encoding="utf-8")
    spots = qpsafe.load_spots(robot)
    assert spots is qpsafe.load_spots(robot)
    for name in ("a1", "b2"):  # of the same length, within the same tick of the clock
        file.write_text(text.replace(spots.names[0], name), encoding="utf-8")
        assert qpsafe.load_spots(robot).names[0] == name
    for spoilt in ("x", text.replace("link = 1", "link = 99")):
        file.write_text(spoilt, encoding="utf-8")
        with pytest.raises(RobotFileError):
            qpsafe.load_spots(robot)
    file.unlink()
    with pytest.raises(RobotFileError):
        qpsafe.load_spots(robot)
    file.write_text(text, encoding="utf-8")
    assert qpsafe.load_spots(robot).names == spots.names
