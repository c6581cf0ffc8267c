"""The loop: poses come in at their own rate, devices are told what to do every tick.

A pose moves the hand's sites; touches are predicted and decided once per pose (``docs/decisions/0005``), and a tick only compares
times. What a scene asks for (contact, fixed sets, patterns, grasps, clutch rules) is mapped to the drivers here and nowhere
else. The loop never blocks, and refuses poses that cannot be a hand's.
"""

from __future__ import annotations

from dataclasses import dataclass

from haptics.devices import BrakeDriver, TactilesDriver
from haptics.devices.pace import COMMAND_LEAD_NS, TickSpacing
from haptics.rendering.grasp_ahead import GraspAhead
from haptics.rendering.touch_ahead import TouchAhead
from haptics.scene.clutch_rules import BodyState
from haptics.scene.contact import PinChange, Touch
from haptics.scene.effects import GraspEffect
from haptics.scene.geometry.shapes import Placed
from haptics.scene.grasp import GraspEvent
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.handedness import apparent_side, contradiction
from haptics.scene.hands.joints import SIDES
from haptics.scene.hands.pose_gate import PoseGate
from haptics.scene.scene import Scene
from haptics.scene.sites import SITE, SITES, SiteMap
from haptics.time import NS_PER_MS, NS_PER_S

STALE_NS = 50 * NS_PER_MS
"""A pose older than this is no longer predicted from."""
LOST_NS = 100 * NS_PER_MS
"""Without a pose for this long, everything goes off."""
RULES_EVERY_NS = 5 * NS_PER_MS
"""Clutch rules and body signals are looked at this often: far below the 100 ms in which a clutch acts (thesis 4.7.3)."""
PATTERN_LEAD_NS = 4 * NS_PER_MS
"""A pattern's pulses are handed on this long ahead: the command lead and a tick."""


@dataclass(frozen=True, slots=True)
class Leads:
    """How long before the touch a device must be told: command lead and the device's own time, from its model.

    :param pin_s: coil pulse sent, to the pin at the skin.
    :param pin_back_s: coil pulse sent, to the pin back in.
    :param brake_s: drive sent, to half of the steady blocking force; from total capacitance and volts.
    """

    pin_s: float
    pin_back_s: float
    brake_s: float


@dataclass(frozen=True, slots=True)
class LoopEvent:
    """Something a person may want to read later. ``aimed_ns`` is the touch the loop acted for, where there is one."""

    time_ns: int
    kind: str
    subject: str = ""
    object: str = ""
    detail: str = ""
    aimed_ns: int | None = None


class RenderLoop:
    """Scene in, driver calls out.

    :param scene: placed, so that every object has a place in the world.
    :param sites: where the hand's sites are.
    :param tactiles: driver of the array, or None where the scene has no use for one.
    :param brake: driver of brakes or clutches, or None.
    :param brake_amplitude_v: cap on a grasp's volts. :param clutch_amplitude_v: cap on a clutch's.
    :param tick_ns: how often it is to be ticked; ticked half as often or less it says ``overrun``, once a stretch.
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
        self._amplitude_v = brake_amplitude_v
        self._fingers = scene.needs.brakes or scene.needs.piezos
        self._contacts = scene.contact_tracker()
        self._patterns = scene.pattern_bank()
        self._watched = self._patterns.watched
        self._grasps = scene.grasp_tracker()
        self._rules = scene.clutch_rules() if scene.rules else None
        self.signals = scene.body_signals()
        self._clutch_v = {clutch.name: min(clutch.amplitude_v, clutch_amplitude_v) for clutch in scene.clutches}
        self._engaged: frozenset[str] = frozenset()
        self._rules_ns = 0
        self._bodies: dict[str, Placed] = {item.name: item.body for item in scene.objects}
        self._moving = tuple(item for item in scene.objects if item.motion is not None)
        self._graspable = tuple(item.name for item in scene.objects if item.grasp is not None)
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
        self._ahead: GraspAhead | None = None
        if self._graspable and brake is not None:
            self._ahead = GraspAhead(self._grasps, self._graspable, round(leads.brake_s * NS_PER_S), STALE_NS)
        self._tick_ns, self._spacing, self._overrunning, self._overdue = tick_ns, TickSpacing(), False, 0
        self._gate = PoseGate(side)
        self._followed: tuple[str, int] | None = None
        self._pose_ns: int | None = None
        self._quiet = False
        self._absent = False  # no pose since the devices were armed anew, or the hand has gone: nothing is felt without one
        self._left_out: list[str] = []
        self._events: list[LoopEvent] = []

    def begin(self, start_ns: int) -> None:
        """The scene's own clock (motions, signals) reads zero at ``start_ns``."""
        self._start_ns = self._rules_ns = start_ns

    def start_over(self, now_ns: int) -> None:
        """The devices were armed anew and do nothing yet: what was felt before is over, until a pose from now on says otherwise.

        Pins that stayed out meanwhile, as they are bistable, stay until that pose comes, and go back then.
        """
        self._forget(now_ns)
        self._pose_ns, self._absent = None, True
        if self.tactiles is not None:
            self._left_out = [site for site, out in zip(self.tactiles.sites, self.tactiles.pins_out(), strict=True) if out]

    # Poses ----------------------------------------------------------------------------------------------------------

    def submit(self, frame: HandFrame, now_ns: int) -> str | None:
        """Take a pose that arrived at ``now_ns``; returns why it was refused, or None.

        :raises InputError: no ``HandFrame``; one with wrong fields is refused with the reason like any other bad pose.
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
        self._pose_ns, self._absent = frame.time_ns, False
        if self._left_out and self.tactiles is not None:
            for site in self._left_out:
                self.tactiles.release(site, now_ns)
            self._left_out.clear()
        self._move_objects(frame.time_ns)
        positions = self.sites.positions(frame.position_m, frame.orientation_xyzw)
        if self._quiet:
            self._resume(positions, now_ns)
        if self._graspable:
            self._grasp(frame.time_ns, positions, now_ns)
        if not self._quiet:
            if self._touchable:
                self._touch_ahead.observe(frame.time_ns, positions, now_ns, self._grasps.held)
            for name in self._watched:
                nearest_m = float((self._bodies[name].distance(positions) - self.sites.radius_m).min())
                self._patterns.approach(name, nearest_m, now_ns)
        return None

    def _note_handedness(self, frame: HandFrame, now_ns: int) -> None:
        wrong = contradiction(frame.side, apparent_side(frame.position_m, frame.orientation_xyzw))
        if wrong is not None:
            self._events.append(LoopEvent(now_ns, "handedness", frame.side, "", wrong))

    def hand_gone(self, now_ns: int) -> None:
        """The tracker says that the hand is no longer there: let go of everything, quietly."""
        self._let_go(now_ns)
        self._gate.forget()
        self._pose_ns, self._absent = None, True

    # Ticks ----------------------------------------------------------------------------------------------------------

    def tick(self, now_ns: int) -> None:
        """One period: watchdog, what was decided, patterns, rules, drivers."""
        self._watch_pace(now_ns)
        if self._pose_ns is not None and not self._quiet and now_ns - self._pose_ns > LOST_NS:
            self._go_quiet(now_ns)
        if self._touchable and not self._quiet:
            for name, decided in self._touch_ahead.due(now_ns):
                if decided.begins:
                    touches, pins = self._contacts.touch(decided.site, name, now_ns)
                else:
                    touches, pins = self._contacts.leave(decided.site, name, now_ns)
                self._apply(touches, pins, now_ns, decided.aimed_ns)
        if self._ahead is not None and not self._quiet:
            self._anticipate(now_ns)
        if self.tactiles is not None:
            ahead_ns = PATTERN_LEAD_NS + self._spacing.lead_ns - COMMAND_LEAD_NS
            for time_ns, site, _ in self._patterns.due(now_ns, now_ns + ahead_ns):
                self.tactiles.pulse(SITES[site], now_ns, time_ns)
            for site in self._patterns.take_missed():
                self.tactiles.miss(SITES[site], now_ns)
        if self._rules is not None and now_ns >= self._rules_ns:
            self._rules_ns = now_ns + RULES_EVERY_NS
            self._obey_rules(now_ns)
        if self.tactiles is not None:
            self.tactiles.tick(now_ns)
        if self.brake is not None:
            self.brake.tick(now_ns)

    def take_events(self) -> list[LoopEvent]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def body(self, name: str) -> Placed:
        """An object where it is now.

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

    # Grasp ----------------------------------------------------------------------------------------------------------

    def _grasp(self, time_ns: int, positions, now_ns: int) -> None:
        thumb, index = positions[SITE["thumb_tip"]], positions[SITE["index_tip"]]
        for event in self._grasps.update(time_ns, thumb, index):
            self._grasp_changed(event, now_ns)
        for name in self._graspable:
            self._bodies[name] = self._grasps.body(name)
        if self._ahead is not None and not self._quiet and self._grasps.held is None:
            self._ahead.observe(time_ns, thumb, index, now_ns)

    def _grasp_changed(self, event: GraspEvent, now_ns: int) -> None:
        effect = self.scene.object(event.object).grasp
        assert effect is not None  # only objects with a grasp effect are tracked
        detail = f"ray {event.ray_m * 1e3:.1f} mm, penetration {event.penetration:.3f}, depth {event.depth_m * 1e3:.1f} mm"
        self._events.append(LoopEvent(now_ns, f"grasp_{event.kind}", "", event.object, detail, event.time_ns))
        if self.brake is None or self._quiet:
            return
        if event.kind == "begin":
            if self._ahead is None or not self._ahead.confirm(event.object):
                self._close(effect, now_ns)
        elif effect.brakes:
            self._open(now_ns)

    def _anticipate(self, now_ns: int) -> None:
        assert self._ahead is not None
        name = self._ahead.due(now_ns)
        if name is not None:
            effect = self.scene.object(name).grasp
            assert effect is not None
            self._close(effect, now_ns)
            self._events.append(LoopEvent(now_ns, "grasp_ahead", "", name))
        if self._ahead.withdraw(now_ns) and self._grasps.held is None:
            self._open(now_ns)
            self._events.append(LoopEvent(now_ns, "grasp_withdrawn"))

    def _close(self, effect: GraspEffect, now_ns: int) -> None:
        assert self.brake is not None
        if effect.brakes:
            volts = min(effect.amplitude_v, self._amplitude_v)
            for finger in self._fingers:
                self.brake.engage(finger, volts, now_ns, frequency_hz=min(effect.frequency_hz, self.brake.max_frequency_hz))
        if effect.piezo and effect.piezo_s > 0:
            self.brake.piezo(self._fingers, effect.piezo_s, now_ns)

    def _open(self, now_ns: int) -> None:
        if self.brake is not None:
            for finger in self._fingers:
                self.brake.release(finger, now_ns)

    # Rules ----------------------------------------------------------------------------------------------------------

    def _obey_rules(self, now_ns: int) -> None:
        assert self._rules is not None
        state = BodyState(now_ns - self._start_ns, self.signals, self._grasps.held, self._contacts.touched)
        wanted = self._rules.update(state) if not (self._quiet or self._absent) else frozenset()
        if wanted == self._engaged:
            return
        for name in sorted(wanted ^ self._engaged):
            on = name in wanted
            self._events.append(LoopEvent(now_ns, "clutch_on" if on else "clutch_off", name))
            if self.brake is not None and on:
                self.brake.engage(name, self._clutch_v[name], now_ns)
            elif self.brake is not None:
                self.brake.release(name, now_ns)
        self._engaged = wanted

    def _move_objects(self, time_ns: int) -> None:
        time_s = (time_ns - self._start_ns) / NS_PER_S
        for item in self._moving:
            self._bodies[item.name] = item.body_at(time_s)

    # Watchdog -------------------------------------------------------------------------------------------------------

    def _go_quiet(self, now_ns: int) -> None:
        self._quiet = True
        age_ms = (now_ns - self._pose_ns) / NS_PER_MS if self._pose_ns is not None else 0
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
        if self._ahead is not None:
            self._ahead.forget()
        touches, pins = self._contacts.release_all(now_ns)
        self._apply(touches, [], now_ns)
        self._patterns.stop()
        for event in self._grasps.let_go(now_ns):
            self._grasp_changed(event, now_ns)
        self._engaged = frozenset()
        return pins

    def _watch_pace(self, now_ns: int) -> None:
        """Say when ticks come too seldom, at once, and once until they come often again."""
        self._spacing.observe(now_ns)
        was, spacing_ns = self._overrunning, self._spacing.ns
        self._overrunning = spacing_ns >= (1.5 if was else 2.0) * self._tick_ns
        if was or not self._overrunning:
            return
        overdue = 0 if self.tactiles is None else self.tactiles.overdue
        late, self._overdue = overdue - self._overdue, overdue
        came_late = f"{late} pulse{'s' * (late != 1)} came late; " if late else ""
        seen = f"ticked every {spacing_ns / NS_PER_MS:.3g} ms; {came_late}tick every {self._tick_ns / NS_PER_MS:.3g} ms"
        self._events.append(LoopEvent(now_ns, "overrun", "", "", seen))


def _can_be_touched(scene: Scene, name: str) -> bool:
    kinds = {effect.kind for effect in scene.object(name).effects}
    ruled = any(rule.kind == "on_contact" and name in rule.objects for rule in scene.rules)
    return ruled or bool(kinds & {"contact", "fixed_set", "pattern"})
