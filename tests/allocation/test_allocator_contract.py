"""Contract of the layer, over every allocator that is discovered."""

from __future__ import annotations

import functools

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core.runtime import _nrt_python, rtsys

from colift import part
from colift.control.allocation.base import INFO_BALANCE, INFO_SIZE, Status, ask, unplanned
from colift.kernel.jit import JIT_ENABLED, address_of
from colift.team import Team
from colift.team.geometry import ring

KINDS = part.answering("allocation")
SIZES = (1, 2, 3, 4, 7, 16)
GOOD = np.array([0.1, -0.2, 2.2])
DENORMAL = 5e-324
SPECIAL = {
    "zero": (0.0, 0.0, 0.0),
    "minus-zero": (-0.0, -0.0, -0.0),
    "denormal": (DENORMAL, 0.0, DENORMAL),
    "nan": (np.nan, np.nan, np.nan),
    "one-nan": (0.0, np.nan, 2.2),
    "inf": (0.0, 0.0, np.inf),
    "minus-inf": (-np.inf, 1.0, 2.2),
    "inf-minus-inf": (np.inf, -np.inf, 0.0),
    "overflowing": (1e200, 1e200, 1e200),
    "largest": (0.0, 0.0, 1.7e308),
    "down": (0.0, 0.0, -2.2),
    "almost-down": (1e-6, 0.0, -2.2),
    "sideways": (2.2, 0.0, 0.0),
    "giga": (0.0, 0.0, 1e9),
    "tiny": (0.0, 0.0, 1e-9),
    "jump": (-40.0, 30.0, 0.5),
}

SLOW = {kind for kind in KINDS if part.find("allocation", kind).needs}
"""Solvers of others, called from Python: up to half a second a call with 16 cables."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Every kind, and where a test takes a number of cables, with every number; with up to 7 for the slow ones."""
    if "n" in metafunc.fixturenames:
        cases = [(kind, n) for kind in KINDS for n in SIZES if n <= 7 or kind not in SLOW]
        metafunc.parametrize(("kind", "n"), cases)
    else:
        metafunc.parametrize("kind", KINDS)


@pytest.fixture(autouse=True)
def _installed(kind):
    if message := part.find("allocation", kind).missing():
        pytest.skip(message)


class Cell:
    """A kernel and the arrays it works on, as the simulation loop holds them."""

    def __init__(self, kind: str, n: int) -> None:
        team = Team.uniform(n)
        found = part.find("allocation", kind)
        self.team, self.part = team, found()
        self.memory = self.part.memory(team)
        self.tensions = np.zeros(n)
        self.directions = ring(n, np.radians(35.0))
        self.info = np.full(INFO_SIZE, 12345.0)

    def __call__(self, force) -> Status:
        _, code = self.part.call(
            self.team, self.memory, dt=0.01, force=force, desired_tensions=self.tensions,
            desired_directions=self.directions, allocator_info=self.info,
        )  # fmt: skip
        return Status(code)

    def check_usable(self) -> None:
        assert np.isfinite(self.tensions).all()
        assert (self.tensions >= 0.0).all()
        norms = np.linalg.norm(self.directions, axis=1)
        np.testing.assert_allclose(norms, 1.0, rtol=0.0, atol=1e-12)

    def imbalance(self, force) -> float:
        return float(np.linalg.norm(self.tensions @ self.directions + force))

    def settle(self, force, calls: int = 100) -> bool:
        """Whether the answer to a constant force becomes ok (rate limits may need some calls)."""
        return any(self(force).ok for _ in range(calls))


@functools.cache
def settles_from_reset(kind: str, n: int) -> bool:
    return Cell(kind, n).settle(GOOD)


def test_sane_forces_give_unit_directions_nonnegative_tensions_and_balance_when_ok(kind, n):
    cell = Cell(kind, n)
    rng = np.random.default_rng(n)
    answered = 0
    for _ in range(15 if kind in SLOW else 50):
        force = 0.225 * (np.array([0.0, 0.0, 9.81]) + rng.normal(size=3))
        status = cell(force)
        cell.check_usable()
        assert cell.info[INFO_BALANCE] == pytest.approx(cell.imbalance(force), abs=1e-12)
        if status.ok:
            answered += 1
            assert cell.imbalance(force) <= 1e-9 * np.linalg.norm(force)
    assert answered > 0 or not settles_from_reset(kind, n)


@pytest.mark.parametrize("name", SPECIAL)
def test_a_special_force_gives_a_usable_answer_at_first_and_between_good_ones(kind, n, name):
    for before in (0, 2):
        cell = Cell(kind, n)
        for _ in range(before):
            cell(GOOD)
        status = cell(SPECIAL[name])
        cell.check_usable()
        if not np.isfinite(SPECIAL[name]).all():
            assert status is Status.INVALID_FORCE
        if settles_from_reset(kind, n):
            assert cell.settle(GOOD)
        cell.check_usable()


def test_a_force_that_is_not_finite_repeats_the_last_answer(kind):
    cell = Cell(kind, 4)
    cell(GOOD)
    tensions, directions = cell.tensions.copy(), cell.directions.copy()
    assert cell([np.nan, 0.0, 1.0]) is Status.INVALID_FORCE
    assert np.array_equal(cell.tensions, tensions)
    assert np.array_equal(cell.directions, directions)


def test_no_force_needs_no_tension(kind):
    if kind in ("safe", "safe-wrench"):
        pytest.skip("holds its least tension instead")
    cell = Cell(kind, 4)
    cell(GOOD)
    assert cell([0.0, -0.0, 0.0]) is Status.ZERO_FORCE
    assert (cell.tensions == 0.0).all()


component = st.one_of(
    st.floats(-5.0, 5.0),
    st.floats(-1e9, 1e9),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -0.0, DENORMAL, 1e-160, 1e9, -1e9, 1e154, np.nan, np.inf, -np.inf]),
)
forces = st.one_of(
    st.sampled_from(sorted(SPECIAL.values(), key=str)), st.tuples(component, component, component)
)


@settings(max_examples=60, deadline=None)
@given(n=st.sampled_from(SIZES), sequence=st.lists(forces, min_size=1, max_size=8))
def test_any_sequence_of_forces_leaves_usable_answers_and_recovers(kind, n, sequence):
    if kind in SLOW:  # fewer cables, shorter sequences
        n, sequence = min(n, 3), sequence[:4]
    cell = Cell(kind, n)
    for force in sequence:
        cell(force)
        cell.check_usable()
    if settles_from_reset(kind, n):
        assert cell.settle(GOOD)
        assert cell.imbalance(GOOD) <= 1e-9 * np.linalg.norm(GOOD)


def test_same_inputs_give_bit_identical_answers(kind):
    rng = np.random.default_rng(3)
    n, calls = (4, 10) if kind in SLOW else (7, 100)
    sequence = np.array([0.0, 0.0, 2.2]) + rng.normal(size=(calls, 3))
    records = []
    for _ in range(2):
        cell = Cell(kind, n)
        record = []
        for force in sequence:
            status = cell(force)
            record.append((status, cell.tensions.tobytes(), cell.directions.tobytes()))
        records.append(record)
    assert records[0] == records[1]


@pytest.mark.skipif(not JIT_ENABLED, reason="counts allocations of compiled code")
def test_kernel_allocates_no_memory(kind):
    kernel = part.find("allocation", kind).kernel
    if not isinstance(kernel, numba.core.dispatcher.Dispatcher):
        pytest.skip("a plain Python kernel")

    @numba.njit
    def calls(
        count, forces, address, reference, nominal, params, memory, tensions, directions, info
    ):
        for k in range(count):
            force = forces[k % forces.shape[0]]
            ask(
                address, force, reference, nominal, 0.01, params, memory, tensions, directions, info
            )

    cell = Cell(kind, 4)
    noisy = GOOD + np.random.default_rng(0).normal(size=(64, 3))
    noisy[5] = np.nan
    noisy[6] = 0.0
    outputs = (cell.tensions, cell.directions, cell.info)
    nothing = getattr(unplanned, "py_func", unplanned)(4)
    bound = (
        address_of(kernel),
        np.zeros((4, 3)),
        nothing,
        cell.part.params(cell.team),
        cell.memory,
    )
    calls(1, noisy, *bound, *outputs)
    enabled = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    try:
        counts = []
        for count in (1, 10_000):
            before = rtsys.get_allocation_stats()
            calls(count, noisy, *bound, *outputs)
            after = rtsys.get_allocation_stats()
            counts.append((after.alloc - before.alloc, after.mi_alloc - before.mi_alloc))
    finally:
        if not enabled:
            _nrt_python.memsys_disable_stats()
    assert counts[0][1] > 0  # the arguments themselves are counted: the counter works
    assert counts[1] == counts[0]
