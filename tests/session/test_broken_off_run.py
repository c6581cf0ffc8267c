"""What a run leaves behind when it does not end as planned."""

from __future__ import annotations

import pytest

from haptics.errors import LinkLost
from haptics.recording import load
from haptics.session.configuration import Configuration
from haptics.session.run import RunOptions, run_scene
from haptics.session.session import Session


@pytest.mark.slow
@pytest.mark.parametrize("error", [KeyboardInterrupt(), LinkLost("sim://tactiles", "the port went away")])
def test_a_run_that_is_broken_off_goes_off_and_leaves_what_it_had_marked_incomplete(tmp_path, monkeypatch, error):
    ticks, gloves = [], []
    tick = Session.tick

    def breaks_off(self: Session, now_ns: int) -> None:
        ticks.append(now_ns)
        gloves.append(self.glove)
        if len(ticks) == 1500:  # the hand holds the ball, the brakes are up
            assert abs(self.glove.plant("brake").truth()["volts"][0]) > 100
            raise error
        tick(self, now_ns)

    closed = []
    monkeypatch.setattr(Session, "tick", breaks_off)
    monkeypatch.setattr("haptics.session.devices.Devices.close", lambda self: closed.append(self.plant("brake").truth()))
    with pytest.raises(type(error)):
        run_scene("playground", "synthetic", Configuration(), RunOptions(out=tmp_path / "run.h5"))
    assert max(abs(volts) for volts in closed[0]["volts"]) < 60
    assert set(gloves[0].plant("tactiles").truth()["latched"]) == {"off"}
    recording = load(tmp_path / "run.h5")
    assert not recording.complete
    assert len(recording.stream("poses")) > 100
    assert not list(tmp_path.glob("*.journal"))
