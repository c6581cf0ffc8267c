"""A ``TouchDecider`` over bodies instead of functions, on the compiled path from a pose to its decisions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from haptics.errors import InputError
from haptics.rendering.decision import FASTEST_M_S, NEVER_NS, STEP_S, Decided, DecisionParameters, TouchDecider
from haptics.rendering.pose_kernel import PRESENT, Constants, Decisions, Forecast, History, observe
from haptics.rendering.prediction import PredictionParameters
from haptics.scene.geometry.packed import packed
from haptics.scene.geometry.shapes import Placed
from haptics.time import NS_PER_MS


class BodyDecider(TouchDecider):
    """Touches of one hand's sites with bodies of the shipped shapes; decides what a ``TouchDecider`` over their distances would.

    :param bodies: where they are now (:meth:`put` moves them).
    :param radius_m: of the sites' spheres, (n,), metres, 0 or more.
    :param lead_ns: see ``TouchDecider``.
    :param release_lead_ns: likewise.
    :param stale_ns: likewise.
    :param decision: likewise.
    :param prediction: likewise.
    :param points: how many points make up a site, which touches when all of them do.
    :raises InputError: see ``TouchDecider``.
    """

    def __init__(
        self,
        bodies: Sequence[Placed],
        radius_m: ArrayLike,
        lead_ns: int,
        release_lead_ns: int | None = None,
        stale_ns: int = 50 * NS_PER_MS,
        decision: DecisionParameters | None = None,
        prediction: PredictionParameters | None = None,
        points: int = 1,
    ):
        super().__init__([body.distance for body in bodies], radius_m, lead_ns, release_lead_ns, stale_ns, decision, prediction)
        sites = len(self._radius_m)
        self._placed = list(bodies)
        self._bodies = packed(bodies)
        self._standing = np.full(len(bodies), PRESENT)
        self._constants = _constants(self._p, prediction or PredictionParameters(), self.lead_ns, self.release_lead_ns, stale_ns)
        self._past = History.of(sites, 3 * points)
        self._forecast = Forecast(np.zeros((sites, 3 * points)), np.zeros((sites, 3 * points)), np.zeros(sites))
        self._decisions = Decisions(self._touching, self._turned_ns, self._act_ns, self._aimed_ns, self._seen_m, self._seen_ns)
        self._room = np.empty((self._touching.size, 2), np.int64)
        self.observe(0, np.zeros((sites, 3 * points)), 0)  # compiled code is loaded here, not at the first pose
        self.forget()

    def put(self, index: int, body: Placed, standing: int = PRESENT) -> None:
        """Move a body, or take it out of play.

        :param index: which.
        :param body: where it is now, of the same shape.
        :param standing: ``pose_kernel.PRESENT``, ``ABSENT`` or ``FAR``.
        """
        self._standing[index] = standing
        if body is not self._placed[index]:
            self._placed[index] = body
            self._bodies.put(index, body.pose)

    def forget(self) -> None:
        super().forget()
        self._past.rings[:] = 0

    def observe(self, time_ns: int, position_m: ArrayLike, now_ns: int) -> None:
        position = np.ascontiguousarray(position_m, dtype=float)
        if position.shape != self._forecast.velocity_m_s.shape:
            raise InputError(f"position_m has shape {position.shape}; expected {self._forecast.velocity_m_s.shape}, metres")
        later, ended, next_ns, dies_ns = observe(
            time_ns,
            now_ns,
            position,
            self._radius_m,
            self._constants,
            self._past,
            self._forecast,
            self._bodies,
            self._standing,
            self._decisions,
            self._room,
        )
        if not later:
            return
        self._next_ns, self._dies_ns = next_ns, dies_ns
        for row, column in self._room[:ended].tolist():
            self._ends.append(Decided(column, row, False, now_ns + self.release_lead_ns))


def _constants(p: DecisionParameters, q: PredictionParameters, lead_ns: int, release_lead_ns: int, stale_ns: int) -> Constants:
    return Constants(
        q.velocity_span_ns,
        q.acceleration_span_ns,
        q.recent_ns,
        q.longest_gap_ns,
        q.damping_per_s,
        q.common_gain,
        q.own_gain,
        q.level_weight,
        q.disagreement_weight,
        q.recent_weight,
        q.noise_m,
        p.doubt_early,
        p.doubt_sure,
        round(p.early_s / STEP_S),
        p.sure_m,
        p.horizon_s,
        p.release_m,
        p.dwell_ns,
        lead_ns,
        release_lead_ns,
        stale_ns,
        STEP_S,
        FASTEST_M_S,
        NEVER_NS,
    )
