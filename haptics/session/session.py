"""A session: a placed scene rendered on a glove, recorded as it goes.

``run``, ``replay`` and engine servers share it. Its owner hands in poses and ticks; it never blocks and never picks a time.
"""

from __future__ import annotations

import math

import numpy as np

from haptics.devices.tactiles import COMMAND_LEAD_NS, Result
from haptics.judging.truth import Truth
from haptics.link.events import Event
from haptics.link.messages import BRAKE_CHANNELS, COIL_CHANNELS
from haptics.physics.brake.charging import rise_time_s
from haptics.physics.brake.contact import CONTACT
from haptics.physics.brake.parameters import BRAKE, capacitance_f
from haptics.physics.latch.pulse import travel_s
from haptics.rendering.loop import Leads, LoopEvent, RenderLoop
from haptics.scene.hands.check import ill_formed
from haptics.scene.hands.frame import HandFrame
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES, nominal_sites
from haptics.session.configuration import Configuration
from haptics.session.glove import Glove
from haptics.session.recorder import Recorder
from haptics.time import LATEST_NS, NS_PER_MS, NS_PER_S
from haptics.units import an_instance, whole_number

SAMPLE_NS = 10 * NS_PER_MS
"""The devices are sampled into the recording this often."""


def device_leads(configuration: Configuration, scene: Scene) -> Leads:
    """What each device needs ahead of a touch: the command's lead and the device's own time, from its model.

    Half of the steady capacity comes with about 1/√2 of the volts, charged by one supply for all outputs together, and the
    contact's lag on top.
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


class Session:
    """A placed scene on an open glove.

    :param scene: placed. :param glove: open; armed by its owner.
    :param recorder: takes rows, or None.
    :raises InputError: something else in place of these, here or in a call.
    """

    def __init__(
        self,
        scene: Scene,
        glove: Glove,
        configuration: Configuration,
        recorder: Recorder | None = None,
    ):
        an_instance("scene", scene, Scene, "from haptics.load_scene")
        an_instance("glove", glove, Glove, "from haptics.Glove")
        an_instance("configuration", configuration, Configuration, "from haptics.load_configuration")
        if recorder is not None:
            an_instance("recorder", recorder, Recorder, "on a journal, or None")
        self.scene, self.glove, self.recorder = scene, glove, recorder
        self.truth = Truth()
        self.results: list[Result] = []
        self.events: list[LoopEvent] = []
        self.leads = device_leads(configuration, scene)
        max_v = math.inf if glove.brakes is None else glove.brakes.max_amplitude_v
        self.loop = RenderLoop(
            scene,
            nominal_sites(),
            glove.tactiles,
            glove.brakes,
            self.leads,
            brake_amplitude_v=min(configuration.brake.amplitude_v, max_v),
            clutch_amplitude_v=min(configuration.brake.clutch_amplitude_v, max_v),
            tick_ns=NS_PER_S // configuration.tick_hz,
            side=None if configuration.side == "auto" else configuration.side,
        )
        self._times_armed = glove.times_armed
        self._array_plant = glove.plant("tactiles")
        self._brake_plant = glove.plant("brake")
        self._sample_ns = 0
        glove.on_event(self._take_link_event)

    def begin(self, start_ns: int) -> None:
        """The scene's own clock (motions, signals) reads zero at ``start_ns`` of the glove's time."""
        start_ns = whole_number("start_ns", start_ns, 0, LATEST_NS)
        self.loop.begin(start_ns)
        if self.recorder is not None:
            self.recorder.event(start_ns, "start")

    def submit(self, frame: HandFrame, now_ns: int) -> str | None:
        """A pose that arrived at ``now_ns``; returns why it was refused, or None. Never blocks.

        :raises InputError: no ``HandFrame`` at all.
        """
        an_instance("frame", frame, HandFrame, "with time, side and joints")
        now_ns = whole_number("now_ns", now_ns, 0, LATEST_NS)
        self._watch_arming(now_ns)
        reason = self.loop.submit(frame, now_ns)
        if self.recorder is not None and ill_formed(frame) is None:  # what has no row in the recording is an event there
            self.recorder.pose(now_ns, frame, reason is None)
        return reason

    def hand_gone(self, now_ns: int) -> None:
        """The tracker says there is no hand any more."""
        self.loop.hand_gone(whole_number("now_ns", now_ns, 0, LATEST_NS))

    def tick(self, now_ns: int) -> None:
        """One period of the loop: links to ``now_ns``, effects, drivers, rows."""
        if type(now_ns) is not int or not 0 <= now_ns <= LATEST_NS:
            now_ns = whole_number("now_ns", now_ns, 0, LATEST_NS)
        self._watch_arming(now_ns)
        self.glove.follow(now_ns)
        self.loop.tick(now_ns)
        self._observe(now_ns)

    def _watch_arming(self, now_ns: int) -> None:
        """Devices that were armed anew have forgotten what they did; so does the loop."""
        if self.glove.times_armed != self._times_armed:
            self._times_armed = self.glove.times_armed
            self.loop.start_over(now_ns)

    def settle(self) -> None:
        """Collect what came out after the last tick, while the glove went off."""
        self._observe(self.glove.now_ns(), last=True)

    def _observe(self, now_ns: int, last: bool = False) -> None:
        array = self.glove.tactiles
        if array is not None:
            for result in array.take_results():
                self.results.append(result)
                if self.recorder is not None:
                    self.recorder.request(now_ns, result.site, result.kind, result.played, result.reason, result.start_ns)
        if self.glove.brakes is not None:
            for refusal in self.glove.brakes.take_refusals():
                self.events.append(LoopEvent(now_ns, "derated", refusal.command, "", refusal.reason))
                self._note(self.events[-1])
        for event in self.loop.take_events():
            self.events.append(event)
            self._note(event)
        if last or now_ns >= self._sample_ns:
            self._sample_ns = now_ns + SAMPLE_NS
            self._sample(now_ns)
        if self.recorder is not None:
            self.recorder.acknowledge(now_ns)

    def _note(self, event: LoopEvent) -> None:
        if self.recorder is not None:
            self.recorder.event(event.time_ns, event.kind, event.subject, event.object, event.detail)

    def _sample(self, now_ns: int) -> None:
        rise_k, pin_out = np.zeros(COIL_CHANNELS), np.zeros(COIL_CHANNELS, dtype=np.uint8)
        volts, force_n, piezo = np.zeros(BRAKE_CHANNELS), np.zeros(BRAKE_CHANNELS), np.zeros(BRAKE_CHANNELS, dtype=np.uint8)
        gathered, array, brakes = self.truth, self.glove.tactiles, self.glove.brakes
        if self._array_plant is not None:
            truth = self._array_plant.truth()
            rise_k[:] = truth["rise_k"]
            pin_out[:] = [state == "on" for state in truth["latched"]]
            gathered.pins += [(time_ns, channel, kind) for time_ns, channel, kind, _ in truth["events"]]
            gathered.pin_speeds_m_s += [speed for *_, speed in truth["events"]]
            gathered.latched = truth["latched"]
            gathered.switches[:] = truth["switches"]
        elif array is not None:
            rise_k[: len(array.sites)] = array.rises_k(now_ns)
            pin_out[: len(array.sites)] = array.pins_out()
        if self._brake_plant is not None:
            truth = self._brake_plant.truth()
            volts[:], force_n[:], piezo[:] = truth["volts"], truth["capacity_n"], truth["piezo"]
            gathered.forces_n.append((now_ns, tuple(truth["capacity_n"])))
            gathered.brakes += [(time_ns, channel, kind) for time_ns, channel, kind, _ in truth["events"]]
            gathered.energy_j[:] = truth["energy_j"]
        elif brakes is not None and "brake" in self.glove.telemetry:
            volts[:] = self.glove.telemetry["brake"].output
        np.maximum(gathered.peak_rise_k, rise_k, out=gathered.peak_rise_k)
        np.maximum(gathered.peak_volts, np.abs(volts), out=gathered.peak_volts)
        np.maximum(gathered.peak_force_n, force_n, out=gathered.peak_force_n)
        if self.recorder is not None:
            self.recorder.tick(now_ns, rise_k, pin_out, volts, force_n, piezo)

    def _take_link_event(self, board: str, event: Event) -> None:
        if self.recorder is not None:
            self.recorder.link_event(board, event)

    @property
    def site_names(self) -> tuple[str, ...]:
        """Site of each channel of the array."""
        return SITES if self.glove.tactiles is None else self.glove.tactiles.sites
