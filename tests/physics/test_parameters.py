from __future__ import annotations

import doctest
import math

import pytest

from haptics.errors import InputError
from haptics.physics import parameters
from haptics.physics.brake.charging import DRIVE
from haptics.physics.brake.contact import CONTACT
from haptics.physics.brake.finger import FINGER
from haptics.physics.brake.parameters import BRAKE
from haptics.physics.latch.parameters import LATCH
from haptics.physics.latch.recoil import RECOIL
from haptics.physics.latch.travel import TRAVEL
from haptics.physics.parameters import provenance
from haptics.physics.piezo import PIEZO
from haptics.physics.thermal.one_node import THERMAL
from haptics.physics.thermal.two_node import TWO_NODE

SETS = [BRAKE, CONTACT, DRIVE, FINGER, LATCH, PIEZO, RECOIL, THERMAL, TRAVEL, TWO_NODE]


@pytest.mark.parametrize("parameters_of", SETS, ids=lambda p: type(p).__name__)
def test_every_parameter_says_unit_source_and_lies_in_its_own_range(parameters_of):
    rows = provenance(parameters_of)
    assert len(rows) == len(vars(parameters_of))
    for row in rows:
        assert row.unit
        assert row.source
        assert row.provenance in ("stated", "derived", "identified", "assumed")
        assert row.low <= row.value <= row.high


def test_a_value_outside_its_range_is_refused_with_name_value_and_range():
    with pytest.raises(InputError, match=r"tau_s = -1 s; allowed 0.001 to 1000000 s"):
        THERMAL.with_values(tau_s=-1.0)
    with pytest.raises(InputError, match="mass_kg"):
        LATCH.with_values(mass_kg=math.nan)


def test_an_unknown_parameter_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"'tau' is unknown.*tau_s"):
        THERMAL.with_values(tau=1.0)


def test_examples_in_the_docstring():
    assert doctest.testmod(parameters).failed == 0
