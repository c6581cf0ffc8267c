from __future__ import annotations

import numpy as np
import pytest

from haptics.errors import HapticsError
from rigs.judge import judge, ngspice_version
from rigs.judge.ngspice import read_raw, simulate
from rigs.judge.transient import Transient

RC = """* one resistor, one capacitor
V1 in 0 5
R1 in Out 1k
C1 Out 0 1u ic=0
.save v(Out) i(V1)
.options reltol=1e-7 chgtol=5e-6 trtol=1
.tran 1u 5m 0 10u uic
.end
"""


@pytest.mark.usefixtures("simulator")
def test_a_known_circuit_gives_the_known_answer():
    saved = simulate(RC)
    assert set(saved) == {"time", "v(out)", "i(v1)"}
    assert saved["time"][-1] == pytest.approx(5e-3, rel=1e-12)
    exact = 5.0 * -np.expm1(-saved["time"] / 1e-3)
    # Trapezoids of at most 10 us on a time constant of 1 ms: (h/tau)^2/12 x exp(-x) <= 3.1e-6 of 5 V; 1e-7 of 5 V a step.
    assert np.abs(saved["v(out)"] - exact).max() < 5.0 * 3.1e-6 + 5e-7 * len(exact)


@pytest.mark.usefixtures("simulator")
def test_the_version_is_a_number():
    assert int(ngspice_version().split(".")[0]) >= 30


@pytest.mark.usefixtures("simulator")
@pytest.mark.parametrize(
    ("wrong", "named"),
    [(("C1 Out 0 1u ic=0", "Q1 Out 0"), "q1 out 0"), (("V1 in 0 5", "V1 in 0 5 PWL(0)"), "error")],
)
def test_a_netlist_that_is_refused_is_told_with_the_first_error(wrong, named):
    with pytest.raises(HapticsError, match=r"ngspice failed with exit status \d+: .*rror") as caught:
        simulate(RC.replace(*wrong))
    assert named in str(caught.value).lower()


def test_without_ngspice_every_way_in_says_so_plainly(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    for way in (ngspice_version, lambda: simulate(RC), lambda: judge(quick=True)):
        with pytest.raises(
            HapticsError, match="ngspice is not installed or not on the PATH; it is the package ngspice of Debian"
        ):
            way()


def test_a_program_of_another_kind_is_found_out(monkeypatch, tmp_path):
    other = tmp_path / "ngspice"
    other.write_text("#!/bin/sh\necho hello\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(HapticsError, match="prints 'hello"):
        ngspice_version()
    with pytest.raises(HapticsError, match="exit status 0: its log names no error"):
        simulate(RC)


def test_a_raw_file_that_is_broken_off_is_refused():
    head = "No. Variables: 2\nNo. Points: 2\nVariables:\n\t0\ttime\ttime\n\t1\tv(a)\tvoltage\n"
    whole = head + "Values:\n0\t0.0\n\t1.5\n1\t1e-3\n\t2.5\n"
    assert read_raw(whole)["v(a)"].tolist() == [1.5, 2.5]
    for broken in (whole[:-6], whole.replace("Values:", "Binary:"), ""):
        with pytest.raises(HapticsError, match="expected: an ASCII raw file"):
            read_raw(broken)


def test_a_staircase_has_its_edges_centred_and_longer_than_the_simulator_can_merge():
    course = Transient(1.0, 1e-3)
    assert course.source([(0.0, 1.0), (0.5, 3.0)]) == f"PWL(0 1.0 {0.5 - 1e-7!r} 1.0 {0.5 + 1e-7!r} 3.0)"
    # ngspice merges instants closer than 5e-5 of the longest step.
    assert course.edge_s > 2 * 5e-5 * course.longest_s
