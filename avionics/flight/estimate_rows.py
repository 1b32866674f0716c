"""Estimates as records: amplitudes, line, marker pixels, and a one-sigma of each."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config
from avionics.flight.filter_setup import (
    choose_basis,
    marker_model,
    paper_basis,
    settings_from_config,
)
from avionics.kinds import CRG, FILTERED, RG, EstimateKind
from avionics.records import WingShapeEstimate
from avionics.wse.adaptive_noise import NO_VERDICT, Verdict
from avionics.wse.forecast import (
    Belief,
    Extrapolation,
    Outlook,
    Outlooks,
    stack_beliefs,
    stack_outlooks,
)
from avionics.wse.markers import View

ROWS_PER_COVARIANCE = 10


class Tick(NamedTuple):
    """What was known at one tick; extrapolation, geometry and records are made of it later.

    Attributes
    ----------
    t_ns, number : int
        The tick, ns, and in periods.
    outlook : Outlook
        Of both estimators.
    verdict : Verdict
        On the last frame that was used.
    full : bool
        Whether the rows carry the covariance.
    """

    t_ns: int
    number: int
    outlook: Outlook
    verdict: Verdict
    full: bool


class Seen(NamedTuple):
    """What was believed of the instant of a frame after its update.

    Attributes
    ----------
    t_ns, now_ns : int
        Exposure and update, ns.
    belief : Belief
        Of the camera-aided filter.
    verdict : Verdict
        On the frame.
    """

    t_ns: int
    now_ns: int
    belief: Belief
    verdict: Verdict


class Labels(NamedTuple):
    """What some rows carry beside the state.

    Attributes
    ----------
    t_ns : list of int
        When the shape was this, ns.
    full : list of bool
        Whether the row carries the covariance.
    nis : list of float
        Of the last update.
    used : list of ndarray of bool, shape (K,)
        Markers that it used; empty where there was none.
    """

    t_ns: list[int]
    full: list[bool]
    nis: list[float]
    used: list[NDArray[Any]]


class RowBatch(NamedTuple):
    """All that the rows of some ticks and frames are made of, stacked; None where there are none.

    Attributes
    ----------
    ticks : (Outlooks, Labels) or None
        One row a tick for RG-WSE and one for CRG-WSE.
    seen : (Belief, Labels) or None
        One row a frame.
    """

    ticks: tuple[Outlooks, Labels] | None
    seen: tuple[Belief, Labels] | None


def row_batch(ticks: Sequence[Tick], seen: Sequence[Seen]) -> RowBatch:
    """Return the batch of some ticks and frames."""
    of_ticks = of_seen = None
    if ticks:
        outlooks = stack_outlooks([tick.outlook for tick in ticks])
        of_ticks = outlooks, _labels(ticks, [tick.full for tick in ticks])
    if seen:
        of_seen = stack_beliefs([item.belief for item in seen]), _labels(seen, [True] * len(seen))
    return RowBatch(of_ticks, of_seen)


def _labels(items: Sequence[Tick] | Sequence[Seen], full: list[bool]) -> Labels:
    verdicts = [item.verdict for item in items]
    return Labels(
        [item.t_ns for item in items], full, [v.nis for v in verdicts], [v.used for v in verdicts]
    )


def _unaided(t_ns: list[int], full: list[bool]) -> Labels:
    """Return the labels of rows that no frame has touched."""
    return Labels(t_ns, full, [NO_VERDICT.nis] * len(t_ns), [NO_VERDICT.used] * len(t_ns))


class RowMaker:
    """Makes the records of both estimators; one batched call serves many.

    Parameters
    ----------
    config : Config
        What flies.
    """

    def __init__(self, config: Config) -> None:
        settings = settings_from_config(config)
        self._extrapolation = Extrapolation(
            settings.rates, settings.process(), settings.paper_process()
        )
        model = marker_model(config, choose_basis(config))
        paper_model = marker_model(config, paper_basis(config))
        self._wing = config.wing.name
        self._pods = len(config.pods)
        # Model axes of a left wing are mirrored: rates but for y change sign.
        turned = -1.0 if config.wing.side == "left" else 1.0
        self._bias_signs = np.array([turned, 1.0, turned])
        self._model = model
        self._paper_model = paper_model
        self._paper = paper_model.basis
        self._embed = model.basis.embed(self._paper) if model.basis.holds(self._paper) else None
        self._name, self._paper_name = model.basis.name, self._paper.name
        self._has_bias = settings.has_bias
        self._no_bias = np.full((self._pods, 3), np.nan)

    def together(
        self, batch: RowBatch
    ) -> tuple[list[tuple[WingShapeEstimate, WingShapeEstimate]], list[WingShapeEstimate]]:
        """Return the rows (rg, crg) of some ticks and those of some frames, in batched calls."""
        n = self._model.basis.count
        if batch.ticks is None:
            if batch.seen is None:
                return [], []
            fused, labels = batch.seen
            return [], self._records(FILTERED, fused, self._model.stack(fused.x[:, :n]), labels)
        outlooks, labels = batch.ticks
        count = len(labels.t_ns)
        rg, crg = self._extrapolation.beliefs(outlooks)
        q_rg, q = rg.x[:, : self._paper.count], crg.x[:, :n]
        if batch.seen is not None:
            q = np.concatenate([q, batch.seen[0].x[:, :n]])
        if self._embed is None:
            views_rg, views = self._paper_model.stack(q_rg), self._model.stack(q)
        else:
            every = self._model.stack(np.concatenate([q_rg @ self._embed, q]))
            views_rg, views = every[:count].in_basis(self._embed), every[count:]
        rows_rg = self._records(RG, rg, views_rg, _unaided(labels.t_ns, labels.full))
        rows_crg = self._records(CRG, crg, views[:count], labels)
        rows_seen = []
        if batch.seen is not None:
            rows_seen = self._records(FILTERED, batch.seen[0], views[count:], batch.seen[1])
        return list(zip(rows_rg, rows_crg, strict=True)), rows_seen

    def single(self, t_ns: int, kind: EstimateKind, belief: Belief) -> WingShapeEstimate:
        """Return the record of one belief in the camera-aided filter's basis, with covariance."""
        stack = Belief(belief.x[None], belief.P[None])
        views = self._model.stack(stack.x[:, : self._model.basis.count])
        return self._records(kind, stack, views, _unaided([t_ns], [True]))[0]

    def _records(
        self, kind: EstimateKind, belief: Belief, view: View, labels: Labels
    ) -> list[WingShapeEstimate]:
        """Return the records of stacked beliefs and their views."""
        basis = self._paper if kind == RG else self._model.basis
        n, pods, rows, x = basis.count, self._pods, len(labels.t_ns), belief.x
        sigma = np.sqrt(belief.P.diagonal(axis1=1, axis2=2))
        slopes = np.concatenate([view.pixel_by_q.reshape(rows, -1, n), view.tip_by_q], axis=1)
        variance = ((slopes @ belief.P[:, :n, :n]) * slopes).sum(axis=-1)
        spread = np.sqrt(np.maximum(variance, 0.0))
        unseen = ~view.can_see
        pixel, pixel_sigma = view.pixel.copy(), spread[:, :-3].reshape(rows, -1, 2)
        pixel[unseen] = np.nan
        pixel_sigma[unseen] = np.nan
        has_bias = self._has_bias and kind != RG and pods > 0
        size = n + 3 * pods if has_bias else n
        if has_bias:
            bias = x[:, n:size].reshape(rows, pods, 3) * self._bias_signs
            bias_sigma = sigma[:, n:size].reshape(rows, pods, 3)
        else:
            bias = bias_sigma = np.broadcast_to(self._no_bias, (rows, pods, 3))
        phi, theta, psi = basis.phi, basis.theta, basis.psi
        name = self._paper_name if kind == RG else self._name
        none_used = np.zeros(pixel.shape[1], dtype=bool)
        return [
            WingShapeEstimate(
                t_ns=labels.t_ns[i],
                wing=self._wing,
                kind=kind,
                basis=name,
                phi_rad=x[i, phi],
                theta_rad=x[i, theta],
                psi_rad=x[i, psi],
                phi_sigma_rad=sigma[i, phi],
                theta_sigma_rad=sigma[i, theta],
                psi_sigma_rad=sigma[i, psi],
                bias_rad_s=bias[i],
                bias_sigma_rad_s=bias_sigma[i],
                line_in_body_m=view.line_in_body[i],
                tip_sigma_m=spread[i, -3:],
                marker_px=pixel[i],
                marker_sigma_px=pixel_sigma[i],
                nis=labels.nis[i],
                used=labels.used[i] if labels.used[i].size else none_used,
                # Amplitudes and biases; slow camera states stay inside.
                covariance=belief.P[i, :size, :size] if labels.full[i] else None,
            )
            for i in range(rows)
        ]
