"""Estimates as records: amplitudes, line, marker pixels, and a one-sigma of each."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from avionics.config import Config
from avionics.records import EstimateKind, WingShapeEstimate
from avionics.wse.fusion import Belief, Outlook
from avionics.wse.measurement import MarkerModel, View
from avionics.wse.trust import NO_VERDICT, Verdict

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


class RowMaker:
    """Makes the records of both estimators; one batched call serves many.

    Parameters
    ----------
    config : Config
        Wing and pods.
    model, paper_model : MarkerModel
        Geometry and camera in the camera-aided filter's basis, and in RG-WSE's.
    beliefs : callable
        Extrapolates outlooks to their ticks: (RG-WSE, CRG-WSE), stacked.
    has_bias : bool
        Whether the camera-aided filter estimates gyro biases.
    """

    def __init__(
        self,
        config: Config,
        model: MarkerModel,
        paper_model: MarkerModel,
        beliefs: Callable[[Sequence[Outlook]], tuple[Belief, Belief]],
        *,
        has_bias: bool,
    ) -> None:
        self._beliefs = beliefs
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
        self._has_bias = has_bias
        self._no_bias = np.full((self._pods, 3), np.nan)

    def together(
        self, ticks: Sequence[Tick], seen: Sequence[Seen]
    ) -> tuple[list[tuple[WingShapeEstimate, WingShapeEstimate]], list[WingShapeEstimate]]:
        """Return the rows (rg, crg) of some ticks and those of some frames, in batched calls."""
        count, n = len(ticks), self._model.basis.count
        fused = [item.belief for item in seen]
        filtered = Belief(np.array([b.x for b in fused]), np.array([b.P for b in fused]))
        if not ticks:
            return [], self._filtered(seen, filtered, self._model.stack(filtered.x[:, :n]))
        rg, crg = self._beliefs([tick.outlook for tick in ticks])
        q_rg, q = rg.x[:, : self._paper.count], crg.x[:, :n]
        if seen:
            q = np.concatenate([q, filtered.x[:, :n]])
        if self._embed is None:
            views_rg, views = self._paper_model.stack(q_rg), self._model.stack(q)
        else:
            every = self._model.stack(np.concatenate([q_rg @ self._embed, q]))
            views_rg, views = every[:count].in_basis(self._embed), every[count:]
        t_ns, full = [tick.t_ns for tick in ticks], [tick.full for tick in ticks]
        rows_rg = self._records(t_ns, "rg", rg, views_rg, verdicts=[NO_VERDICT] * count, full=full)
        verdicts = [tick.verdict for tick in ticks]
        rows_crg = self._records(t_ns, "crg", crg, views[:count], verdicts=verdicts, full=full)
        rows_seen = self._filtered(seen, filtered, views[count:]) if seen else []
        return list(zip(rows_rg, rows_crg, strict=True)), rows_seen

    def _filtered(
        self, seen: Sequence[Seen], stack: Belief, views: View
    ) -> list[WingShapeEstimate]:
        t_ns, verdicts = [item.t_ns for item in seen], [item.verdict for item in seen]
        return self._records(
            t_ns, "filtered", stack, views, verdicts=verdicts, full=[True] * len(seen)
        )

    def single(self, t_ns: int, kind: EstimateKind, belief: Belief) -> WingShapeEstimate:
        """Return the record of one belief in the camera-aided filter's basis, with covariance."""
        stack = Belief(belief.x[None], belief.P[None])
        views = self._model.stack(stack.x[:, : self._model.basis.count])
        return self._records([t_ns], kind, stack, views, verdicts=[NO_VERDICT], full=[True])[0]

    def _records(
        self,
        t_ns: Sequence[int],
        kind: EstimateKind,
        belief: Belief,
        view: View,
        *,
        verdicts: Sequence[Verdict],
        full: Sequence[bool],
    ) -> list[WingShapeEstimate]:
        """Return the records of stacked beliefs and their views."""
        basis = self._paper if kind == "rg" else self._model.basis
        n, pods, rows, x = basis.count, self._pods, len(t_ns), belief.x
        sigma = np.sqrt(belief.P.diagonal(axis1=1, axis2=2))
        slopes = np.concatenate([view.pixel_by_q.reshape(rows, -1, n), view.tip_by_q], axis=1)
        variance = ((slopes @ belief.P[:, :n, :n]) * slopes).sum(axis=-1)
        spread = np.sqrt(np.maximum(variance, 0.0))
        unseen = ~view.can_see
        pixel, pixel_sigma = view.pixel.copy(), spread[:, :-3].reshape(rows, -1, 2)
        pixel[unseen] = np.nan
        pixel_sigma[unseen] = np.nan
        has_bias = self._has_bias and kind != "rg" and pods > 0
        size = n + 3 * pods if has_bias else n
        if has_bias:
            bias = x[:, n:size].reshape(rows, pods, 3) * self._bias_signs
            bias_sigma = sigma[:, n:size].reshape(rows, pods, 3)
        else:
            bias = bias_sigma = np.broadcast_to(self._no_bias, (rows, pods, 3))
        phi, theta, psi = basis.phi, basis.theta, basis.psi
        name = self._paper_name if kind == "rg" else self._name
        none_used = np.zeros(pixel.shape[1], dtype=bool)
        return [
            WingShapeEstimate(
                t_ns=t_ns[i],
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
                nis=verdicts[i].nis,
                used=verdicts[i].used if verdicts[i].used.size else none_used,
                # Amplitudes and biases; slow camera states stay inside.
                covariance=belief.P[i, :size, :size] if full[i] else None,
            )
            for i in range(rows)
        ]
