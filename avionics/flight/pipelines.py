"""Records in, records out, for every wing of a flight: one pipeline each, one order, one log."""

from collections.abc import Sequence

from avionics.config import ByCamera, FlightConfig
from avionics.flight.health import HealthLog
from avionics.flight.outputs import OrderedOutput
from avionics.flight.pipeline import ESTIMATOR, Pipeline
from avionics.records import ROOT, MarkerPrediction, MarkerTracks
from avionics.topics import Record, Sink
from drivers.samples import ImuSample

# A jump of the arrival clock beyond this is not bridged by rows.
LONGEST_SILENCE_NS = 60_000_000_000


class Pipelines:
    """Fuses what arrives; a pure function of the calls and their arguments.

    Everything that arrives is written to the sink as it came, everything made is written at the
    tick or the arrival that made it; all once and in order, at most ``estimator.rows_at_once``
    ticks later. Rows stand on a grid of ``estimator.row_period_s`` in the clock of the arrivals,
    those of several wings in the order of the configuration, and hold what had arrived by their
    instant, extrapolated to it. A sample of the root goes to every wing, all else to its own.

    Parameters
    ----------
    config : Config or WingsConfig
        What flies.
    sink : Sink
        Takes every record: those received and those made.
    """

    def __init__(self, config: FlightConfig, sink: Sink) -> None:
        configs = config.wing_configs
        self._output = OrderedOutput(sink, at_once=config.estimator.rows_at_once)
        self._health = HealthLog(self._output)
        self._wings = [
            Pipeline(each, self._output, self._health, is_only=len(configs) == 1)
            for each in configs
        ]
        self._of_pod: dict[str, Sequence[Pipeline]] = {ROOT: self._wings}
        self._of_camera = ByCamera(config, self._wings)
        for each, pipeline in zip(configs, self._wings, strict=True):
            self._of_pod |= {name: [pipeline] for name in each.pod_names}
        self._period_ns = round(1e9 * config.estimator.row_period_s)
        self._tick_ns: int | None = None
        self._now_ns = 0

    def on_imu(self, sample: ImuSample, arrival_ns: int) -> None:
        """Take one sample of a pod or of the root."""
        self._catch_up(arrival_ns, before=True)
        self._output.write(sample, arrival_ns)
        pipelines = self._of_pod.get(sample.pod)
        if pipelines is None:
            self._health.count(f"pod {sample.pod}", "unknown")
            return
        for pipeline in pipelines:
            pipeline.on_imu(sample, arrival_ns)

    def on_tracks(self, tracks: MarkerTracks, arrival_ns: int) -> None:
        """Take the markers of one frame, as late and out of order as they come."""
        self._catch_up(arrival_ns, before=True)
        self._output.write(tracks, arrival_ns)
        pipeline = self._of_camera.get(tracks.camera)
        if pipeline is None:
            self._health.count(f"camera {tracks.camera}", "unknown")
            return
        pipeline.on_tracks(tracks, arrival_ns)

    def pass_on(self, record: Record, arrival_ns: int) -> None:
        """Write a record that no filter has use for, in its place among the others."""
        self._catch_up(arrival_ns, before=False)
        self._output.write(record, arrival_ns)

    def advance(self, arrival_ns: int) -> None:
        """Emit every row that is due up to ``arrival_ns``, that instant included."""
        self._catch_up(arrival_ns, before=False)

    def predict_markers(self, t_ns: int, camera: str = "") -> MarkerPrediction:
        """Return where markers are expected in a frame of a camera exposed at ``t_ns``.

        Raises
        ------
        ValueError
            If several wings fly and none of them has this camera.
        """
        pipeline = self._of_camera.get(camera)
        if pipeline is None:
            msg = f"camera '{camera}' belongs to no wing of the flight"
            raise ValueError(msg)
        return pipeline.predict_markers(t_ns)

    def close(self) -> None:
        """Write what is still due; may be called twice."""
        if self._tick_ns is None or self._now_ns == 0:
            return
        for pipeline in self._wings:
            pipeline.close(self._now_ns)
        self._health.write_counters(self._now_ns, is_last=True)
        self._output.flush()
        self._now_ns = 0

    def _catch_up(self, arrival_ns: int, *, before: bool) -> None:
        period = self._period_ns
        self._now_ns = max(self._now_ns, arrival_ns)
        if self._tick_ns is None:
            self._tick_ns = -(-arrival_ns // period) * period
        last = arrival_ns - 1 if before else arrival_ns
        if last - self._tick_ns > LONGEST_SILENCE_NS:
            self._restart(last)
        while self._tick_ns <= last:
            self._tick(self._tick_ns)
            self._tick_ns += period

    def _restart(self, now_ns: int) -> None:
        """Leave out the rows of a silence in which nothing at all arrived."""
        assert self._tick_ns is not None
        silent_s = (now_ns - self._tick_ns) * 1e-9
        message = f"nothing arrived for {silent_s:.0f} s; the estimators restart"
        self._health.report(ESTIMATOR, "warning", message, self._tick_ns)
        for pipeline in self._wings:
            pipeline.restart()
        self._tick_ns = now_ns // self._period_ns * self._period_ns

    def _tick(self, tick_ns: int) -> None:
        for pipeline in self._wings:
            pipeline.tick(tick_ns)
        self._health.write_counters(tick_ns)
        self._output.end_tick(tick_ns // self._period_ns)
