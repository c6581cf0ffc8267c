"""Laws refuse to go past what they were fitted over, predictions say that they do."""

from __future__ import annotations

import pytest

from haptics.errors import InputError
from haptics.physics import predict_brake, predict_thermal
from haptics.physics.fitted import refuse_outside


def test_what_lies_outside_is_refused_by_name_unless_it_is_meant() -> None:
    refuse_outside("volts = 1 V", ())
    refuse_outside("volts = 9 V", ("9 V is above 5 V",), extrapolate=True)
    with pytest.raises(InputError, match="volts = 9 V: 9 V is above 5 V; 9 V is odd; pass extrapolate=True"):
        refuse_outside("volts = 9 V", ("9 V is above 5 V", "9 V is odd"))


def test_a_prediction_of_a_brake_says_what_its_law_was_not_fitted_for() -> None:
    assert predict_brake(1500.0).extrapolated == ()
    (beyond,) = predict_brake(1500.0, "thumb").extrapolated
    assert "800 V up to which law threshold was fitted" in beyond
    (film,) = predict_brake(1000.0, thickness_m=26e-6).extrapolated
    assert "26 um is not the 13 um" in film
    assert predict_brake(1e5).extrapolated == ()  # past breakdown there is no force to extrapolate


def test_a_prediction_of_heat_says_when_it_is_hotter_than_what_was_measured() -> None:
    assert predict_thermal(120.0).extrapolated == ()
    (hot,) = predict_thermal(600.0).extrapolated
    assert "above the 25 K up to which heating was measured" in hot
    assert predict_thermal(600.0, minutes=0.1).extrapolated == ()
