"""How long before a touch each device has to be driven."""

from __future__ import annotations

import math

from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.physics.brake.charging import rise_time_s
from haptics.physics.brake.contact import CONTACT
from haptics.physics.brake.parameters import BRAKE, capacitance_f
from haptics.physics.latch.pulse import travel_s
from haptics.rendering.loop import Leads
from haptics.scene.scene import Scene
from haptics.session.configuration import Configuration
from haptics.time import NS_PER_S


def device_leads(configuration: Configuration, scene: Scene) -> Leads:
    """What each device needs ahead of a touch: the command's lead and the device's own time, from its model.

    Half of the steady capacity comes with about 1/√2 of the volts, charged by one supply for all outputs together, and the
    contact's lag on top (thesis 4.4.3).

    :param configuration: the brake's volts and overlap.
    :param scene: how many brakes close together.
    :return: leads, s.
    """
    brake = configuration.brake
    outputs = max(1, len(scene.needs.brakes))
    total_f = outputs * capacitance_f(brake.overlap_m2, BRAKE.thickness_m, BRAKE.permittivity)
    charge_s = rise_time_s(brake.amplitude_v, total_f, share=math.sqrt(0.5)) if brake.amplitude_v else 0.0
    command_s = COMMAND_LEAD_NS / NS_PER_S
    return Leads(
        pin_s=command_s + travel_s("off-on"),
        pin_back_s=command_s + travel_s("on-off"),
        brake_s=command_s + charge_s + CONTACT.tau_on_s * math.log(2.0),
    )
