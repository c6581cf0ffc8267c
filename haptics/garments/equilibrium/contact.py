"""Contact between cloth and skin: a penalty that pushes only (thesis eq. 5.3), set in without a kink.

    g(s) = s^3 / 6r          up to the depth s = r
           s^2/2 - rs/2 + r^2/6    beyond

so that the energy k g(-Phi) has two continuous derivatives, and beyond the rounding r is eq. 5.3's parabola.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptics.garments.mesh import Floats


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact at the vertices of a garment.

    :param scale_n_m: stiffness k at each vertex, N/m, ``(vertices,)``.
    :param rounding_m: depth r over which contact sets in, m, above 0.
    """

    scale_n_m: Floats
    rounding_m: float

    def energy_j(self, phi_m: Floats) -> Floats:
        """Energy of each vertex.

        :param phi_m: signed distance of each vertex from the skin, m, negative inside, +inf beyond reach, ``(vertices,)``.
        :return: k g(-phi), J, ``(vertices,)``.
        """
        s, r = np.maximum(-phi_m, 0.0), self.rounding_m
        return self.scale_n_m * np.where(s < r, s**3 / (6 * r), s**2 / 2 - r * s / 2 + r**2 / 6)

    def slope_n(self, phi_m: Floats) -> Floats:
        """Derivative of the energy by the distance: never positive, it pushes outward.

        :param phi_m: as in ``energy_j``.
        :return: force, N, ``(vertices,)``.
        """
        s, r = np.maximum(-phi_m, 0.0), self.rounding_m
        return -self.scale_n_m * np.where(s < r, s**2 / (2 * r), s - r / 2)

    def stiffness_n_m(self, phi_m: Floats) -> Floats:
        """Second derivative of the energy by the distance.

        :param phi_m: as in ``energy_j``.
        :return: stiffness, N/m, 0 to k, ``(vertices,)``.
        """
        return self.scale_n_m * np.minimum(np.maximum(-phi_m, 0.0) / self.rounding_m, 1.0)
