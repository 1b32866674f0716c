"""The one path of a wing's samples and tracks to its estimates."""

from typing import TYPE_CHECKING

import numpy as np

from avionics.config import Config
from avionics.flight.estimate_rows import ROWS_PER_COVARIANCE, RowMaker, Seen, Tick
from avionics.flight.filter_setup import marker_model, settings_from_config, wing_gs
from avionics.flight.health import HealthLog, Level
from avionics.flight.imu_channel import ImuChannel
from avionics.flight.outputs import Outbox
from avionics.kinds import GS
from avionics.records import MarkerPrediction, MarkerTracks
from avionics.topics import ROOT
from avionics.wse.adaptive_noise import NO_VERDICT, Sighting, Verdict
from avionics.wse.fusion import WingFusion
from avionics.wse.gyro_inputs import GyroInputs
from avionics.wse.hypotheses import marker_hypotheses
from drivers.samples import ImuSample

if TYPE_CHECKING:
    from avionics.pos.wing_gs import WingGs

ESTIMATOR = "estimator"


class Pipeline:
    """Fuses what one wing's pods and camera deliver; ``Pipelines`` gives it records and ticks.

    Parameters
    ----------
    config : Config
        The wing, and how it is estimated.
    outbox : Outbox
        Takes what is made: rows, events.
    health : HealthLog
        Takes the counters.
    rows : RowMaker
        Makes this wing's rows.
    wing : int
        Number of the wing in the outbox.
    is_only : bool
        Whether no other wing flies; otherwise sources carry this one's name.
    """

    def __init__(
        self,
        config: Config,
        outbox: Outbox,
        health: HealthLog,
        rows: RowMaker,
        *,
        wing: int = 0,
        is_only: bool = True,
    ) -> None:
        self._config = config
        self._suffix = "" if is_only else f" {config.wing.name}"
        self._camera = f"camera {config.camera.name}" if config.camera else f"camera{self._suffix}"
        self._offset_ns = round(1e9 * config.camera.time_offset_s) if config.camera else 0
        settings = settings_from_config(config)
        model = marker_model(config, settings.basis)
        paper_model = marker_model(config, settings.paper_rates.basis)
        self._model = model
        self._hypotheses = marker_hypotheses(model, np.diag(settings.prior))
        self._fusion = WingFusion(settings, model, paper_model)
        self._gs = wing_gs(config, settings) if "gs" in config.estimators else None
        self._rows, self._wing = rows, wing
        self._sink, self._health = outbox, health
        mirrored = config.wing.side == "left"
        self._channels = {
            pod.name: ImuChannel(
                f"pod {pod.name}",
                pod,
                config.estimator,
                is_mirrored=mirrored,
                health=self._health,
            )
            for pod in config.pods
        }
        self._index = {name: i for i, name in enumerate(config.pod_names)}
        self._mirrored = mirrored
        self._health.declare(
            self._camera, "frames", "markers_found", "markers_gated", "too_old", "lock_outs"
        )
        self._waiting: list[Sighting] = []
        self._verdict = NO_VERDICT
        self._fixed_pixel_sigma = config.estimator.pixel_sigma_px

    def on_imu(self, sample: ImuSample, arrival_ns: int) -> None:
        """Take one sample of a pod of this wing, or of the root."""
        channel = self._channel(sample.pod)
        taken = channel.take(sample, arrival_ns)
        if taken is None:
            return
        t_ns, rate = taken
        if self._fusion.has_begun:
            channel.note_age(t_ns, self._fusion.known_ns, arrival_ns)
        for inputs in self._inputs():
            if sample.pod == ROOT:
                is_newer = inputs.add_root(t_ns, rate)
            else:
                is_newer = inputs.add(self._index[sample.pod], t_ns, rate)
        if not is_newer:
            self._health.count(f"pod {sample.pod}", "disordered")

    def _inputs(self) -> tuple[GyroInputs, ...]:
        """Rates go to every estimator that flies."""
        if self._gs is None:
            return (self._fusion.inputs,)
        return (self._gs.inputs, self._fusion.inputs)

    def _channel(self, name: str) -> ImuChannel:
        """Return the channel of a pod; that of the root is made when its first sample comes."""
        if name == ROOT and ROOT not in self._channels:
            self._channels[ROOT] = ImuChannel(
                f"root{self._suffix}",
                None,
                self._config.estimator,
                is_mirrored=self._mirrored,
                health=self._health,
            )
        return self._channels[name]

    def on_tracks(self, tracks: MarkerTracks, arrival_ns: int) -> None:
        """Take the markers of one frame, as late and out of order as they come."""
        found = tracks.found & np.isfinite(tracks.pixel).all(axis=1)
        self._health.count(self._camera, "frames")
        self._health.count(self._camera, "markers_found", int(found.sum()))
        sigma = np.where(found, tracks.sigma_px, np.nan)
        if self._fixed_pixel_sigma != "auto":
            sigma = np.where(found, float(self._fixed_pixel_sigma), np.nan)
        sighting = Sighting(tracks.t_ns + self._offset_ns, tracks.pixel, sigma, found)
        late = self._config.estimator.late_frames == "arrival"
        if late and self._fusion.has_begun:
            known_ns = self._fusion.known_ns
            sighting = Sighting(known_ns, sighting.pixel, sighting.sigma, sighting.found)
        self._waiting.append(sighting)
        self._fuse_waiting(arrival_ns)

    def _fuse_waiting(self, now_ns: int) -> None:
        """Fuse the sightings whose instant the gyros have reached."""
        still: list[Sighting] = []
        for sighting in self._waiting:
            fits = self._fusion.can_take(sighting.t_ns)
            if fits is None:
                self._health.count(self._camera, "too_old")
            elif not fits:
                still.append(sighting)
            else:
                self._fuse(sighting, now_ns)
        self._waiting = still

    def _fuse(self, sighting: Sighting, now_ns: int) -> None:
        belief, verdict = self._fusion.take(sighting)
        self._health.count(self._camera, "markers_gated", verdict.gated)
        self._report(verdict, now_ns)
        if verdict.used.any():
            self._verdict = verdict
        self._sink.seen(Seen(sighting.t_ns, now_ns, belief, verdict), self._wing)

    def _report(self, verdict: Verdict, now_ns: int) -> None:
        if verdict.locked_out:
            self._health.count(self._camera, "lock_outs")
            message = f"most markers rejected ({verdict.gated} of {verdict.found})"
            self._tell("warning", message, now_ns)
        if verdict.lost:
            self._tell("error", "the estimate was lost; starting anew", now_ns)
        if verdict.reacquired:
            message = f"shape found again from {int(verdict.used.sum())} markers that agree"
            self._tell("warning", message, now_ns)

    def _tell(self, level: Level, message: str, now_ns: int) -> None:
        self._health.tell(f"{ESTIMATOR}{self._suffix}", level, message, now_ns)

    def restart(self) -> None:
        """Forget everything: the next samples are a new start."""
        self._fusion.begin_anew()
        if self._gs is not None:
            self._gs.begin_anew()
        self._waiting.clear()

    def tick(self, tick_ns: int, number: int) -> None:
        """Make the row that is due at an instant of the grid, the ``number``-th since zero."""
        self._fusion.commit(tick_ns)
        self._fuse_waiting(tick_ns)
        outlook = self._fusion.row(tick_ns)
        full = number % ROWS_PER_COVARIANCE == 0
        self._sink.tick(Tick(tick_ns, number, outlook, self._verdict, full), self._wing)
        if self._gs is not None:
            self._gs_row(self._gs, tick_ns)
        for channel in self._channels.values():
            channel.watch(tick_ns)

    def _gs_row(self, gs: "WingGs", tick_ns: int) -> None:
        for level, message in gs.commit(tick_ns):
            self._health.tell(f"gs{self._suffix}", level, message, tick_ns)
        belief = gs.row(tick_ns)
        if belief is None:
            return
        self._sink.write(self._rows.single(tick_ns, GS, belief), tick_ns)

    def predict_markers(self, t_ns: int) -> MarkerPrediction:
        """Return where the markers are expected in a frame exposed at ``t_ns``.

        From the history where the gyros are known, extrapolated ahead of them, and from the
        start shape with its wide uncertainty before anything is known.
        """
        belief = self._fusion.camera_aided(t_ns + self._offset_ns)
        n = self._model.basis.count
        view = self._model.view(belief.x[:n])
        slopes = view.pixel_by_q
        covariance = slopes @ belief.P[:n, :n] @ slopes.swapaxes(1, 2)
        pixel = view.pixel.copy()
        pixel[~view.can_see] = np.nan
        covariance[~view.can_see] = np.nan
        return MarkerPrediction(t_ns, pixel, covariance, self._hypotheses)

    def close(self, now_ns: int) -> None:
        """Fuse what still waits."""
        self._fuse_waiting(now_ns)
