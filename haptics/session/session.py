"""A session: a placed scene rendered on a glove, recorded as it goes.

``run``, ``replay`` and engines share it. Its owner hands in poses; it never blocks and never picks a time.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace

from haptics.devices import Refusal, Result
from haptics.devices.sharing import SCENE
from haptics.errors import GloveEnded
from haptics.judging.truth import Truth
from haptics.rendering.events import LoopEvent
from haptics.rendering.loop import RenderLoop
from haptics.rendering.resuming import RESUMES, Resume
from haptics.rendering.world import World
from haptics.scene.calibration.hand_calibration import HandCalibration
from haptics.scene.hands.check import ill_formed
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import SIDES
from haptics.scene.live_placement import LivePlacement
from haptics.scene.placed_table import placed_table
from haptics.scene.scene import Scene
from haptics.scene.sites import SITES
from haptics.session.configuration import Configuration
from haptics.session.devices import Devices
from haptics.session.glove import Glove
from haptics.session.leads import device_leads
from haptics.session.outcomes import Outcomes
from haptics.session.peer_clock import PeerClock
from haptics.session.plant_truth import PlantTruth
from haptics.session.recorder import Recorder
from haptics.session.sampler import KEPT, Sampler
from haptics.session.scene_calls import SceneCalls
from haptics.session.whose_hand import calibration_header, calibration_of, sites_of
from haptics.time import LATEST_NS, NS_PER_S
from haptics.units import a_callable, an_instance, known_arguments, one_of, truth, whole_number


class Session(SceneCalls):
    """A placed scene on an open glove; armed by its owner.

    On a ``haptics.Glove`` in real time the glove's own thread ticks the session from :meth:`begin` on: its owner only hands in
    poses. If poses stop, the session lets go of everything after 0.1 s. In virtual time, and on bare ``Devices``, the owner calls
    :meth:`tick` each millisecond.

    Objects that have no place yet (at the palm, in the hand) are placed by the hand once it has been still for half a second, or
    by :meth:`place`; until then they are not there. Of two hands the one that wears the glove is rendered, the other grasps and
    carries objects and feels nothing.

    :param scene: from ``haptics.load_scene``, placed or not.
    :param glove: open; from ``haptics.open``, or bare ``Devices``. A new session takes the place of one that is on it.
    :param configuration: of the brake's volts, the loop's rate and the hand's side; the glove's own if None.
    :param recorder: takes rows; that of the glove's recording if None and there is one.
    :param peer: clock that poses have their times on; the glove's own if None.
    :param kept: how many results and events, and how much of the plants' truth, the session remembers, 1 or more; None: all of
        them. :meth:`subscribe` and a recording get all of them in any case.
    :param resume: when poses come again after they had stopped: ``apart``: nothing is felt until the hand touches nothing;
        ``gentle``: after a quarter of a second it goes on where it is, brakes rising slowly over a second.
    :param calibration: of the hand that wears the glove, which is the only one followed then; if None, the one that the
        configuration names, or a nominal hand.
    :param follows_needs: boards that the scene has no use for are not armed, and go off when it changes.
    :param gathered: what the plants do is gathered in this, however much that is; ``truth`` then.
    :param world: see ``haptics.rendering.world``; of the session of the other hand, to share its objects.
    :raises InputError: something else in place of these, here or in a call; a scene with brakes that the glove does not have.

    :ivar calibration: of the hand that wears the glove, or None: a nominal hand.
    :ivar results: what became of the last touches and pulses that the scene asked for.
    :ivar brake_results: what became of the last brakes and piezos, likewise.
    :ivar events: the last touches, grasps, refused poses and the like, what was wanted, and what acted or was denied, in order.
    :ivar truth: what simulated plants did; empty on hardware.
    :ivar leads: how long before a touch each device is driven.
    """

    @known_arguments
    def __init__(
        self,
        scene: Scene,
        glove: Glove | Devices,
        configuration: Configuration | None = None,
        recorder: Recorder | None = None,
        peer: PeerClock | None = None,
        kept: int | None = KEPT,
        resume: Resume = "apart",
        world: World | None = None,
        calibration: HandCalibration | None = None,
        follows_needs: bool = False,
        gathered: Truth | None = None,
    ):
        an_instance("scene", scene, Scene, "from haptics.load_scene")
        if not isinstance(glove, Devices):
            an_instance("glove", glove, Glove, "from haptics.open")
        self.glove = glove
        self.devices: Devices = glove if isinstance(glove, Devices) else glove.devices
        if configuration is None and isinstance(glove, Glove):
            configuration = glove.configuration
        an_instance("configuration", configuration, Configuration, "from haptics.load_configuration")
        assert configuration is not None
        if recorder is None and isinstance(glove, Glove):
            recorder = glove.recorder
        elif recorder is not None:
            an_instance("recorder", recorder, Recorder, "on a journal, or None")
            self.devices.on_event(recorder.link_event)
            self.devices.on_result(recorder.result)
        if peer is not None:
            an_instance("peer", peer, PeerClock, "or None where poses have the glove's time")
        self._peer, self._jumps = peer, 0
        one_of("resume", resume, RESUMES)
        self._check_scene(scene)
        self.recorder = recorder
        self._placing = LivePlacement(scene) if scene.unresolved else None
        self._asked, self._resume = scene, resume
        self.configuration = configuration
        if kept is not None:
            whole_number("kept", kept, 1, 10**9)
        self.results: deque[Result] = deque(maxlen=kept)
        self.brake_results: deque[Result] = deque(maxlen=kept)
        self.events: deque[LoopEvent] = deque(maxlen=kept)
        self._follows_needs = truth("follows_needs", follows_needs)
        self._sinks: list[Callable[[Result | LoopEvent], None]] = []
        self.leads = device_leads(configuration, scene)
        self.calibration = calibration_of(configuration, calibration)
        side = configuration.side if self.calibration is None else self.calibration.side
        devices = self.devices
        max_v = math.inf if devices.brakes is None else devices.brakes.max_amplitude_v
        self._outcomes = Outcomes(self.leads, self._happened)
        self.loop = RenderLoop(
            scene.without_unresolved(),
            sites_of(self.calibration),
            devices.share_tactiles(SCENE),
            devices.share_brakes(SCENE),
            self.leads,
            brake_amplitude_v=min(configuration.brake.amplitude_v, max_v),
            clutch_amplitude_v=min(configuration.brake.clutch_amplitude_v, max_v),
            tick_ns=NS_PER_S // configuration.tick_hz,
            side=None if side == "auto" else side,
            resume=resume,
            world=world,
        )
        devices.on_result(self._take_result)
        self._times_armed = devices.times_armed
        self._last_ns = 0
        self.begun = self._over = False
        self._sampler = Sampler(devices, recorder, Truth.keeping(kept) if gathered is None else gathered)
        self.truth = self._sampler.truth
        if isinstance(glove, Glove):
            glove.take_on(self)
        if follows_needs:  # after a session that was here has let go of what it needed
            devices.need(scene.needs.boards)

    def begin(self, start_ns: int | None = None) -> None:
        """Start the scene's own clock (motions, signals).

        :param start_ns: when it reads zero, ns on the glove's clock; now if None.
        """
        start_ns = self._time("start_ns", start_ns)
        with self._turn():
            self.loop.begin(start_ns)
            self.begun = True
            if self.recorder is not None:
                self.recorder.event(start_ns, "start")
                self.recorder.session(
                    {
                        "start_ns": start_ns,
                        "resume": self._resume,
                        "scene": self._asked.name,
                        "scene_source": self._asked.origin,
                        "objects": placed_table(self._asked),
                        **calibration_header(self.calibration),
                    }
                )

    def submit(self, frame: HandFrame, now_ns: int | None = None) -> str | None:
        """Hand in a pose. Waits at most for a tick that is under way.

        :param frame: its time on the glove's clock (``glove.now_ns()``), or on the peer's if the session has one, ns.
        :param now_ns: when it arrived, likewise; now if None.
        :return: why it was refused, in words, or None.
        :raises InputError: no ``HandFrame`` at all.
        """
        an_instance("frame", frame, HandFrame, "such as HandFrame.from_joints makes")
        with self._turn():
            now_ns = self._came_ns(now_ns)
            self._watch_arming(now_ns)
            if self._peer is not None and ill_formed(frame) is None:
                if not self._peer.known:
                    reason = "clock: there was no exchange with the peer's clock yet"
                    self._happened(LoopEvent(now_ns, "pose_refused", frame.side, "", reason))
                    return reason
                frame = self._on_our_clock(frame, self._peer, now_ns)
            reason = self.loop.submit(frame, now_ns)
            if self._placing is not None and self.loop.frame is frame:
                placed = self._placing.observe(frame)
                if placed is not None:
                    self._put_in_place(self.loop.world.now(placed), now_ns)
            if self.recorder is not None and ill_formed(frame) is None:  # what has no row in the recording is an event there
                self.recorder.pose(now_ns, frame, reason is None)
            return reason

    def _on_our_clock(self, frame: HandFrame, peer: PeerClock, now_ns: int) -> HandFrame:
        if peer.jumps != self._jumps:
            self._jumps = peer.jumps
            self._happened(LoopEvent(now_ns, "clock_jump", "", "", "the clock of the poses jumped; it is followed anew"))
            self.loop.hand_gone(now_ns)  # times after it do not go on from those before
            self._called(now_ns, "hand_gone")
        return replace(frame, time_ns=peer.to_host_ns(frame.time_ns))

    def hand_gone(self, now_ns: int | None = None, side: str | None = None) -> None:
        """The tracker reports that a hand is not there any more: everything is let go of.

        :param now_ns: when that was known, ns on the glove's clock; now if None.
        :param side: of that hand, ``left`` or ``right``; None: no hand is there.
        """
        if side is not None:
            one_of("side", side, SIDES)
        with self._turn():
            now_ns = self._came_ns(now_ns)
            self.loop.hand_gone(now_ns, side)
            if self._placing is not None:
                self._placing.forget()
            self._called(now_ns, "hand_gone", "" if side is None else side)

    def tick(self, now_ns: int | None = None) -> None:
        """One period of the loop: links to a time, effects, drivers, rows.

        :param now_ns: ns on the glove's clock, which in virtual time moves there; now if None.
        """
        with self._turn():
            if type(now_ns) is not int or not 0 <= now_ns <= LATEST_NS:
                now_ns = self._time("now_ns", now_ns)
            self._watch_arming(now_ns)
            self.devices.follow(now_ns)
            self._act(now_ns)

    def serve(self, now_ns: int) -> None:
        """A tick by whoever serves the glove, and has brought its links to now.

        :param now_ns: ns on the glove's clock.
        """
        self._watch_arming(now_ns)
        self._act(now_ns)

    def _act(self, now_ns: int) -> None:
        self._last_ns = now_ns = max(now_ns, self._last_ns)  # in real time the glove's thread may have been here since
        if self.recorder is not None:
            self.recorder.looped(now_ns)
        self.loop.tick(now_ns)
        self._tell_events()  # what was wanted, before what came of it
        self.devices.tick(now_ns)
        self._sampler.due(now_ns)
        if self.recorder is not None:
            self.recorder.acknowledge(now_ns)

    def end(self) -> None:
        """The scene is over: let go of everything. The glove stays armed, and may be driven by hand or by another session."""
        with self._any_turn():
            if self._over:
                return
            self.loop.hand_gone(self.devices.now_ns())
            self.settle()
            self.leave()
            if isinstance(self.glove, Glove):
                self.glove.let_go_of(self)

    def leave(self) -> None:
        """Let go of everything, and neither ask nor collect any more: the scene is over, or another session takes its place."""
        self._over = True
        self.loop.hand_gone(self.devices.now_ns())
        self.devices.no_more_results(self._take_result)
        if self._follows_needs:
            self.devices.need(("tactiles", "brake"))

    def _watch_arming(self, now_ns: int) -> None:
        """Devices that were armed anew have forgotten what they did; so does the loop."""
        if self.devices.times_armed != self._times_armed:
            self._times_armed = self.devices.times_armed
            self.start_over(now_ns)

    def start_over(self, now_ns: int) -> None:
        """The devices were armed anew, so that nothing of what was felt before goes on; by itself where that is noticed.

        :param now_ns: when.
        """
        self._outcomes.forget()
        self.loop.start_over(now_ns)
        self._called(now_ns, "armed")

    def settle(self) -> None:
        """Collect what came out after the last tick, while the glove went off."""
        now_ns = self.devices.now_ns()
        self.devices.hand_on_results()
        self._tell_events()
        self._sampler.sample(now_ns)
        if self.recorder is not None:
            self.recorder.acknowledge(now_ns)

    def _tell_events(self) -> None:
        for event in self.loop.take_events():
            self._happened(event)

    def _take_result(self, now_ns: int, one: Result | Refusal) -> None:
        if isinstance(one, Refusal):
            self._happened(LoopEvent(now_ns, "derated", one.command, "", one.reason))
        elif one.owner == SCENE:
            (self.brake_results if one.kind in ("brake", "piezo") else self.results).append(one)
            self._hand_on(one)
            self._outcomes.tell(now_ns, one)

    def _happened(self, event: LoopEvent) -> None:
        if event.kind == "wanted":
            self._outcomes.want(event)
        self.events.append(event)
        self._hand_on(event)
        if self.recorder is not None:
            detail = f"{event.detail}: {event.reason}" if event.reason else event.detail
            self.recorder.event(event.time_ns, event.kind, event.subject, event.object, detail)

    def subscribe(self, sink: Callable[[Result | LoopEvent], None]) -> None:
        """Hand on every result and event, when it becomes known.

        :param sink: called within a tick, so it must be quick; what it raises ends the tick, and in real time the glove goes off.
        :raises InputError: it cannot be called.
        """
        a_callable("sink", sink, "a result or an event")
        self._sinks.append(sink)

    def _hand_on(self, one: Result | LoopEvent) -> None:
        for sink in self._sinks:
            sink(one)

    def plants(self) -> PlantTruth | None:
        """What the simulated plants are now.

        :return: the truth, or None where both boards are hardware.
        """
        with self._any_turn():
            return self._sampler.look()

    @contextmanager
    def _turn(self) -> Iterator[object]:
        """A turn of a session that still has the glove: what it asks for is asked of the one that took its place otherwise."""
        with nullcontext() if isinstance(self.glove, Devices) else self.glove.turn():
            if self._over:
                raise GloveEnded(
                    "this session has ended, or another one took its place on the glove; make another haptics.Session"
                )
            yield

    def _any_turn(self) -> AbstractContextManager[object]:
        """A turn even where the glove has gone off by itself."""
        if isinstance(self.glove, Devices):
            return nullcontext()
        return self.glove.turn(missed_allowed=True, ended_allowed=True)

    @property
    def site_names(self) -> tuple[str, ...]:
        """Site of each channel of the array."""
        return SITES if self.devices.tactiles is None else self.devices.tactiles.sites
