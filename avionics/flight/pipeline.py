"""Records in, records out: the one path of samples and tracks to estimates."""

from typing import TYPE_CHECKING

import numpy as np

from avionics.config import Config
from avionics.flight.estimate_rows import ROWS_PER_COVARIANCE, RowMaker, Seen, Tick
from avionics.flight.filter_setup import marker_model, settings_from_config, wing_gs
from avionics.flight.health import HealthLog
from avionics.flight.imu_channel import ImuChannel
from avionics.flight.outputs import BatchSink, Outbox, RowWriter
from avionics.kinds import GS
from avionics.records import MarkerPrediction, MarkerTracks
from avionics.topics import Record, Sink
from avionics.wse.adaptive_noise import NO_VERDICT, Sighting, Verdict
from avionics.wse.fusion import WingFusion
from avionics.wse.gyro_inputs import GyroInputs
from avionics.wse.hypotheses import marker_hypotheses
from drivers.samples import ImuSample

if TYPE_CHECKING:
    from avionics.pos.wing_gs import WingGs

ROOT = "root"
ESTIMATOR = "estimator"
# A jump of the arrival clock beyond this is not bridged by rows.
LONGEST_SILENCE_NS = 60_000_000_000


class Pipeline:
    """Fuses what arrives; a pure function of the calls and their arguments.

    Everything that arrives is written to the sink as it came, everything made is written at the
    tick or the arrival that made it; all in order, at most ``estimator.rows_at_once`` ticks later.
    Rows stand on a grid of ``estimator.row_period_s`` in the clock of the arrivals and hold what
    had arrived by their instant, extrapolated to it.

    Parameters
    ----------
    config : Config
        What flies.
    sink : Sink or BatchSink
        Takes every record: those received and those made.
    """

    def __init__(self, config: Config, sink: Sink | BatchSink) -> None:
        self._config = config
        self._camera = f"camera {config.camera.name}" if config.camera else "camera"
        self._offset_ns = round(1e9 * config.camera.time_offset_s) if config.camera else 0
        settings = settings_from_config(config)
        model = marker_model(config, settings.basis)
        paper_model = marker_model(config, settings.paper_rates.basis)
        self._model = model
        self._hypotheses = marker_hypotheses(model, np.diag(settings.prior))
        self._fusion = WingFusion(settings, model, paper_model)
        self._gs = wing_gs(config, settings) if "gs" in config.estimators else None
        self._rows = RowMaker(config)
        self._sink = Outbox(
            sink if isinstance(sink, BatchSink) else RowWriter(self._rows, sink),
            at_once=config.estimator.rows_at_once,
        )
        self._health = HealthLog(self._sink)
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
        self._period_ns = settings.step_ns
        self._tick_ns: int | None = None
        self._now_ns = 0
        self._waiting: list[Sighting] = []
        self._verdict = NO_VERDICT
        self._fixed_pixel_sigma = config.estimator.pixel_sigma_px

    def on_imu(self, sample: ImuSample, arrival_ns: int) -> None:
        """Take one sample of a pod or of the root."""
        self._catch_up(arrival_ns, before=True)
        self._sink.write(sample, arrival_ns)
        channel = self._channel(sample.pod)
        if channel is None:
            self._health.count(f"pod {sample.pod}", "unknown")
            return
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

    def _channel(self, name: str) -> ImuChannel | None:
        channel = self._channels.get(name)
        if channel is None and name == ROOT:
            channel = self._channels[ROOT] = ImuChannel(
                "root",
                None,
                self._config.estimator,
                is_mirrored=self._mirrored,
                health=self._health,
            )
        return channel

    def on_tracks(self, tracks: MarkerTracks, arrival_ns: int) -> None:
        """Take the markers of one frame, as late and out of order as they come."""
        self._catch_up(arrival_ns, before=True)
        self._sink.write(tracks, arrival_ns)
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
        self._sink.seen(Seen(sighting.t_ns, now_ns, belief, verdict))

    def _report(self, verdict: Verdict, now_ns: int) -> None:
        if verdict.locked_out:
            self._health.count(self._camera, "lock_outs")
            message = f"most markers rejected ({verdict.gated} of {verdict.found})"
            self._health.tell(ESTIMATOR, "warning", message, now_ns)
        if verdict.lost:
            self._health.tell(ESTIMATOR, "error", "the estimate was lost; starting anew", now_ns)
        if verdict.reacquired:
            message = f"shape found again from {int(verdict.used.sum())} markers that agree"
            self._health.tell(ESTIMATOR, "warning", message, now_ns)

    def pass_on(self, record: Record, arrival_ns: int) -> None:
        """Write a record that the filter has no use for, in its place among the others."""
        self._catch_up(arrival_ns, before=False)
        self._sink.write(record, arrival_ns)

    def advance(self, arrival_ns: int) -> None:
        """Emit every row that is due up to ``arrival_ns``, that instant included."""
        self._catch_up(arrival_ns, before=False)

    def _catch_up(self, arrival_ns: int, *, before: bool) -> None:
        period = self._period_ns
        self._now_ns = max(self._now_ns, arrival_ns)
        if self._tick_ns is None:
            self._tick_ns = -(-arrival_ns // period) * period
        last = arrival_ns - 1 if before else arrival_ns
        if last - self._tick_ns > LONGEST_SILENCE_NS:
            self._begin_anew(last)
        while self._tick_ns <= last:
            self._tick(self._tick_ns)
            self._tick_ns += period

    def _begin_anew(self, now_ns: int) -> None:
        """Leave out the rows of a silence in which nothing at all arrived."""
        assert self._tick_ns is not None
        silent_s = (now_ns - self._tick_ns) * 1e-9
        message = f"nothing arrived for {silent_s:.0f} s; starting anew"
        self._health.tell(ESTIMATOR, "warning", message, self._tick_ns)
        self._fusion.begin_anew()
        if self._gs is not None:
            self._gs.begin_anew()
        self._waiting.clear()
        self._tick_ns = now_ns // self._period_ns * self._period_ns

    def _tick(self, tick_ns: int) -> None:
        self._fusion.commit(tick_ns)
        self._fuse_waiting(tick_ns)
        outlook = self._fusion.row(tick_ns)
        number = tick_ns // self._period_ns
        full = number % ROWS_PER_COVARIANCE == 0
        self._sink.tick(Tick(tick_ns, number, outlook, self._verdict, full))
        if self._gs is not None:
            self._gs_row(self._gs, tick_ns)
        for channel in self._channels.values():
            channel.watch(tick_ns)
        self._health.account(tick_ns)

    def _gs_row(self, gs: "WingGs", tick_ns: int) -> None:
        for level, message in gs.commit(tick_ns):
            self._health.tell("gs", level, message, tick_ns)
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

    def close(self) -> None:
        """Write what is still due; may be called twice."""
        if self._tick_ns is None or self._now_ns == 0:
            return
        self._fuse_waiting(self._now_ns)
        self._health.account(self._now_ns, is_last=True)
        self._sink.flush()
        self._now_ns = 0
