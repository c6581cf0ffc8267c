"""Sparse Cholesky from what is installed: the same matrix pattern factored again and again.

| name | library | licence | needs |
| --- | --- | --- | --- |
| pardiso | oneMKL through pypardiso | BSD-3 wrapper, MKL under Intel's Simplified Software License | extra `solver` |
| cholmod | SuiteSparse through cvxopt | GPL-3 | installed by you: never required here |
| superlu | SuperLU through scipy | BSD-3 | nothing: always there |

Fastest first, as measured by `make bench`.
"""

from __future__ import annotations

import ctypes
import os
import sys
import weakref
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from haptics.errors import HapticsError, InputError
from haptics.garments.equilibrium.ordering import nested_dissection
from haptics.garments.mesh import Floats
from haptics.units import one_of

Indices = NDArray[np.int32]


class NotDefinite(HapticsError):
    """The matrix is not positive definite: no Cholesky factor exists."""


class SparseCholesky(Protocol):
    """A factorisation that can be redone for other values on the same pattern."""

    name: str

    def factorise(self, values: Floats) -> None:
        """Factor the matrix with these values.

        :param values: all entries in the pattern's order, row by row, ``(entries,)``.
        :raises NotDefinite: it has no Cholesky factor.
        """
        ...

    def solve(self, right: Floats) -> Floats:
        """Solve A x = right with the last factor.

        :param right: right-hand side, ``(n,)``.
        :return: x, ``(n,)``.
        """
        ...


def installed_solvers() -> list[str]:
    """Names of the solvers that can be had here, fastest first.

    :return: some of `pardiso`, `cholmod`, `superlu`; the last is always among them.
    """
    return [name for name, (module, _) in _SOLVERS.items() if find_spec(module)]


def open_solver(name: str | None, indptr: Indices, indices: Indices) -> SparseCholesky:
    """A solver for symmetric matrices of this pattern (compressed rows, both triangles, sorted).

    :param name: one of ``installed_solvers()``; None takes the first that can be loaded.
    :param indptr: where each row begins, as in a CSR matrix, ``(n + 1,)``.
    :param indices: column of each entry, ``(entries,)``.
    :return: the solver, without a factor yet.
    :raises InputError: a solver that is not installed, or cannot be loaded.
    """
    names = installed_solvers()
    if name is not None:
        try:
            return _SOLVERS[one_of("solver", name, names)][1](indptr, indices)
        except ImportError as error:
            raise InputError(f"solver = {name!r} cannot be loaded: {error}; installed: {', '.join(names)}") from error
    for candidate in names:
        with suppress(ImportError):  # the wrapper is there, but not the library that it wraps
            return _SOLVERS[candidate][1](indptr, indices)
    raise HapticsError("no sparse solver can be loaded, not even scipy's")


class _Upper:
    """The upper triangle of a symmetric pattern by rows, which is also the lower one by columns."""

    def __init__(self, indptr: Indices, indices: Indices):
        rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        self.kept = np.flatnonzero(indices >= rows)
        self.rows = rows[self.kept].astype(np.int32)
        self.indices = indices[self.kept].astype(np.int32)
        self.indptr = np.concatenate([[0], np.cumsum(np.bincount(self.rows, minlength=len(indptr) - 1))]).astype(np.int32)


def _mkl_beside_python() -> str | None:
    """MKL as pip installs it; None where it is elsewhere, or cannot be loaded."""
    for folder in ("lib", "Library/bin"):
        for path in sorted(Path(sys.prefix, folder).glob("*mkl_rt*")):
            with suppress(OSError):
                ctypes.CDLL(str(path))
                return str(path)
    return None


class _Pardiso:
    name = "pardiso"

    def __init__(self, indptr: Indices, indices: Indices):
        from pypardiso import PyPardisoSolver
        from scipy.sparse import csr_matrix

        self._upper = _Upper(indptr, indices)
        # Else the wrapper asks linker and compiler, and looks through all installed packages: most of a second.
        if "PYPARDISO_MKL_RT" not in os.environ and (beside := _mkl_beside_python()):
            os.environ["PYPARDISO_MKL_RT"] = beside
        self._solver: Any = PyPardisoSolver(mtype=2)  # real, symmetric, positive definite
        os.environ.setdefault("PYPARDISO_MKL_RT", self._solver.libmkl._name)
        # On several threads the last bits of the result change from run to run, and at this size little is gained.
        self._solver.libmkl.MKL_Set_Num_Threads(1)
        # Settings of its own instead of MKL's: nested dissection, and no refinement of the solution, which Newton's next step is.
        self._solver.set_iparm(1, 1)
        self._solver.set_iparm(2, 2)
        n = len(indptr) - 1
        self._matrix = csr_matrix((np.zeros(len(self._upper.indices)), self._upper.indices, self._upper.indptr), shape=(n, n))
        self._none: Floats = np.zeros((n, 1))
        self._analysed = False
        # MKL keeps the factor in its own memory.
        weakref.finalize(self, self._solver.free_memory, everything=True).atexit = False

    def factorise(self, values: Floats) -> None:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._matrix.data[:] = values[self._upper.kept]
        self._solver.set_phase(22 if self._analysed else 12)
        try:
            self._solver._call_pardiso(self._matrix, self._none)
        except PyPardisoError as error:
            raise NotDefinite(f"pardiso: {error}") from error
        self._analysed = True

    def solve(self, right: Floats) -> Floats:
        self._solver.set_phase(33)
        return self._solver._call_pardiso(self._matrix, right.reshape(-1, 1)).ravel()


class _Cholmod:
    name = "cholmod"

    def __init__(self, indptr: Indices, indices: Indices):
        from cvxopt import cholmod, matrix, spmatrix  # pyright: ignore[reportMissingImports, reportAttributeAccessIssue]

        self._upper = _Upper(indptr, indices)
        n = len(indptr) - 1
        rows, columns = matrix(self._upper.indices.astype(int)), matrix(self._upper.rows.astype(int))
        self._matrix = spmatrix(1.0, rows, columns, (n, n))
        self._cholmod, self._convert = cholmod, matrix
        self._factor: Any = cholmod.symbolic(self._matrix)

    def factorise(self, values: Floats) -> None:
        self._matrix.V = self._convert(np.ascontiguousarray(values[self._upper.kept]))
        try:
            self._cholmod.numeric(self._matrix, self._factor)
        except ArithmeticError as error:
            raise NotDefinite(f"cholmod: no pivot left at row {error}") from error

    def solve(self, right: Floats) -> Floats:
        x = self._convert(np.ascontiguousarray(right))
        self._cholmod.solve(self._factor, x)
        return np.array(x).ravel()


class _SuperLu:
    name = "superlu"

    def __init__(self, indptr: Indices, indices: Indices):
        from scipy.sparse import csc_array, csr_array

        n = len(indptr) - 1
        # Three unknowns a vertex share a pattern: the order is that of the vertices.
        places = cast(Any, csr_array((np.arange(len(indices)), indices, indptr), shape=(n, n)))
        vertices = nested_dissection(csr_array((np.ones(len(indices)), indices, indptr), shape=(n, n))[::3, ::3])
        self._order = (3 * vertices[:, None] + np.arange(3)).ravel()
        ordered = csc_array(places[self._order][:, self._order])
        ordered.sort_indices()
        self._place = ordered.data.astype(np.int64)
        self._matrix = csc_array((np.zeros(len(indices)), ordered.indices, ordered.indptr), shape=(n, n))
        self._factor: Any = None

    def factorise(self, values: Floats) -> None:
        from scipy.sparse.linalg import splu

        self._matrix.data[:] = values[self._place]
        try:
            factor = splu(self._matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise NotDefinite(f"superlu: {error}") from error
        # Without exchange of rows the pivots carry the signs of the eigenvalues.
        if not np.array_equal(factor.perm_r, factor.perm_c) or factor.U.diagonal().min() <= 0:
            raise NotDefinite("superlu: a pivot is not positive")
        self._factor = factor

    def solve(self, right: Floats) -> Floats:
        x = np.empty_like(right)
        x[self._order] = self._factor.solve(right[self._order])
        return x


_SOLVERS: dict[str, tuple[str, Callable[[Indices, Indices], SparseCholesky]]] = {
    "pardiso": ("pypardiso", _Pardiso),
    "cholmod": ("cvxopt", _Cholmod),
    "superlu": ("scipy", _SuperLu),
}
