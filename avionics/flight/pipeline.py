"""The one path of a wing's samples and tracks to its estimates."""

import numpy as np

from avionics.config import Config, RootImu
from avionics.flight.estimate_rows import EstimateRows
from avionics.flight.filter_setup import gyro_estimators, marker_model, settings_from_config
from avionics.flight.health import HealthLog, Level
from avionics.flight.imu_channel import ImuChannel
from avionics.flight.outputs import OrderedOutput
from avionics.records import ROOT, MarkerPrediction, MarkerTracks
from avionics.wse.fusion import WingFusion
from avionics.wse.gyro_rates import GyroInputs
from avionics.wse.hypotheses import marker_hypotheses
from avionics.wse.update import MarkerMeasurement, UpdateResult
from drivers.samples import ImuSample

ESTIMATOR = "estimator"


class Pipeline:
    """Fuses what one wing's pods and camera deliver; ``Pipelines`` gives it records and ticks.

    Parameters
    ----------
    config : Config
        The wing, and how it is estimated.
    output : OrderedOutput
        Takes what is made: rows, events.
    health : HealthLog
        Takes the counters.
    is_only : bool
        Whether no other wing flies; otherwise sources carry this one's name.
    """

    def __init__(
        self,
        config: Config,
        output: OrderedOutput,
        health: HealthLog,
        *,
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
        self._beside = gyro_estimators(config, settings)
        self._rows = EstimateRows(config, self._fusion)
        self._output, self._health = output, health
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
        self._waiting: list[MarkerMeasurement] = []
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
        return (*(estimator.inputs for estimator in self._beside.values()), self._fusion.inputs)

    def _channel(self, name: str) -> ImuChannel:
        """Return the channel of a pod; that of the root is made when its first sample comes."""
        if name == ROOT and ROOT not in self._channels:
            self._channels[ROOT] = ImuChannel(
                f"root{self._suffix}",
                self._config.root or RootImu(),
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
        t_ns = tracks.t_ns + self._offset_ns
        if self._config.estimator.late_frames == "arrival" and self._fusion.has_begun:
            t_ns = self._fusion.known_ns
        self._waiting.append(MarkerMeasurement(t_ns, tracks.pixel, sigma, found))
        self._fuse_waiting(arrival_ns)

    def _fuse_waiting(self, now_ns: int) -> None:
        """Fuse the measurements whose instant the gyros have reached."""
        waiting: list[MarkerMeasurement] = []
        for measurement in self._waiting:
            usable = self._fusion.can_use(measurement.t_ns)
            if usable is None:
                self._health.count(self._camera, "too_old")
            elif not usable:
                waiting.append(measurement)
            else:
                result = self._fusion.update(measurement)
                self._health.count(self._camera, "markers_gated", result.gated)
                self._report(result, now_ns)
                self._output.write_update(self._rows, result, now_ns)
        self._waiting = waiting

    def _report(self, result: UpdateResult, now_ns: int) -> None:
        if result.locked_out:
            self._health.count(self._camera, "lock_outs")
            message = f"most markers rejected ({result.gated} of {result.found})"
            self._report_event("warning", message, now_ns)
        if result.lost:
            self._report_event("error", "the estimate was lost; restarted", now_ns)
        if result.reacquired:
            message = f"shape acquired again from {int(result.used.sum())} markers that agree"
            self._report_event("warning", message, now_ns)

    def _report_event(self, level: Level, message: str, now_ns: int) -> None:
        self._health.report(f"{ESTIMATOR}{self._suffix}", level, message, now_ns)

    def restart(self) -> None:
        """Forget the past: the next samples are a new start."""
        self._fusion.restart()
        for estimator in self._beside.values():
            estimator.restart()
        self._waiting.clear()

    def tick(self, tick_ns: int) -> None:
        """Make the rows that are due at an instant of the grid."""
        self._fusion.advance(tick_ns)
        self._fuse_waiting(tick_ns)
        self._output.write_tick(self._rows, self._fusion.forecast(tick_ns))
        for kind, estimator in self._beside.items():
            for level, message in estimator.advance(tick_ns):
                self._health.report(f"{kind}{self._suffix}", level, message, tick_ns)
            estimate = estimator.estimate_at(tick_ns)
            if estimate is not None:
                self._output.write(self._rows.single(tick_ns, kind, estimate), tick_ns)
        for channel in self._channels.values():
            channel.watch(tick_ns)

    def predict_markers(self, t_ns: int) -> MarkerPrediction:
        """Return where the markers are expected in a frame exposed at ``t_ns``.

        From the history where the gyros are known, extrapolated ahead of them, and from the
        start shape with its wide uncertainty before anything is known.
        """
        estimate = self._fusion.estimate_at(t_ns + self._offset_ns)
        q = self._fusion.settings.layout.amplitudes
        view = self._model.view(estimate.x[q])
        slopes = view.pixel_by_q
        covariance = slopes @ estimate.P[q, q] @ slopes.swapaxes(1, 2)
        pixel = view.pixel.copy()
        pixel[~view.can_see] = np.nan
        covariance[~view.can_see] = np.nan
        return MarkerPrediction(t_ns, pixel, covariance, self._hypotheses)

    def close(self, now_ns: int) -> None:
        """Fuse what still waits."""
        self._fuse_waiting(now_ns)
