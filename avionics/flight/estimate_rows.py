"""Estimates as records: amplitudes, line, marker pixels, and a one-sigma of each."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config
from avionics.flight.filter_setup import marker_model
from avionics.kinds import CRG, FILTERED, RG, EstimateKind
from avionics.records import WingShapeEstimate
from avionics.wse.forecast import Forecast, stack
from avionics.wse.fusion import WingFusion
from avionics.wse.markers import View
from avionics.wse.state import Estimate, StateLayout
from avionics.wse.update import UpdateResult

ROWS_PER_COVARIANCE = 10


class EstimateRows:
    """Makes the records of both estimators; one batched call serves many.

    Parameters
    ----------
    config : Config
        What flies.
    fusion : WingFusion
        Carries forecasts to their ticks.
    """

    def __init__(self, config: Config, fusion: WingFusion) -> None:
        settings = fusion.settings
        self._fusion = fusion
        self._layout, self._paper_layout = settings.layout, settings.paper_layout
        self._period_ns = settings.step_ns
        self._wing = config.wing.name
        self._pods = len(config.pods)
        # Model axes of a left wing are mirrored: rates but for y change sign.
        mirror = -1.0 if config.wing.side == "left" else 1.0
        self._bias_signs = np.array([mirror, 1.0, mirror])
        basis, paper = settings.basis, settings.paper_rates.basis
        self._model, self._paper_model = marker_model(config, basis), marker_model(config, paper)
        self._embed = basis.embed(paper) if basis.holds(paper) else None
        self._no_bias = np.full((self._pods, 3), np.nan)
        self._none_used = np.zeros(self._model.count, dtype=bool)

    def make(
        self, forecasts: Sequence[Forecast], results: Sequence[UpdateResult]
    ) -> tuple[list[tuple[WingShapeEstimate, WingShapeEstimate]], list[WingShapeEstimate]]:
        """Return the rows (rg, crg) of some ticks and those of some frames, in batched calls."""
        n = self._model.basis.count
        fused = stack([result.estimate for result in results]) if results else None
        if not forecasts:
            if fused is None:
                return [], []
            return [], self._filtered(results, fused, self._model.stack(fused.x[:, :n]))
        rg, crg = self._fusion.at_ticks(forecasts)
        q_rg, q = rg.x[:, : self._paper_model.basis.count], crg.x[:, :n]
        if fused is not None:
            q = np.concatenate([q, fused.x[:, :n]])
        if self._embed is None:
            views_rg, views = self._paper_model.stack(q_rg), self._model.stack(q)
        else:
            every = self._model.stack(np.concatenate([q_rg @ self._embed, q]))
            views_rg = every[: len(forecasts)].in_basis(self._embed)
            views = every[len(forecasts) :]
        t_ns = [forecast.t_ns for forecast in forecasts]
        full = [t // self._period_ns % ROWS_PER_COVARIANCE == 0 for t in t_ns]
        updates = [forecast.update for forecast in forecasts]
        count = len(forecasts)
        rows_rg = self._records(RG, rg, views_rg, t_ns=t_ns, full=full, updates=[None] * count)
        rows_crg = self._records(CRG, crg, views[:count], t_ns=t_ns, full=full, updates=updates)
        filtered = [] if fused is None else self._filtered(results, fused, views[count:])
        return list(zip(rows_rg, rows_crg, strict=True)), filtered

    def _filtered(
        self, results: Sequence[UpdateResult], fused: Estimate, views: View
    ) -> list[WingShapeEstimate]:
        t_ns = [result.t_ns for result in results]
        return self._records(
            FILTERED, fused, views, t_ns=t_ns, full=[True] * len(t_ns), updates=results
        )

    def single(self, t_ns: int, kind: EstimateKind, estimate: Estimate) -> WingShapeEstimate:
        """Return the record of an estimate of amplitudes and biases, with its covariance."""
        stacked = stack([estimate])
        views = self._model.stack(stacked.x[:, : self._model.basis.count])
        return self._records(kind, stacked, views, t_ns=[t_ns], full=[True], updates=[None])[0]

    def _records(
        self,
        kind: EstimateKind,
        estimate: Estimate,
        view: View,
        *,
        t_ns: Sequence[int],
        full: Sequence[bool],
        updates: Sequence[UpdateResult | None],
    ) -> list[WingShapeEstimate]:
        """Return the records of stacked estimates and their views.

        ``full`` tells which carry the covariance, ``updates`` on which update each rests.
        """
        layout, model = self._layout, self._model
        if kind == RG:
            layout, model = self._paper_layout, self._paper_model
        n, rows = model.basis.count, len(t_ns)
        x, covariance = estimate
        sigma = np.sqrt(covariance.diagonal(axis1=1, axis2=2))
        slopes = np.concatenate([view.pixel_by_q.reshape(rows, -1, n), view.tip_by_q], axis=1)
        variance = ((slopes @ covariance[:, :n, :n]) * slopes).sum(axis=-1)
        spread = np.sqrt(np.maximum(variance, 0.0))
        hidden = ~view.can_see
        pixel, pixel_sigma = view.pixel.copy(), spread[:, :-3].reshape(rows, -1, 2)
        pixel[hidden] = np.nan
        pixel_sigma[hidden] = np.nan
        bias, bias_sigma, logged = self._biases(kind, layout, x, sigma)
        phi, theta, psi, name = layout.phi, layout.theta, layout.psi, model.basis.name
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
                nis=float("nan") if update is None else update.nis,
                used=self._none_used if update is None else update.used,
                covariance=covariance[i, logged, logged] if full[i] else None,
            )
            for i, update in enumerate(updates)
        ]

    def _biases(
        self, kind: EstimateKind, layout: StateLayout, x: NDArray[Any], sigma: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any], slice]:
        """Return biases, their one-sigmas, and the part of the covariance that is logged."""
        shape = (len(x), self._pods, 3)
        if kind == RG or not layout.has_bias or not self._pods:
            nothing = np.broadcast_to(self._no_bias, shape)
            return nothing, nothing, layout.amplitudes
        bias = x[:, layout.bias].reshape(shape) * self._bias_signs
        return bias, sigma[:, layout.bias].reshape(shape), layout.logged
