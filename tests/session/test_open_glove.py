"""The glove of a script says at once what it can no longer do: closed, no longer served, boards gone safe, values grown old."""

from __future__ import annotations

import threading

import pytest

from haptics.errors import DeadManMissed, GloveEnded, HapticsError
from haptics.session import opening as opening_module, service as service_module
from haptics.session.glove import Glove, open as open_glove

TACTILES, BRAKE = "sim://tactiles?spread=0", "sim://brake?spread=0"
CALLS = {
    "arm": lambda glove: glove.arm(),
    "contact": lambda glove: glove.contact("index_tip"),
    "release": lambda glove: glove.release("index_tip"),
    "pulse": lambda glove: glove.pulse("index_tip"),
    "brake": lambda glove: glove.brake("index", volts=100.0),
    "results": lambda glove: glove.results(),
    "state": lambda glove: glove.state(),
    "advance": lambda glove: glove.advance(0.001),
    "off": lambda glove: glove.off(),
    "enter": lambda glove: glove.__enter__(),
}


def virtual() -> Glove:
    return open_glove(tactiles=TACTILES, brake=BRAKE, clock="virtual")


def ports(glove):
    return [link.port for link in glove.devices.links.values()]


@pytest.fixture
def real(request):
    """A glove in real time, closed again."""
    glove = open_glove(tactiles=TACTILES, brake=BRAKE)
    yield glove
    glove.close()


def test_every_call_of_a_closed_glove_says_that_it_is_closed():
    with virtual() as glove:
        glove.arm()
    for call in CALLS.values():
        with pytest.raises(GloveEnded, match="closed"):
            call(glove)
    glove.close()


def test_a_glove_in_real_time_is_served_without_a_with(real):
    real.arm()  # would never see telemetry, nor feed the dead-man, if nobody served it
    seen = threading.Event()
    real.devices.on_event(lambda board, event: seen.set())
    assert seen.wait(30)
    assert {"tactiles", "brake"} == set(real.state().armed) or real.state().faults


@pytest.mark.parametrize("times", [1, 1_000_000], ids=["once", "for ever"])
def test_a_thread_that_dies_goes_off_and_every_later_call_names_the_cause(real, times):
    real.arm()
    real.contact("index_tip")
    left, tick = [times], real.devices.tick

    def fails(now_ns):
        left[0] -= 1
        return 1 / 0 if left[0] >= 0 else tick(now_ns)

    with real._lock:
        real.devices.tick = fails
    real._service._thread.join(30)
    state = real.state()
    assert state.armed == ()
    assert any("thread that serves the glove ended: ZeroDivisionError" in fault for fault in state.faults)
    for name in ("arm", "contact", "release", "pulse", "brake", "results", "advance", "enter"):
        with pytest.raises(GloveEnded, match="ZeroDivisionError: division by zero") as caught:
            CALLS[name](real)
        assert isinstance(caught.value.__cause__, ZeroDivisionError)
    real.close()
    assert not any(port.is_open for port in ports(real))


@pytest.mark.parametrize(
    "armed_again", [Glove.arm, lambda glove: glove.devices.finish(glove.begin_arming())], ids=["arm", "begun"]
)
def test_a_host_that_hung_past_the_dead_man_says_so_at_once_and_in_the_next_call(real, monkeypatch, armed_again):
    real.arm()
    awake_ns = service_module.awake_ns
    with real._lock:  # the thread waits while time goes on, as in a process that was stopped
        monkeypatch.setattr(service_module, "awake_ns", lambda: awake_ns() + 1_500_000_000)
        real._service.serve()
        assert any(
            "tactiles, brake: dead-man, as the host did not serve the glove for 1." in fault for fault in real.state().faults
        )
        assert real.devices.doing == "off"
        real.devices.finish(real.devices.begin("off"))
        assert real.state().armed == ()
        for name in ("contact", "release", "pulse", "brake"):
            with pytest.raises(DeadManMissed, match="until the glove is armed again"):
                CALLS[name](real)
        real.results()
        armed_again(real)
        real.contact("index_tip")


def test_a_gap_while_nothing_is_armed_is_no_fault(real, monkeypatch):
    with real._lock:
        late_ns = service_module.awake_ns() + 1_500_000_000
        monkeypatch.setattr(service_module, "awake_ns", lambda: late_ns)
        real._service.serve()
        assert real.state().faults == ()


def test_state_says_how_old_telemetry_is_and_believes_nothing_stale():
    glove = virtual()
    glove.arm()
    glove.brake("index", volts=500.0, ttl_s=1.0)
    glove.advance(0.1)
    state = glove.state()
    assert state.stale == ()
    assert all(0.0 <= age_s <= 0.03 for age_s in state.telemetry_age_s.values())
    assert state.volts["index"] == pytest.approx(500, abs=30)
    glove.devices.links["brake"].session.receive = lambda data, now_ns: None  # the line loses whatever comes
    glove.advance(0.5)
    state = glove.state()
    assert state.stale == ("brake",)
    assert state.telemetry_age_s["brake"] > 0.4
    assert state.volts == {"index": None, "thumb": None}
    assert state.capacitance_pf == {"index": None, "thumb": None}
    glove.close()


@pytest.mark.parametrize("error", [RuntimeError("no"), KeyboardInterrupt()], ids=["error", "ctrl-c"])
def test_closing_closes_the_ports_whatever_going_off_does(error, monkeypatch):
    glove = virtual()

    def fails():
        raise error

    monkeypatch.setattr(glove.devices, "off", fails)
    with pytest.raises(type(error)):
        glove.close()
    assert not any(port.is_open for port in ports(glove))
    glove.close()


def test_ctrl_c_between_two_ports_closes_the_second_too(monkeypatch):
    glove = virtual()
    first = next(iter(glove.devices.links.values()))
    closing, closed = first.close, []

    def interrupted():
        closing()
        if not closed:
            closed.append(True)
            raise KeyboardInterrupt

    monkeypatch.setattr(first, "close", interrupted)
    with pytest.raises(KeyboardInterrupt):
        glove.close()
    assert not any(port.is_open for port in ports(glove))


def test_a_call_that_never_ends_does_not_keep_the_ports_open(monkeypatch):
    monkeypatch.setattr("haptics.session.glove.JOIN_S", 0.01)
    glove = virtual()
    holds, ends = threading.Event(), threading.Event()

    def hang():
        with glove._lock:
            holds.set()
            ends.wait(30)

    thread = threading.Thread(target=hang)
    thread.start()
    assert holds.wait(30)
    with pytest.raises(HapticsError, match="dead-man"):
        glove.close()
    assert not any(port.is_open for port in ports(glove))
    ends.set()
    thread.join()


def test_a_glove_closed_by_eight_threads_goes_off_once(monkeypatch):
    glove = virtual()
    glove.arm()
    offs, go_off = [], glove.devices.off
    monkeypatch.setattr(glove.devices, "off", lambda: (offs.append(1), go_off()))
    threads = [threading.Thread(target=glove.close) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert offs == [1]


def test_calls_of_several_threads_come_one_after_another():
    """Each thread's calls are whole: virtual time moves by their sum, and every pulse has one result."""
    glove = virtual()
    glove.arm()
    begin_ns = glove.state().time_ns
    results, errors = [], []

    def use():
        try:
            for _ in range(10):
                glove.pulse("index_tip", count=1)
                glove.advance(0.01)
                results.extend(glove.results())
                glove.state()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=use) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert errors == []
    assert glove.state().time_ns - begin_ns == 40 * 10_000_000
    glove.advance(0.5)
    results += glove.results()
    assert len([one for one in results if one.kind == "pulse"]) == 40
    glove.close()


def test_what_a_brake_controller_refuses_is_among_the_results():
    glove = virtual()
    glove.arm()
    plant = glove.devices.plant("brake")
    plant.set_load(0, lid_open=1.0)
    glove.advance(0.05)
    glove.brake("index", volts=500.0, ttl_s=1.0)
    glove.advance(0.1)
    refused = [one for one in glove.results() if one.kind == "brake"]
    assert refused
    assert not any(one.played for one in refused)
    glove.close()


def test_a_thread_that_cannot_be_started_leaves_no_port_open(monkeypatch):
    made = []
    opening = opening_module.open_port
    monkeypatch.setattr(opening_module, "open_port", lambda *a: made.append(opening(*a)) or made[-1])

    def no_more(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", no_more)
    with pytest.raises(RuntimeError):
        open_glove(tactiles=TACTILES)
    assert made
    assert not any(port.is_open for port in made)


def test_a_call_serves_a_glove_whose_thread_gets_no_turn(real, monkeypatch):
    """Many threads that call all the time keep the lock from the one that serves; the boards hear from the calls then."""
    real.arm()
    real._service.stop()  # it never gets a turn again
    real._service._stopping.clear()
    served = []
    monkeypatch.setattr(real._service, "serve", lambda: served.append(real.devices.now_ns()))
    with real._lock:
        late_ns = service_module.awake_ns() + 2_000_000
        monkeypatch.setattr(service_module, "awake_ns", lambda: late_ns)
        real.contact("index_tip")
    assert len(served) == 1


def test_the_first_call_after_a_gap_already_says_so(real, monkeypatch):
    real.arm()
    with real._lock:  # the thread has not had a turn since the process went on
        late_ns = service_module.awake_ns() + 1_500_000_000
        monkeypatch.setattr(service_module, "awake_ns", lambda: late_ns)
        with pytest.raises(DeadManMissed, match=r"did not serve the glove for 1\."):
            real.contact("index_tip")
        assert [one.reason for one in real.results() if one.site == "index_tip"] == []


def test_off_clears_a_latched_dead_man_so_that_the_glove_can_be_armed_again():
    with virtual() as glove:
        glove.arm()
        clock = glove.devices.clock
        late_ns = clock.now_ns() + 300_000_000
        for link in glove.devices.links.values():  # boards go on by themselves
            link.advance(late_ns)
        clock.advance_to(late_ns)
        glove.advance(0.05)
        with pytest.raises(HapticsError, match=r"latched: dead_man; .*clear\(\) of an open glove"):
            glove.arm()
        glove.off()
        glove.arm()
        glove.contact("index_tip")
        glove.advance(0.05)
        assert [one.played for one in glove.results() if one.reason != "unarmed"] == [True]


def test_leaving_a_with_clears_no_fault(monkeypatch):
    glove = virtual()
    begin, begun = glove.devices.begin, []
    monkeypatch.setattr(glove.devices, "begin", lambda kind: begun.append(kind) or begin(kind))
    with glove:
        glove.arm()
    assert begun == ["arm", "off"]  # a fault that nobody looked at is not cleared


def test_a_forked_process_neither_uses_nor_closes_the_glove_of_its_parent(monkeypatch):
    glove = virtual()
    glove.arm()
    monkeypatch.setattr("haptics.session.glove.os.getpid", lambda: -1)
    for call in CALLS.values():
        with pytest.raises(GloveEnded, match="served by process"):
            call(glove)
    glove.close()
    monkeypatch.undo()
    assert set(glove.state().armed) == {"tactiles", "brake"}
    glove.close()
    assert not any(port.is_open for port in ports(glove))
