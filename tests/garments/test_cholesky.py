"""Each installed sparse Cholesky solves what a dense one solves, again and again, and tells an indefinite matrix."""

from __future__ import annotations

import ctypes
import os

import numpy as np
import pytest
from scipy.sparse import csr_array
from tube import tube

from haptics.errors import InputError
from haptics.garments.equilibrium.cholesky import NotDefinite, installed_solvers, open_solver
from haptics.garments.equilibrium.ordering import nested_dissection
from haptics.garments.equilibrium.stiffness import StiffnessPattern


@pytest.fixture(scope="module")
def pattern() -> StiffnessPattern:
    vertices, triangles, _ = tube(12, 0.15)
    return StiffnessPattern(len(vertices), triangles)


def definite(pattern: StiffnessPattern, seed: int) -> np.ndarray:
    """Entries of a random symmetric positive definite matrix with the pattern: B B' of each triangle, and the identity."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(len(pattern._element), 9, 9))
    vertices = len(pattern._diagonal)
    return pattern.values(root @ root.transpose(0, 2, 1), np.tile(np.eye(3), (vertices, 1, 1)))


def dense(pattern: StiffnessPattern, values: np.ndarray) -> np.ndarray:
    return csr_array((values, pattern.indices, pattern.indptr)).toarray()


def test_scipys_is_always_there():
    assert installed_solvers()[-1] == "superlu"


@pytest.mark.parametrize("name", installed_solvers())
def test_it_solves_as_a_dense_solver_does_and_can_be_refilled(name, pattern):
    solver = open_solver(name, pattern.indptr, pattern.indices)
    assert solver.name == name
    right = np.random.default_rng(9).normal(size=len(pattern.indptr) - 1)
    for seed in range(3):
        values = definite(pattern, seed)
        solver.factorise(values)
        expected = np.linalg.solve(dense(pattern, values), right)
        assert np.abs(solver.solve(right) - expected).max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("name", installed_solvers())
def test_an_indefinite_matrix_is_told_and_the_next_one_still_solved(name, pattern, capfd):
    solver = open_solver(name, pattern.indptr, pattern.indices)
    values = definite(pattern, 0)
    shift = np.linalg.eigvalsh(dense(pattern, values))[:2].mean()  # one eigenvalue below zero
    rows = np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))
    with pytest.raises(NotDefinite):
        solver.factorise(values - shift * (rows == pattern.indices))
    ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)
    assert capfd.readouterr() == ("", "")  # not a word among the answers of a command
    solver.factorise(values)
    right = np.ones(len(pattern.indptr) - 1)
    assert dense(pattern, values) @ solver.solve(right) == pytest.approx(right, abs=1e-9)


def test_an_unknown_solver_is_refused_with_those_that_are_there(pattern):
    with pytest.raises(InputError, match=r"solver = 'mumps' is not allowed; allowed: .*superlu"):
        open_solver("mumps", pattern.indptr, pattern.indices)


def test_a_solver_whose_library_is_missing_is_passed_over_and_by_name_refused(pattern, monkeypatch):
    import haptics.garments.equilibrium.cholesky as cholesky

    def broken(indptr, indices):
        raise ImportError("libnothing.so: cannot open shared object file")

    others = installed_solvers()
    monkeypatch.setattr(cholesky, "_SOLVERS", {"broken": ("scipy", broken), **cholesky._SOLVERS})
    assert open_solver(None, pattern.indptr, pattern.indices).name == others[0]
    with pytest.raises(InputError, match="solver = 'broken' cannot be loaded: libnothing"):
        open_solver("broken", pattern.indptr, pattern.indices)


def test_the_pattern_adds_up_overlapping_triangles(pattern):
    rng = np.random.default_rng(4)
    vertices, triangles, _ = tube(12, 0.15)
    element = rng.normal(size=(len(triangles), 9, 9))
    own = rng.normal(size=(len(vertices), 3, 3))
    expected = np.zeros((3 * len(vertices), 3 * len(vertices)))
    for e, corners in enumerate(triangles):
        unknowns = (3 * corners[:, None] + np.arange(3)).ravel()
        expected[np.ix_(unknowns, unknowns)] += element[e]
    for i in range(len(vertices)):
        expected[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += own[i]
    assert np.abs(dense(pattern, pattern.values(element, own)) - expected).max() < 1e-12


def test_fixed_unknowns_have_the_identitys_rows():
    vertices, triangles, _ = tube(12, 0.15)
    fixed = np.zeros(vertices.shape, dtype=bool)
    fixed[3] = True
    fixed[7, 1] = True
    held = StiffnessPattern(len(vertices), triangles, fixed)
    matrix = dense(held, definite(held, 1))
    for unknown in (9, 10, 11, 22):
        row = np.eye(3 * len(vertices))[unknown]
        assert np.array_equal(matrix[unknown], row)
        assert np.array_equal(matrix[:, unknown], row)


def test_nested_dissection_orders_all_and_keeps_the_factor_small():
    """The factor's size by symbolic elimination, counted from the elimination tree's row structure."""
    vertices, triangles, _ = tube(60, 0.28)  # as long as around
    pattern = StiffnessPattern(len(vertices), triangles)
    graph = csr_array((np.ones(len(pattern.indices)), pattern.indices, pattern.indptr))[::3, ::3]
    order = nested_dissection(graph)
    assert np.array_equal(np.sort(order), np.arange(len(vertices)))
    random = np.random.default_rng(0).permutation(len(vertices))
    along = np.lexsort((vertices[:, 1], vertices[:, 2]))
    assert factor_size(graph, order) < 0.75 * factor_size(graph, along)
    assert factor_size(graph, order) < 0.25 * factor_size(graph, random)


def factor_size(graph: csr_array, order: np.ndarray) -> int:
    """Entries of the Cholesky factor when vertices are eliminated in this order: each joins all its remaining neighbours."""
    place = np.argsort(order)
    neighbours = [set(place[graph.indices[graph.indptr[v] : graph.indptr[v + 1]]]) for v in order]
    total = 0
    for i in range(len(order)):
        later = {k for k in neighbours[i] if k > i}
        total += 1 + len(later)
        if later:
            neighbours[min(later)] |= later  # its parent in the elimination tree inherits the rest
    return total


def test_separate_pieces_are_ordered_too():
    vertices, triangles, _ = tube(12, 0.15)
    both = np.vstack([triangles, triangles + len(vertices)])
    pattern = StiffnessPattern(2 * len(vertices), both)
    graph = csr_array((np.ones(len(pattern.indices)), pattern.indices, pattern.indptr))[::3, ::3]
    assert np.array_equal(np.sort(nested_dissection(graph)), np.arange(2 * len(vertices)))
