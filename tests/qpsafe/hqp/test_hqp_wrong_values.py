"""Whatever is put in any place of `solve_hierarchy`: real numbers are solved, all else is refused by name."""

from __future__ import annotations

import copy
import itertools
import pickle
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy


class Raises:
    """Raises whatever is asked of it."""

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("array")

    def __iter__(self) -> Any:
        raise RuntimeError("iter")


#: What makes wrong values of right ones, (rows, n) or (rows,), of the same shape.
WRONG = {
    "masked": lambda x: np.ma.array(x, mask=np.arange(x.size).reshape(x.shape) == 0),
    "masked inside": lambda x: [np.ma.masked, *x[1:]] if x.ndim == 1 else [np.ma.masked_all(x.shape[1]), *x[1:]],
    "complex": lambda x: x + 1j,
    "complex, of no imaginary part": lambda x: x.astype(complex),
    "text": lambda x: x.astype(str),
    "lists of text": lambda x: x.astype(str).tolist(),
    "truth": lambda x: x > 0.0,
    "lists of truth": lambda x: (x > 0.0).tolist(),
    "truth beside numbers": lambda x: np.where(
        np.arange(x.size).reshape(x.shape) == 0, True, x.astype(object)
    ).tolist(),
    "dates": lambda x: x.astype("M8[D]"),
    "spans": lambda x: x.astype("m8[s]"),
    "objects": lambda x: x.astype(object),
    "none": lambda x: np.full(x.shape, None),
    "raises": lambda x: Raises(),
    "huge": lambda x: np.full(x.shape, 10**400, dtype=object).tolist(),
    "ragged": lambda x: [[1.0], [1.0, 2.0]],
    "nothing": lambda x: None,
    "a word": lambda x: "x",
    "a dictionary": lambda x: {1: 2.0},
    "one axis more": lambda x: np.ones((*x.shape, 2)),
}
#: What makes the same numbers in another guise.
RIGHT = {
    "lists": lambda x: x.tolist(),
    "float32": lambda x: x.astype(np.float32),
    "whole": lambda x: x.astype(int),
    "the other byte order": lambda x: x.astype(">f8"),
    "Fortran": np.asfortranarray,
    "not masked": lambda x: np.ma.array(x),
    "strided": lambda x: np.repeat(x, 2, axis=0)[::2],
    "read-only": lambda x: np.frombuffer(x.tobytes()).reshape(x.shape),
}
A, B, HIGH = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]), np.array([1.0, 2.0]), np.array([4.0, 3.0])
BOX = np.array([3.0, 4.0, 5.0])
#: Places: how the call is made with a value there, the right value, and what an error calls it.
PLACES = {
    "A of a pair": (lambda x: solve_hierarchy([(x, B)]), A, "levels[0].A"),
    "b of a pair": (lambda x: solve_hierarchy([(A, x)]), B, "levels[0].b"),
    "A of a later pair": (lambda x: solve_hierarchy([(A, B), (x, B)]), A, "levels[1].A"),
    "b of a later pair": (lambda x: solve_hierarchy([(A, B), (A, x)]), B, "levels[1].b"),
    "b beside a Level": (lambda x: solve_hierarchy([Level(A, B, B), (A, x)]), B, "levels[1].b"),
    "b under hard rows": (lambda x: solve_hierarchy([(A, x)], rows=(A, B, HIGH)), B, "levels[0].b"),
    "A of a Level": (lambda x: solve_hierarchy([Level(x, B, HIGH)]), A, "A"),
    "lower of a Level": (lambda x: solve_hierarchy([Level(A, x, HIGH)]), B, "lower"),
    "upper of a Level": (lambda x: solve_hierarchy([Level(A, B, x)]), HIGH, "upper"),
    "weight of a Level": (lambda x: solve_hierarchy([Level(A, B, HIGH, x)]), HIGH, "weight"),
    "G": (lambda x: solve_hierarchy([(A, B)], rows=(x, B, HIGH)), A, "rows.A"),
    "lower of rows": (lambda x: solve_hierarchy([(A, B)], rows=(A, x, HIGH)), B, "rows.lower"),
    "upper of rows": (lambda x: solve_hierarchy([(A, B)], rows=(A, B, x)), HIGH, "rows.upper"),
    "lower": (lambda x: solve_hierarchy([(A, B)], -BOX if x is BOX else x), BOX, "lower"),
    "upper": (lambda x: solve_hierarchy([(A, B)], None, x), BOX, "upper"),
    "lower alone": (lambda x: solve_hierarchy([], lower=x), BOX, "lower"),
    "upper alone": (lambda x: solve_hierarchy([], upper=x), BOX, "upper"),
    "damping": (lambda x: solve_hierarchy([(A, B), (A, B)], damping=x), np.array([1.0, 2.0]), "damping"),
}  # fmt: skip
#: None is allowed in these.
OPTIONAL = ("weight of a Level", "lower", "upper", "lower alone", "upper alone")


@pytest.mark.filterwarnings("ignore:Warning. converting a masked element to nan")
@given(st.sampled_from(sorted(PLACES)), st.sampled_from(sorted(WRONG)))
@settings(max_examples=some(150, 2000), deadline=None)
def test_what_is_no_array_of_real_numbers_is_refused_by_name(place: str, kind: str) -> None:
    call, right, key = PLACES[place]
    wrong = WRONG[kind](right)
    if wrong is None and place in OPTIONAL:
        return
    with pytest.raises(ConfigurationError) as caught:
        call(wrong)
    assert caught.value.key.removesuffix(".shape") == key
    assert caught.value.where in ("solve_hierarchy", "Level")


@given(st.sampled_from(sorted(PLACES)), st.sampled_from(sorted(RIGHT)))
@settings(max_examples=some(100, 1000), deadline=None)
def test_the_same_numbers_in_another_guise_give_the_same_answer(place: str, kind: str) -> None:
    call, right, _ = PLACES[place]
    expected, found = call(right.copy()), call(RIGHT[kind](right.copy()))
    assert found.status == expected.status
    np.testing.assert_array_equal(found.qd, expected.qd)


@pytest.mark.parametrize(
    "given",
    [
        *({"levels": x} for x in (None, 5, "ab", {1: 2}, Raises(), Level(A, B, B), [5], [(A,)], [(A, B, B)], ["ab"])),
        *({"rows": x} for x in (5, "abc", (A, B), (A, B, HIGH, B), Level(A, B, HIGH), Raises(), np.ones((3, 2, 2)))),
        *({"damping": x} for x in (True, "0.1", 1j, None, -1.0, np.nan, np.inf, [0.1, 0.1], [True], [[0.1]], 10**400)),
        *({"solver": x} for x in (5, True, ["own"], "OWN", "", np.array(["own", "own"]), Raises())),
    ],
    ids=lambda given: f"{next(iter(given))} {type(next(iter(given.values()))).__name__}",
)
def test_arguments_of_another_kind_are_refused_by_name(given: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        solve_hierarchy(**{"levels": [(A, B)]} | given)
    assert caught.value.key.startswith(next(iter(given)))


class Derived(Level):
    """A level of somebody's own, which may remember things."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.count = 0


@pytest.mark.parametrize("kind", [Level, Derived])
@pytest.mark.parametrize("same", [lambda x: x, copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_what_compiled_code_trusts_is_set_once(kind: Any, same: Any) -> None:
    level = same(kind(A, B, HIGH, B))
    for key, value in itertools.product(Level.__slots__, (None, 5.0, np.ones((9, 3)), np.ones(9))):
        before = getattr(level, key)
        with pytest.raises(ConfigurationError, match=key):
            setattr(level, key, value)
        with pytest.raises(ConfigurationError, match=key):
            delattr(level, key)
        assert getattr(level, key) is before
    if kind is Derived:
        level.count += 1
    expected = solve_hierarchy([Level(A, B, HIGH, B)])
    np.testing.assert_array_equal(solve_hierarchy([level]).qd, expected.qd)


def test_an_equality_stays_one_in_copies() -> None:
    for level in (copy.copy(Level(A, B, B)), copy.deepcopy(Level(A, B, B)), pickle.loads(pickle.dumps(Level(A, B, B)))):
        assert level.is_equality


@pytest.mark.filterwarnings("ignore:Setting the shape")
@pytest.mark.parametrize("key", Level.__slots__)
def test_arrays_that_are_reshaped_in_place_are_refused(key: str) -> None:
    given = {"A": A.copy(), "lower": np.array(B), "upper": np.array(HIGH), "weight": np.array(B)}
    level = Level(**given)
    given[key].resize((4, 3) if key == "A" else 4, refcheck=False)
    with pytest.raises(ConfigurationError, match="levels"):
        solve_hierarchy([level])


def test_arrays_of_a_levels_own_are_read_only() -> None:
    level = Level([[1, 2, 0]], 0.0, [1], 1)
    for key in Level.__slots__:
        with pytest.raises(ValueError, match="read-only"):
            getattr(level, key)[:] = 5.0
