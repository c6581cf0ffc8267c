"""A thousand gloves at once: how many of their pins still switch on a supply that sags, coils drawn from the stated band."""

import numpy as np

from haptics.physics import LatchBank

rng = np.random.default_rng(1)
resistance_ohm = rng.uniform(1.28, 1.48, 15_000)  # thesis 3.4.3: 1.38 +- 0.1 ohm

for supply_v in (5.0, 4.5, 4.0, 3.5, 3.0):
    pins = LatchBank(15_000, resistance_ohm=resistance_ohm, latched="on")
    pins.drive(0.0, -supply_v)  # back, the weaker way
    pins.drive(0.010, 0.0)
    pins.advance(0.2)
    back = pins.latched == -1
    slowest = f", the slowest in {1e3 * pins.reached_off_s[back].max():5.2f} ms" if back.any() else ""
    print(f"{supply_v:.1f} V: {100 * back.mean():6.2f} % of the pins come back{slowest}")
