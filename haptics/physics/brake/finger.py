"""A finger against a brake: a hand that pulls, a finger with mass, and strips that hold, stretch, slide, or hang loose.

::

    hand q --[k_l, c_l]-- finger y, mass m --[slack]--[k_s]-- strips slid apart by s, holding up to F
    m v' = k_l (q - y) + c_l (q' - v) - c v - T          T = k_s max(0, y - s - slack) <= F

``q`` is where the hand (or a pull tester's clamp) wants the finger, ``T`` the tension that the finger feels, ``F`` the brake's
capacity. The strips slide (``s`` grows) as far as it takes to keep ``T`` at the capacity. They cannot push: a finger that comes
back finds them loose. Once it has come back by all the slack it pushes them together again, without force and no further than
they began: ``0 <= s <= max(0, y)``. What slides apart is overlap lost (thesis 4.7.3: slack, rise, plateau).

Levels ``static`` and ``lagged`` take the hand for slow: no mass, no damping, hand and strips in series.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.physics.parameters import Parameters, parameter


@dataclass(frozen=True)
class FingerParameters(Parameters):
    """Finger, hand and the elasticity of strips. A pull tester is a hand of high ``load_stiffness_n_m``."""

    finger_mass_kg: float = parameter(0.02, "kg", "assumed", "moving part of a finger", low=1e-4, high=100.0)
    damping_n_s_m: float = parameter(0.5, "N s/m", "assumed", "finger and glove", low=0.0, high=1e5)
    load_stiffness_n_m: float = parameter(1000.0, "N/m", "assumed", "tensed muscle", low=1.0, high=3e5)
    load_damping_n_s_m: float = parameter(5.0, "N s/m", "assumed", "half of critical", low=0.0, high=1e5)
    slack_m: float = parameter(1e-3, "m", "assumed", "play before strips are taut (seen in 4.7.3)", low=0.0, high=1.0)
    strip_stiffness_n_m: float = parameter(4e3, "N/m", "assumed", "steel strip, anchors and fabric in series", low=1.0, high=1e7)


FINGER = FingerParameters()


def series_stiffness_n_m(finger: FingerParameters = FINGER) -> float:
    """Hand and strips in series, ``k_l k_s / (k_l + k_s)``: what a slow pull works against.

    :param finger: hand and strips.
    :return: stiffness (N/m).
    """
    k_l, k_s = finger.load_stiffness_n_m, finger.strip_stiffness_n_m
    return k_l * k_s / (k_l + k_s)


def finger_parameters(finger: FingerParameters = FINGER) -> tuple[float, ...]:
    """The parameters in the order that the inner loops unpack them.

    :param finger: hand and strips.
    :return: mass (kg), damping (N s/m), the hand's stiffness (N/m) and damping (N s/m), slack (m), the strips' stiffness (N/m).
    """
    return (
        float(finger.finger_mass_kg),
        float(finger.damping_n_s_m),
        float(finger.load_stiffness_n_m),
        float(finger.load_damping_n_s_m),
        float(finger.slack_m),
        float(finger.strip_stiffness_n_m),
    )
