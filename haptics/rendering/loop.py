"""The loop: poses come in at their own rate, devices get their commands every tick.

A pose moves the hand's sites; touches are predicted and decided once per pose
(``docs/decisions/0005-decide-when-a-pose-arrives.md``), and a tick only compares times. What a scene asks for (contact, fixed
sets, patterns; grasps and clutch rules by ``Grasping`` and ``Clutching``) is mapped to the drivers in this folder and nowhere
else. The loop never blocks, and refuses poses that cannot be a hand's.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.rendering.clutching import Clutching
from haptics.rendering.events import LoopEvent
from haptics.rendering.grasping import Grasping
from haptics.rendering.pace_watch import PaceWatch
from haptics.rendering.touch_ahead import TouchAhead
from haptics.scene.contact import PinChange, Touch
from haptics.scene.geometry.shapes import Placed
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.pose_gate import PoseGate
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES, SiteMap
from haptics.time import NS_PER_MS, NS_PER_S

STALE_NS = 50 * NS_PER_MS
"""A pose older than this is no longer predicted from."""
LOST_NS = 100 * NS_PER_MS
"""Where no pose has arrived for this long, everything goes off, whatever time the last one claimed to be of."""
PATTERN_LEAD_NS = 4 * NS_PER_MS
"""A pattern's pulses are handed on this long ahead: the command lead and a tick."""


@dataclass(frozen=True, slots=True)
class Leads:
    """How long before the touch a device must be commanded: command lead and the device's own time, from its model.

    :param pin_s: from the coil pulse to the pin at the skin, s.
    :param pin_back_s: from the coil pulse to the pin back in, s.
    :param brake_s: from the drive to half of the steady blocking force, s; from total capacitance and volts.
    """

    pin_s: float
    pin_back_s: float
    brake_s: float


class RenderLoop:
    """Scene in, driver calls out.

    :param scene: placed, so that every object has a place in the world.
    :param sites: where the hand's sites are.
    :param tactiles: driver of the array, or None where the scene has no use for one.
    :param brake: driver of brakes or clutches, or None.
    :param leads: how long before a touch each device must be commanded.
    :param brake_amplitude_v: cap on a grasp's drive, V.
    :param clutch_amplitude_v: cap on a clutch's drive, V.
    :param tick_ns: planned length of a tick; at twice that or more the loop reports ``overrun``, once until it recovers.
    :param side: of the hand that wears the glove; None follows the one that comes first.
    """

    def __init__(
        self,
        scene: Scene,
        sites: SiteMap,
        tactiles: TactilesDriver | None,
        brake: BrakeDriver | None,
        leads: Leads,
        brake_amplitude_v: float = 1500.0,
        clutch_amplitude_v: float = 1500.0,
        tick_ns: int = NS_PER_MS,
        side: str | None = None,
    ):
        self.scene, self.sites = scene, sites
        self.tactiles, self.brake = tactiles, brake
        self._start_ns = 0
        self._events: list[LoopEvent] = []
        self._contacts = scene.contact_tracker()
        self._patterns = scene.pattern_bank()
        self._watched = self._patterns.watched
        self._grasps = Grasping(scene, brake, brake_amplitude_v, round(leads.brake_s * NS_PER_S), STALE_NS, self._events.append)
        self._clutches = Clutching(scene, brake, clutch_amplitude_v, self._events.append)
        self.signals = self._clutches.signals
        self._bodies: dict[str, Placed] = {item.name: item.body for item in scene.objects}
        self._moving = tuple(item for item in scene.objects if item.motion is not None)
        self._touchable = tuple(item.name for item in scene.objects if _can_be_touched(scene, item.name))
        self._touch_ahead = TouchAhead(
            self.body,
            self._touchable,
            [item.name for item in self._moving if item.name in self._touchable],
            sites.radius_m,
            round(leads.pin_s * NS_PER_S),
            round(leads.pin_back_s * NS_PER_S),
            STALE_NS,
        )
        self._pace = PaceWatch(tick_ns)
        self._gate = PoseGate(side)
        self._followed: tuple[str, int] | None = None
        self._heard_ns: int | None = None  # when the last pose that was accepted arrived
        self._quiet = False
        self._absent = False  # no pose since the devices were armed anew, or the hand has gone: nothing is felt without one
        self._left_out: list[str] = []

    def begin(self, start_ns: int) -> None:
        """Start the scene's own clock, which its motions and signals follow.

        :param start_ns: when that clock reads zero.
        """
        self._start_ns = start_ns
        self._clutches.begin(start_ns)

    def start_over(self, now_ns: int) -> None:
        """Begin anew after the devices were armed: what was felt before is over, until a new pose decides otherwise.

        Pins that stayed out meanwhile, as they are bistable, stay until that pose comes, and go back then.

        :param now_ns: when the devices were armed.
        """
        self._forget(now_ns)
        self._heard_ns, self._absent = None, True
        if self.tactiles is not None:
            self._left_out = [site for site, out in zip(self.tactiles.sites, self.tactiles.pins_out(), strict=True) if out]

    # Poses ----------------------------------------------------------------------------------------------------------

    def submit(self, frame: HandFrame, now_ns: int) -> str | None:
        """Take a pose that has arrived.

        :param frame: 26 joints in OpenXR's basis.
        :param now_ns: when it arrived, on the clock of ``tick``.
        :return: why it was refused, or None if it was taken.
        :raises InputError: not a ``HandFrame``; one with wrong fields is refused with the reason like any other bad pose.
        """
        reason = self._gate.judge(frame, now_ns)
        if reason is not None:
            side = frame.side if isinstance(frame.side, str) and frame.side in SIDES else ""
            self._events.append(LoopEvent(now_ns, "pose_refused", side, "", reason))
            return reason
        if self._gate.starts_anew:
            self._let_go(now_ns)
        if (frame.side, frame.track_id) != self._followed:
            self._followed = (frame.side, frame.track_id)
            self._note_handedness(frame, now_ns)
        self._heard_ns, self._absent = now_ns, False
        if self._left_out and self.tactiles is not None:
            for site in self._left_out:
                self.tactiles.release(site, now_ns)
            self._left_out.clear()
        self._move_objects(frame.time_ns)
        positions = self.sites.positions(frame.position_m, frame.orientation_xyzw)
        if self._quiet:
            self._resume(positions, now_ns)
        if self._grasps.names:
            self._grasps.observe(frame.time_ns, positions, now_ns, self._quiet)
            for name in self._grasps.names:
                self._bodies[name] = self._grasps.body(name)
        if not self._quiet:
            if self._touchable:
                self._touch_ahead.observe(frame.time_ns, positions, now_ns, self._grasps.held)
            for name in self._watched:
                nearest_m = float((self._bodies[name].distance(positions) - self.sites.radius_m).min())
                self._patterns.approach(name, nearest_m, now_ns)
        return None

    def _move_objects(self, time_ns: int) -> None:
        time_s = (time_ns - self._start_ns) / NS_PER_S
        for item in self._moving:
            self._bodies[item.name] = item.body_at(time_s)

    def _note_handedness(self, frame: HandFrame, now_ns: int) -> None:
        wrong = contradiction(frame.side, apparent_side(frame.position_m, frame.orientation_xyzw))
        if wrong is not None:
            self._events.append(LoopEvent(now_ns, "handedness", frame.side, "", wrong))

    def hand_gone(self, now_ns: int) -> None:
        """Let go of everything, quietly, as the tracker reports that the hand is no longer there.

        :param now_ns: when that was reported.
        """
        self._let_go(now_ns)
        self._gate.forget()
        self._heard_ns, self._absent = None, True

    # Ticks ----------------------------------------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """One period: watchdog, what was decided, patterns, rules, drivers.

        :param now_ns: the tick's time, not earlier than the last one's.
        """
        slow = self._pace.observe(now_ns, 0 if self.tactiles is None else self.tactiles.overdue)
        if slow is not None:
            self._events.append(LoopEvent(now_ns, "overrun", "", "", slow))
        if self._heard_ns is not None and not self._quiet and now_ns - self._heard_ns > LOST_NS:
            self._go_quiet(now_ns)
        if self._touchable and not self._quiet:
            for name, decided in self._touch_ahead.due(now_ns):
                if decided.begins:
                    touches, pins = self._contacts.touch(decided.site, name, now_ns)
                else:
                    touches, pins = self._contacts.leave(decided.site, name, now_ns)
                self._apply(touches, pins, now_ns, decided.aimed_ns)
        if not self._quiet:
            self._grasps.tick(now_ns)
        if self.tactiles is not None:
            ahead_ns = PATTERN_LEAD_NS + self._pace.lead_ns - COMMAND_LEAD_NS
            for time_ns, site, _ in self._patterns.due(now_ns, now_ns + ahead_ns):
                self.tactiles.pulse(SITES[site], now_ns, time_ns)
            for site in self._patterns.take_missed():
                self.tactiles.miss(SITES[site], now_ns)
        if self._clutches.due(now_ns):
            self._clutches.update(now_ns, self._grasps.held, self._contacts.touched, hand=not (self._quiet or self._absent))
        if self.tactiles is not None:
            self.tactiles.tick(now_ns)
        if self.brake is not None:
            self.brake.tick(now_ns)

    def take_events(self) -> list[LoopEvent]:
        """Hand out the events since the last call.

        :return: in the order in which they happened.
        """
        events = self._events.copy()
        self._events.clear()
        return events

    def body(self, name: str) -> Placed:
        """An object where it is now.

        :param name: the object's.
        :return: its shape at its present pose.
        :raises KeyError: no such object.
        """
        return self._bodies[name]

    # Touch ----------------------------------------------------------------------------------------------------------

    def _apply(self, touches: list[Touch], pins: list[PinChange], now_ns: int, aimed_ns: int | None = None) -> None:
        for touch in touches:
            self._events.append(LoopEvent(now_ns, touch.kind, SITES[touch.site], touch.object, aimed_ns=aimed_ns))
            if touch.first_or_last and touch.kind == "touch":
                self._patterns.touch(touch.object, now_ns)
            elif touch.first_or_last:
                self._patterns.leave(touch.object)
        if self.tactiles is None:
            return
        for pin in pins:
            (self.tactiles.contact if pin.out else self.tactiles.release)(SITES[pin.site], now_ns)

    # Watchdog -------------------------------------------------------------------------------------------------------

    def _go_quiet(self, now_ns: int) -> None:
        self._quiet = True
        age_ms = (now_ns - self._heard_ns) / NS_PER_MS if self._heard_ns is not None else 0
        self._events.append(LoopEvent(now_ns, "watchdog", "", "", f"no pose for {age_ms:.0f} ms; everything off"))
        self._let_go(now_ns)

    def _resume(self, positions, now_ns: int) -> None:
        touching = any(bool((self._bodies[name].distance(positions) <= self.sites.radius_m).any()) for name in self._touchable)
        if not touching:
            self._quiet = False
            self._events.append(LoopEvent(now_ns, "resumed"))

    def _let_go(self, now_ns: int) -> None:
        self._apply([], self._forget(now_ns), now_ns)
        if self.tactiles is not None:
            self.tactiles.withdraw_all(now_ns)
        if self.brake is not None:
            self.brake.release_all(now_ns)

    def _forget(self, now_ns: int) -> list[PinChange]:
        """Nothing touches, holds or plays any more; returns the pins that this lets go of."""
        self._touch_ahead.forget()
        touches, pins = self._contacts.release_all(now_ns)
        self._apply(touches, [], now_ns)
        self._patterns.stop()
        self._grasps.let_go(now_ns, self._quiet)
        self._clutches.forget()
        return pins


def _can_be_touched(scene: Scene, name: str) -> bool:
    kinds = {effect.kind for effect in scene.object(name).effects}
    ruled = any(rule.kind == "on_contact" and name in rule.objects for rule in scene.rules)
    return ruled or bool(kinds & {"contact", "fixed_set", "pattern"})
