"""What garments are made of, each number with its source (thesis 5.6.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from haptics.physics.parameters import Parameters, parameter
from haptics.units import one_of

Lame = Literal["plane", "thesis"]
"""plane: Lamé's constants of a sheet free to thin (plane stress). thesis: those of a solid, as eq. 5.6 may be read."""


@dataclass(frozen=True)
class Material(Parameters):
    """A sheet: isotropic, of one thickness."""

    young_pa: float = parameter(0.5e6, "Pa", "stated", "5.6.1: cloth", low=1.0, high=1e12)
    thickness_m: float = parameter(0.27e-3, "m", "stated", "5.6.1: base cloth", low=1e-6, high=0.02)
    poisson: float = parameter(0.33, "", "stated", "5.6.1, from work on elastic knits", low=0.0, high=0.49)

    def lame_n_m(self, lame: Lame = "plane") -> tuple[float, float]:
        """Lamé's (lambda, mu) times the thickness, N/m.

        mu = E / (2 (1 + nu)); lambda = E nu / (1 - nu^2) in plane stress, E nu / ((1 + nu) (1 - 2 nu)) as ``thesis``.

        :param lame: `plane` or `thesis`.
        :return: lambda and mu times the thickness, N/m.
        :raises InputError: a name that is neither.
        """
        one_of("lame", lame, ("plane", "thesis"))
        nu = self.poisson
        mu = self.young_pa / (2 * (1 + nu))
        lam = self.young_pa * nu / (1 - nu**2) if lame == "plane" else self.young_pa * nu / ((1 + nu) * (1 - 2 * nu))
        return lam * self.thickness_m, mu * self.thickness_m


@dataclass(frozen=True)
class ReinforcedMaterial(Material):
    """Cloth with the stretchable vinyl pressed on."""

    young_pa: float = parameter(5.7e6, "Pa", "stated", "5.6.1: reinforced cloth", low=1.0, high=1e12)
    thickness_m: float = parameter(0.35e-3, "m", "stated", "5.6.1: with the reinforcement added", low=1e-6, high=0.02)


CLOTH = Material()
REINFORCED = ReinforcedMaterial()


@dataclass(frozen=True)
class Interface(Parameters):
    """What holds a garment to the body, per area, so that it does not depend on the mesh."""

    attachment_n_m3: float = parameter(
        2.5e5,
        "N/m3",
        "assumed",
        "5.4.3 gives k = 0.002 a triangle centre with no unit; 2 N/m a triangle of 8 mm2",
        low=0.0,
        high=1e10,
    )
    contact_n_m3: float = parameter(1e8, "N/m3", "assumed", "a cloth pressed by 5 kPa sinks in by 50 um", low=1e4, high=1e12)
    rounding_m: float = parameter(20e-6, "m", "assumed", "contact sets in over this distance", low=1e-7, high=1e-3)
    regulariser_n_m3: float = parameter(
        300.0, "N/m3", "assumed", "pull towards the posed body's copy: places slack cloth, carries no load", low=0.0, high=1e5
    )


INTERFACE = Interface()
