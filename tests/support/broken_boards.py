"""Python boards that are broken on purpose, each by one thing, and the rules of the protocol that must catch it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from firmware_models.boards import board as board_module
from firmware_models.boards.board import FirmwareModel, Refusal
from firmware_models.boards.brake_board import BrakeBoard
from firmware_models.boards.coil_heat import CoilHeat
from firmware_models.boards.tactiles_board import Pulse, TactilesBoard
from haptics.link.framing import encode_frame
from haptics.link.messages import BY_NAME, Board, State, Status, encode
from haptics.physics.thermal.one_node import THERMAL

MS = 1_000_000


def plays_late(patch: pytest.MonkeyPatch) -> None:
    due = FirmwareModel._due

    def forgiving(self: Any, tick: int) -> int:
        try:
            return due(self, tick)
        except Refusal as refusal:
            if refusal.status != Status.LATE:
                raise
            return self.ticks.count(self.now_ns) + 1

    patch.setattr(FirmwareModel, "_due", forgiving)


def wrong_lateness(patch: pytest.MonkeyPatch) -> None:
    due = FirmwareModel._due

    def in_ticks(self: Any, tick: int) -> int:
        try:
            return due(self, tick)
        except Refusal as refusal:
            raise Refusal(refusal.status, 32 * refusal.detail) from None

    patch.setattr(FirmwareModel, "_due", in_ticks)


def plays_duplicates(patch: pytest.MonkeyPatch) -> None:
    def answer(self: Any, seq: int, status: Status, detail: int) -> None:
        self._send(self._reply_to(seq, status, detail))

    patch.setattr(FirmwareModel, "_answer", answer)


def remembers(count: int) -> Callable[[pytest.MonkeyPatch], None]:
    return lambda patch: patch.setattr(board_module, "REMEMBERED_REPLIES", count)


def keeps_number_zero(patch: pytest.MonkeyPatch) -> None:
    answer = FirmwareModel._answer

    def keep(self: Any, seq: int, status: Status, detail: int) -> None:
        answer(self, seq, status, detail)
        self._answered[seq] = self._reply_to(seq, status, detail)

    patch.setattr(FirmwareModel, "_answer", keep)


def stop_is_repeated(patch: pytest.MonkeyPatch) -> None:
    take = FirmwareModel._take

    def as_any_other(self: Any, frame: Any) -> None:
        if frame.type == BY_NAME["stop"].type and frame.seq in self._answered:
            self._send(self._answered[frame.seq])
        else:
            take(self, frame)

    patch.setattr(FirmwareModel, "_take", as_any_other)


def remembers_through_identify(patch: pytest.MonkeyPatch) -> None:
    identify = FirmwareModel._identify

    def keep(self: Any, seq: int) -> None:
        kept = self._answered.copy()
        identify(self, seq)
        self._answered = kept

    patch.setattr(FirmwareModel, "_identify", keep)


def identifies_once(patch: pytest.MonkeyPatch) -> None:
    identify = FirmwareModel._identify

    def once(self: Any, seq: int) -> None:
        if not getattr(self, "known", False):
            identify(self, seq)
        self.known = True

    patch.setattr(FirmwareModel, "_identify", once)


def talks_unasked(patch: pytest.MonkeyPatch) -> None:
    power_on = FirmwareModel._power_on

    def eager(self: Any) -> None:
        power_on(self)
        self._telemetry_ns = self.now_ns + 20 * MS
        self._next_ns = self._telemetry_ns

    patch.setattr(FirmwareModel, "_power_on", eager)


def another_schema(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(board_module, "schema_hash", lambda: 0x12345678)


def no_dead_man(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FirmwareModel, "_dead_man_ns", lambda self: 1 << 62)


def slow_dead_man(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(board_module, "DEAD_MAN_MS", 105)


def any_byte_feeds(patch: pytest.MonkeyPatch) -> None:
    handle = FirmwareModel.handle

    def fed(self: Any, data: bytes) -> None:
        self._fed_ns = self.now_ns
        handle(self, data)

    patch.setattr(FirmwareModel, "handle", fed)


def any_frame_feeds(patch: pytest.MonkeyPatch) -> None:
    take = FirmwareModel._take

    def fed(self: Any, frame: Any) -> None:
        self._fed_ns = self.now_ns
        take(self, frame)

    patch.setattr(FirmwareModel, "_take", fed)


def any_length_feeds(patch: pytest.MonkeyPatch) -> None:
    take = FirmwareModel._take

    def fed(self: Any, frame: Any) -> None:
        if frame.type in board_module.BY_TYPE:
            self._fed_ns = self.now_ns
        take(self, frame)

    patch.setattr(FirmwareModel, "_take", fed)


def comes_back_by_itself(patch: pytest.MonkeyPatch) -> None:
    take = FirmwareModel._take

    def revived(self: Any, frame: Any) -> None:
        if self.state == State.FAULT and frame.type == BY_NAME["keepalive"].type:
            self.faults, self.state = 0, State.DISARMED
        take(self, frame)

    patch.setattr(FirmwareModel, "_take", revived)


def arms_for_anyone(patch: pytest.MonkeyPatch) -> None:
    arm = FirmwareModel._arm
    patch.setattr(FirmwareModel, "_arm", lambda self, message: arm(self, message._replace(boot_id=self.boot_id)))


def arms_over_a_fault(patch: pytest.MonkeyPatch) -> None:
    arm = FirmwareModel._arm

    def reckless(self: Any, message: Any) -> int:
        self.faults = 0
        return arm(self, message)

    patch.setattr(FirmwareModel, "_arm", reckless)


def raises_limits(patch: pytest.MonkeyPatch) -> None:
    def configure(self: Any, message: Any) -> int:
        self.limits = list(message.limits)
        return 0

    patch.setattr(FirmwareModel, "_configure", configure)


def stop_leaves_the_queue(patch: pytest.MonkeyPatch) -> None:
    off = TactilesBoard._outputs_off

    def forgetful(self: Any) -> None:
        queue = list(self._queue)
        off(self)
        self._queue = queue

    patch.setattr(TactilesBoard, "_outputs_off", forgetful)


def stop_clears_faults(patch: pytest.MonkeyPatch) -> None:
    stop = FirmwareModel._stop

    def thorough(self: Any, message: Any) -> int:
        self.faults = 0
        return stop(self, message)

    patch.setattr(FirmwareModel, "_stop", thorough)


def telemetry_each(ms: int) -> Callable[[pytest.MonkeyPatch], None]:
    return lambda patch: patch.setattr(board_module, "TELEMETRY_PERIOD_NS", ms * MS)


def counts_nothing_late(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FirmwareModel, "late", property(lambda self: 0, lambda self, value: None), raising=False)


def edges_late_by_20_us(patch: pytest.MonkeyPatch) -> None:
    check = TactilesBoard._check_room

    def shifted(self: Any, wanted: list[Pulse]) -> None:
        check(self, wanted)
        wanted[:] = [pulse._replace(start_ns=pulse.start_ns + 20_000) for pulse in wanted]

    patch.setattr(TactilesBoard, "_check_room", shifted)


def all_toward_the_skin(patch: pytest.MonkeyPatch) -> None:
    pulse = TactilesBoard._pulse
    patch.setattr(TactilesBoard, "_pulse", lambda self, message: pulse(self, message._replace(toward_skin=0x7FFF)))


def any_number_of_coils(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.tactiles_board.COIL_WORST_MA", 0)


def time_is_checked_first(patch: pytest.MonkeyPatch) -> None:
    pulse = TactilesBoard._pulse

    def hasty(self: Any, message: Any) -> int:
        self._due(message.time)
        return pulse(self, message)

    patch.setattr(TactilesBoard, "_pulse", hasty)


def cancels_everything(patch: pytest.MonkeyPatch) -> None:
    cancel = TactilesBoard._cancel
    patch.setattr(TactilesBoard, "_cancel", lambda self, message: cancel(self, message._replace(channels=0x7FFF)))


def answers_bad_frames(patch: pytest.MonkeyPatch) -> None:
    handle = FirmwareModel.handle

    def talkative(self: Any, data: bytes) -> None:
        before = self._deframer.bad_frames
        handle(self, data)
        if self._deframer.bad_frames > before:
            self._send(encode_frame(BY_NAME["reply"].type, 0, encode("reply", Status.UNKNOWN, 0, 0)))

    patch.setattr(FirmwareModel, "handle", talkative)


def counts_empty_frames(patch: pytest.MonkeyPatch) -> None:
    handle = FirmwareModel.handle

    def pedantic(self: Any, data: bytes) -> None:
        self._deframer.bad_frames += not data.strip(b"\0")
        handle(self, data)

    patch.setattr(FirmwareModel, "handle", pedantic)


def prints_to_its_port(patch: pytest.MonkeyPatch) -> None:
    send = FirmwareModel._send_telemetry

    def chatty(self: Any) -> None:
        send(self)
        self._line.send(b"telemetry sent\0", self.now_ns)

    patch.setattr(FirmwareModel, "_send_telemetry", chatty)


def stamps_when_it_likes(patch: pytest.MonkeyPatch) -> None:
    sync = FirmwareModel._sync

    def early(self: Any, seq: int, token: int) -> None:
        self.now_ns -= 30_000
        sync(self, seq, token)
        self.now_ns += 30_000

    patch.setattr(FirmwareModel, "_sync", early)


def keeps_its_boot_id(patch: pytest.MonkeyPatch) -> None:
    power_on = FirmwareModel._power_on

    def same(self: Any) -> None:
        power_on(self)
        self.first_id = self.boot_id = getattr(self, "first_id", self.boot_id)

    patch.setattr(FirmwareModel, "_power_on", same)


def restarts_at_once(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.brake_board.RESTART_NS", 1 * MS)


def starts_every_drive_anew(patch: pytest.MonkeyPatch) -> None:
    replace = BrakeBoard._replace

    def anew(self: Any, drive: Any) -> None:
        if self._drive is not None:
            self._discharge(State.ARMED)
        replace(self, drive)

    patch.setattr(BrakeBoard, "_replace", anew)


def unipolar(patch: pytest.MonkeyPatch) -> None:
    from firmware_models.plants.brake_plant import Brakes

    drive = Brakes.drive
    patch.setattr(Brakes, "drive", lambda self, mask, volts, frequency_hz, now_ns: drive(self, mask, volts, 0.0, now_ns))


def outlasts_its_ttl(patch: pytest.MonkeyPatch) -> None:
    take = BrakeBoard._take_drive
    patch.setattr(BrakeBoard, "_take_drive", lambda self, message: take(self, message._replace(ttl=message.ttl + 1)))


def arms_with_an_open_lid(patch: pytest.MonkeyPatch) -> None:
    begin = BrakeBoard._begin_arming

    def reckless(self: Any) -> None:
        lid, self.plant.lid_open = self.plant.lid_open, False
        begin(self)
        self.plant.lid_open = lid

    patch.setattr(BrakeBoard, "_begin_arming", reckless)


def arms_at_any_volts(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.brake_board.TOUCHABLE_VOLTS", 1e9)


def no_charge_limit(patch: pytest.MonkeyPatch) -> None:
    check = BrakeBoard._check_drive

    def fast(self: Any, message: Any) -> None:
        check(self, message._replace(frequency=10) if message.frequency > 10 else message)

    patch.setattr(BrakeBoard, "_check_drive", fast)


def no_account(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(CoilHeat, "hot", lambda self, wanted_s, waiting_s, limit_s, now_ns: 0)


def account_of_what_began(patch: pytest.MonkeyPatch) -> None:
    hot = CoilHeat.hot
    patch.setattr(
        CoilHeat, "hot", lambda self, wanted_s, waiting_s, limit_s, now_ns: hot(self, wanted_s, [0.0] * 15, limit_s, now_ns)
    )


def account_of_whole_milliseconds(patch: pytest.MonkeyPatch) -> None:
    begin = CoilHeat.begin
    patch.setattr(CoilHeat, "begin", lambda self, channel, on_s, now_ns: begin(self, channel, int(1e3 * on_s) / 1e3, now_ns))


def heat_is_checked_first(patch: pytest.MonkeyPatch) -> None:
    check = TactilesBoard._check_room

    def late(self: Any, wanted: list[Pulse]) -> None:
        self._check_heat(wanted)
        check(self, wanted)

    patch.setattr(TactilesBoard, "_check_room", late)


def account_of_one_coil_a_command(patch: pytest.MonkeyPatch) -> None:
    hot = CoilHeat.hot

    def lowest(self: Any, *arguments: Any) -> int:
        coils = hot(self, *arguments)
        return coils & -coils

    patch.setattr(CoilHeat, "hot", lowest)


def built_in_account_only(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(TactilesBoard, "_max_on_s", lambda self: 2.5)


def cools_twice_as_fast(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.coil_heat.THERMAL", THERMAL.with_values(tau_s=51.0))


def never_cools(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.coil_heat.THERMAL", THERMAL.with_values(tau_s=1e6))


def cancel_keeps_the_charge(patch: pytest.MonkeyPatch) -> None:
    cancel = TactilesBoard._cancel

    def charged(self: Any, message: Any) -> int:
        gone = [pulse for pulse in self._queue if message.channels >> pulse.channel & 1]
        for pulse in gone:
            self.heat.begin(pulse.channel, (pulse.end - pulse.start) / 2e6, self.now_ns)
        return cancel(self, message)

    patch.setattr(TactilesBoard, "_cancel", charged)


def cancel_refunds_more_than_is_left(patch: pytest.MonkeyPatch) -> None:
    """Charged when taken, decayed while waiting, refunded whole."""
    cancel = TactilesBoard._cancel

    def generous(self: Any, message: Any) -> int:
        gone = [pulse for pulse in self._queue if message.channels >> pulse.channel & 1]
        for pulse in gone:
            self.heat.begin(pulse.channel, -(pulse.end - pulse.start) / 2e6 / 102, self.now_ns)
        return cancel(self, message)

    patch.setattr(TactilesBoard, "_cancel", generous)


def cold_after(name: str) -> Callable[[pytest.MonkeyPatch], None]:
    """A method of the board behind which its coils count as cold."""

    def broken(patch: pytest.MonkeyPatch) -> None:
        method = getattr(TactilesBoard, name)

        def forgetful(self: Any, *arguments: Any) -> Any:
            self.heat = CoilHeat(self.now_ns)
            return method(self, *arguments)

        patch.setattr(TactilesBoard, name, forgetful)

    return broken


def forgets_by_loss_of_power(patch: pytest.MonkeyPatch) -> None:
    def cold(self: Any, limit_s: float, now_ns: int) -> None:
        self._accounts_s = [0.0] * 15

    patch.setattr(CoilHeat, "lose_power", cold)


def forgets_little_by_loss_of_power(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("firmware_models.boards.coil_heat.WARM_S", 0.0)
    lose = CoilHeat.lose_power

    def little(self: Any, limit_s: float, now_ns: int) -> None:
        warm = sum(self._accounts_s) > 0.1
        lose(self, limit_s, now_ns)
        if not warm:
            self._accounts_s = [0.0] * 15

    patch.setattr(CoilHeat, "lose_power", little)


def trusts_memory_after_loss_of_power(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(CoilHeat, "lose_power", lambda self, limit_s, now_ns: None)


def heat_rounded_down(patch: pytest.MonkeyPatch) -> None:
    def units(self: Any, waiting_s: Any, now_ns: int) -> list[int]:
        self._cool(now_ns)
        return [int(50 * one) for one in self._accounts_s]

    patch.setattr(CoilHeat, "units", units)


def any_stored_charge(patch: pytest.MonkeyPatch) -> None:
    check = BrakeBoard._check_drive

    def boundless(self: Any, message: Any) -> None:
        limits = list(self.limits)
        self.limits[4] = 1 << 32
        try:
            check(self, message)
        finally:
            self.limits = limits

    patch.setattr(BrakeBoard, "_check_drive", boundless)


def built_in_charge_only(patch: pytest.MonkeyPatch) -> None:
    configure = FirmwareModel._configure

    def partly(self: Any, message: Any) -> int:
        return configure(self, message._replace(limits=(*message.limits[:4], self.limits[4])))

    patch.setattr(FirmwareModel, "_configure", partly)


COIL, BRAKE = Board.TACTILES, Board.BRAKE
BREAKAGES: list[tuple[Callable[[pytest.MonkeyPatch], None], Board, set[str]]] = [
    (plays_late, COIL, {"pulse.late", "pulse.wrap", "telemetry.late"}),
    (plays_late, BRAKE, {"drive.late", "drive.off-checks", "telemetry.late"}),
    (wrong_lateness, COIL, {"pulse.late"}),
    (plays_duplicates, COIL, {"repeat.same", "repeat.refusal", "repeat.sixteen", "repeat.zero", "pulse.repeat"}),
    (remembers(15), BRAKE, {"repeat.sixteen"}),
    (remembers(17), BRAKE, {"repeat.sixteen"}),
    (keeps_number_zero, COIL, {"repeat.zero"}),
    (stop_is_repeated, COIL, {"repeat.stop"}),
    (remembers_through_identify, COIL, {"repeat.identify"}),
    (identifies_once, BRAKE, {"identify.always"}),
    (talks_unasked, COIL, {"identify.unasked"}),
    (another_schema, COIL, {"identity.schema"}),
    (no_dead_man, COIL, {"dead-man.armed", "dead-man.energised", "dead-man.pulse", "dead-man.feeds"}),
    (no_dead_man, BRAKE, {"dead-man.armed", "dead-man.energised"}),
    (slow_dead_man, COIL, {"dead-man.armed", "identity.fields"}),
    (any_byte_feeds, BRAKE, {"dead-man.feeds"}),
    (any_frame_feeds, COIL, {"dead-man.feeds"}),
    (any_length_feeds, BRAKE, {"dead-man.feeds"}),
    (comes_back_by_itself, COIL, {"dead-man.armed", "fault.once"}),
    (arms_for_anyone, COIL, {"arm.boot-id"}),
    (arms_over_a_fault, BRAKE, {"fault.arm"}),
    (raises_limits, COIL, {"configure.limits", "configure.stricter", "configure.armed"}),
    (stop_leaves_the_queue, COIL, {"stop.energised", "disarm.energised"}),
    (stop_clears_faults, COIL, {"stop.fault"}),
    (telemetry_each(10), COIL, {"telemetry.period"}),
    (telemetry_each(40), BRAKE, {"telemetry.period"}),
    (counts_nothing_late, COIL, {"telemetry.late"}),
    (edges_late_by_20_us, COIL, {"pulse.edges", "pulse.order", "pulse.direction"}),
    (all_toward_the_skin, COIL, {"pulse.direction", "pulse.edges"}),
    (any_number_of_coils, COIL, {"pulse.full-current", "pulse.first-reason"}),
    (time_is_checked_first, COIL, {"pulse.first-reason"}),
    (cancels_everything, COIL, {"cancel", "telemetry.queued"}),
    (answers_bad_frames, COIL, {"bad-frames.crc", "bad-frames.cobs", "bad-frames.truncated"}),
    (counts_empty_frames, BRAKE, {"bad-frames.idle"}),
    (prints_to_its_port, BRAKE, {"frames.whole"}),
    (stamps_when_it_likes, COIL, {"sync.stamps"}),
    (keeps_its_boot_id, COIL, {"reboot.brown-out"}),
    (restarts_at_once, BRAKE, {"drive.restart"}),
    (starts_every_drive_anew, BRAKE, {"drive.renewed", "drive.raised"}),
    (unipolar, BRAKE, {"drive.wave", "drive.renewed"}),
    (outlasts_its_ttl, BRAKE, {"drive.edges", "drive.values"}),
    (arms_with_an_open_lid, BRAKE, {"lid"}),
    (arms_at_any_volts, BRAKE, {"arm.touchable"}),
    (no_charge_limit, BRAKE, {"drive.values"}),
    (any_stored_charge, BRAKE, {"drive.charge"}),
    (built_in_charge_only, BRAKE, {"drive.charge", "configure.stricter"}),
    (built_in_charge_only, COIL, {"configure.stricter", "heat.limit", "heat.configured"}),
    (no_account, COIL, {"heat.limit", "heat.small", "heat.decay", "heat.refund", "heat.configured", "heat.power"}),
    (account_of_what_began, COIL, {"heat.refund", "heat.limit"}),
    (account_of_whole_milliseconds, COIL, {"heat.small", "heat.telemetry"}),
    (account_of_one_coil_a_command, COIL, {"heat.small"}),
    (heat_is_checked_first, COIL, {"heat.limit"}),
    (built_in_account_only, COIL, {"heat.limit", "heat.configured"}),
    (cools_twice_as_fast, COIL, {"heat.decay"}),
    (never_cools, COIL, {"heat.decay", "heat.power"}),
    (cancel_keeps_the_charge, COIL, {"heat.refund"}),
    (cancel_refunds_more_than_is_left, COIL, {"heat.refund"}),
    (cold_after("_arm"), COIL, {"heat.outlives"}),
    (cold_after("_disarm"), COIL, {"heat.outlives"}),
    (cold_after("_stop"), COIL, {"heat.outlives"}),
    (cold_after("_outputs_off"), COIL, {"heat.outlives"}),
    (cold_after("_configure"), COIL, {"heat.configured"}),
    (cold_after("_power_on"), COIL, {"heat.outlives"}),
    (forgets_by_loss_of_power, COIL, {"heat.power"}),
    (forgets_little_by_loss_of_power, COIL, {"heat.power"}),
    (trusts_memory_after_loss_of_power, COIL, {"heat.power"}),
    (heat_rounded_down, COIL, {"heat.telemetry"}),
]
