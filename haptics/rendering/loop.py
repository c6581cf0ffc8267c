"""The loop: poses come in at their own rate, devices get their commands every tick.

A pose moves the hand's sites; touches are predicted and decided once per pose
(``docs/decisions/0005-decide-when-a-pose-arrives.md``), and a tick only compares times. What a scene asks for (contact, fixed
sets, patterns; grasps and clutch rules by ``Grasping`` and ``Clutching``) is mapped to the drivers in this folder and nowhere
else. The loop never blocks, and refuses poses that cannot be a hand's.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.devices import BrakeShare, TactilesShare
from haptics.devices.pace import COMMAND_LEAD_NS
from haptics.rendering.clutching import Clutching
from haptics.rendering.events import LoopEvent
from haptics.rendering.grasping import Grasping
from haptics.rendering.other_hand import OtherHand
from haptics.rendering.pace_watch import PaceWatch
from haptics.rendering.resuming import STEADY_NS, Resume
from haptics.rendering.touch_ahead import TouchAhead
from haptics.rendering.world import World
from haptics.scene.contact import PinChange, Touch
from haptics.scene.geometry.shapes import Placed
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.pose_gate import OTHER_HAND, PoseGate
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
    :param tactiles: the scene's share of the array, or None where there is none.
    :param brake: the scene's share of brakes or clutches, or None.
    :param leads: how long before a touch each device must be commanded.
    :param brake_amplitude_v: cap on a grasp's drive, V.
    :param clutch_amplitude_v: cap on a clutch's drive, V.
    :param tick_ns: planned length of a tick; at twice that or more the loop reports ``overrun``, once until it recovers.
    :param side: of the hand that wears the glove; None follows the one that comes first.
    :param resume: ``apart``: when poses come again after they had stopped, nothing is felt until the hand touches nothing;
        ``gentle``: after a quarter of a second it goes on where it is, brakes rising slowly.
    :param world: shared with the loop of another hand; one of its own if None.
    """

    def __init__(
        self,
        scene: Scene,
        sites: SiteMap,
        tactiles: TactilesShare | None,
        brake: BrakeShare | None,
        leads: Leads,
        brake_amplitude_v: float = 1500.0,
        clutch_amplitude_v: float = 1500.0,
        tick_ns: int = NS_PER_MS,
        side: str | None = None,
        resume: Resume = "apart",
        world: World | None = None,
    ):
        self.sites, self.tactiles, self.brake = sites, tactiles, brake
        self.world = World(scene) if world is None else world
        self._leads, self._brake_v, self._clutch_v = leads, brake_amplitude_v, clutch_amplitude_v
        self._resume_rule: Resume = resume
        self._start_ns = 0
        self._events: list[LoopEvent] = []
        self._render(scene)
        self._other = OtherHand(self.world, sites, self._events.append)
        self._pace = PaceWatch(tick_ns)
        self._gate = PoseGate(side)
        self._followed: tuple[str, int] | None = None
        self._heard_ns: int | None = None  # when the last pose that was accepted arrived
        self._steady_since_ns = 0  # poses have come without a long gap since
        self._waits_for = ""  # what keeps it from going on after poses had stopped
        self._quiet = False
        self._absent = False  # no pose since the devices were armed anew, or the hand has gone: nothing is felt without one

    def _render(self, scene: Scene) -> None:
        """Everything that follows from the scene."""
        self.scene = scene
        self._contacts = scene.contact_tracker()
        self._patterns = scene.pattern_bank()
        self._watched = self._patterns.watched
        brake_lead_ns = round(self._leads.brake_s * NS_PER_S)
        self._grasps = Grasping(self.world, self.brake, self._brake_v, brake_lead_ns, STALE_NS, self._events.append)
        self._clutches = Clutching(scene, self.brake, self._clutch_v, self._events.append)
        self._clutches.begin(self._start_ns)
        self.signals = self._clutches.signals
        self._touchable = tuple(item.name for item in scene.objects if _can_be_touched(scene, item.name))
        self._touch_ahead = TouchAhead(
            self.body,
            self._touchable,
            [name for name in self._touchable if name in self.world.moving],
            self.sites.radius_m,
            round(self._leads.pin_s * NS_PER_S),
            round(self._leads.pin_back_s * NS_PER_S),
            STALE_NS,
        )

    def change_scene(self, scene: Scene, leads: Leads, now_ns: int) -> None:
        """Go on with another scene. What both have alike (name, shape, effects) goes on being felt; all else is let go of.

        :param scene: placed.
        :param leads: how long before a touch each device must be commanded now.
        :param now_ns: when that was asked for.
        """
        kept = _alike(self.scene, scene)
        for name in [name for name in self.scene.names if name not in kept]:
            for site in sorted(self._contacts.touching(name)):
                self._apply(*self._contacts.leave(site, name, now_ns), now_ns)
        if self._grasps.held not in (None, *kept):
            self._grasps.let_go(now_ns, self._quiet)
        contacts, patterns, ahead, grasps = self._contacts, self._patterns, self._touch_ahead, self._grasps
        clutches = self._clutches if (scene.rules, scene.clutches) == (self.scene.rules, self.scene.clutches) else None
        self.world.change(scene)
        self._leads = leads
        self._render(scene)
        self._contacts.adopt(contacts, kept)
        self._patterns.adopt(patterns, kept)
        self._grasps.adopt(grasps, kept)
        self._touch_ahead.adopt(ahead, [name for name in self._touchable if name in kept])
        self._other.change()
        if clutches is not None:
            self._clutches, self.signals = clutches, clutches.signals
        elif self.brake is not None:
            for clutch in set(self.brake.engaged()) - set(scene.needs.brakes):
                self.brake.release(clutch, now_ns)

    def begin(self, start_ns: int) -> None:
        """Start the scene's own clock, which its motions and signals follow.

        :param start_ns: when that clock reads zero.
        """
        self._start_ns = start_ns
        self.world.begin(start_ns)
        self._clutches.begin(start_ns)

    def start_over(self, now_ns: int) -> None:
        """Begin anew after the devices were armed: what was felt before is over, until a new pose decides otherwise.

        :param now_ns: when the devices were armed.
        """
        self._forget(now_ns)
        self._heard_ns, self._absent = None, True

    # Poses ----------------------------------------------------------------------------------------------------------

    def submit(self, frame: HandFrame, now_ns: int) -> str | None:
        """Take a pose that has arrived. One of the hand without a glove moves what that hand carries, and is not felt.

        :param frame: 26 joints in OpenXR's basis.
        :param now_ns: when it arrived, on the clock of ``tick``.
        :return: why it was refused, or None if it was taken.
        :raises InputError: not a ``HandFrame``; one with wrong fields is refused with the reason like any other bad pose.
        """
        reason = self._gate.judge(frame, now_ns)
        if reason is OTHER_HAND:
            reason = self._other.submit(frame, now_ns)
            if reason is None:
                return None
        if reason is not None:
            side = frame.side if isinstance(frame.side, str) and frame.side in SIDES else ""
            self._events.append(LoopEvent(now_ns, "pose_refused", side, "", reason))
            return reason
        if self._gate.starts_anew:
            self._let_go(now_ns)
        if (frame.side, frame.track_id) != self._followed:
            self._followed = (frame.side, frame.track_id)
            self._note_handedness(frame, now_ns)
        if self._heard_ns is None or now_ns - self._heard_ns > LOST_NS:
            self._steady_since_ns = now_ns
        self._heard_ns, self._absent = now_ns, False
        if self._other.frame is not None and self._other.frame.side == frame.side:
            self._other.gone(now_ns)  # it is the one with the glove now
        self.world.advance(frame.time_ns)
        positions = self.sites.positions(frame.position_m, frame.orientation_xyzw)
        if self._quiet:
            self._resume(positions, now_ns)
        if self._grasps.names:
            self._grasps.observe(frame.time_ns, positions, now_ns, self._quiet)
        if not self._quiet:
            if self._touchable:
                self._touch_ahead.observe(frame.time_ns, positions, now_ns, self._grasps.held)
            for name in self._watched:
                nearest_m = float((self.body(name).distance(positions) - self.sites.radius_m).min())
                self._patterns.approach(name, nearest_m, now_ns)
        return None

    def _note_handedness(self, frame: HandFrame, now_ns: int) -> None:
        wrong = contradiction(frame.side, apparent_side(frame.position_m, frame.orientation_xyzw))
        if wrong is not None:
            self._events.append(LoopEvent(now_ns, "handedness", frame.side, "", wrong))

    def hand_gone(self, now_ns: int, side: str | None = None) -> None:
        """Let go of everything, quietly, as the tracker reports that the hand is no longer there.

        :param now_ns: when that was reported.
        :param side: of the hand that has gone; None: both.
        """
        if side is None or (self._other.frame is not None and self._other.frame.side == side):
            self._other.gone(now_ns)
        if side is not None and self._followed is not None and self._followed[0] != side:
            return
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
        self._other.tick(now_ns)
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

    @property
    def frame(self) -> HandFrame | None:
        """The last pose that was taken; None while the hand is not there."""
        return None if self._absent or self._quiet else self._gate.last

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
        return self.world.body(name)

    def scene_now(self) -> Scene:
        """The scene with every object where it is now.

        :return: another scene, see ``World.now``.
        """
        return self.world.now(self.scene)

    # Touch ----------------------------------------------------------------------------------------------------------

    def _apply(self, touches: list[Touch], pins: list[PinChange], now_ns: int, aimed_ns: int | None = None) -> None:
        for touch in touches:
            felt = "" if self.tactiles is None or self.tactiles.armed else "pins are not armed"
            self._events.append(LoopEvent(now_ns, touch.kind, SITES[touch.site], touch.object, felt, aimed_ns))
            if touch.first_or_last and touch.kind == "touch":
                self._patterns.touch(touch.object, now_ns)
            elif touch.first_or_last:
                self._patterns.leave(touch.object)
        if self.tactiles is None:
            return
        name = touches[0].object if touches else ""
        for pin in pins:
            kind = "contact" if pin.out else "release"
            self._events.append(LoopEvent(now_ns, "wanted", SITES[pin.site], name, kind, aimed_ns))
            (self.tactiles.contact if pin.out else self.tactiles.release)(SITES[pin.site], now_ns)

    # Watchdog -------------------------------------------------------------------------------------------------------

    def _go_quiet(self, now_ns: int) -> None:
        self._quiet = True
        age_ms = (now_ns - self._heard_ns) / NS_PER_MS if self._heard_ns is not None else 0
        self._events.append(LoopEvent(now_ns, "watchdog", "", "", f"no pose for {age_ms:.0f} ms; everything off"))
        self._let_go(now_ns)

    def _resume(self, positions, now_ns: int) -> None:
        touched = [n for n in self._touchable if (self.body(n).distance(positions) <= self.sites.radius_m).any()]
        gently = self._resume_rule == "gentle" and now_ns - self._steady_since_ns >= STEADY_NS
        if touched and not gently:
            waits_for = f"nothing is felt until the hand has left {' and '.join(touched)}"
            if self._resume_rule == "gentle":
                waits_for = f"nothing is felt until poses have come for {STEADY_NS / NS_PER_S:g} s"
            if waits_for != self._waits_for:
                self._waits_for = waits_for
                self._events.append(LoopEvent(now_ns, "waiting", "", touched[0], waits_for))
            return
        self._quiet, self._waits_for = False, ""
        self._events.append(LoopEvent(now_ns, "resumed", "", "", "gently, inside an object" if touched else ""))
        if touched:
            self._grasps.resume(now_ns)

    def _let_go(self, now_ns: int) -> None:
        self._apply([], self._forget(now_ns), now_ns)
        if self.tactiles is not None:
            self.tactiles.release_all(now_ns)
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


def _alike(old: Scene, new: Scene) -> tuple[str, ...]:
    """Objects that are the same in both, wherever they are."""
    both = [(old.object(name), new.object(name)) for name in new.names if name in old.names]
    return tuple(
        its.name
        for was, its in both
        if was.body.shape == its.body.shape and was.effects == its.effects and was.owner == its.owner
    )


def _can_be_touched(scene: Scene, name: str) -> bool:
    kinds = {effect.kind for effect in scene.object(name).effects}
    ruled = any(rule.kind == "on_contact" and name in rule.objects for rule in scene.rules)
    return ruled or bool(kinds & {"contact", "fixed_set", "pattern"})
