"""The series of a log as tables: one per topic, a column per quantity, units in the names."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from avionics.analysis.contents import TopicArrays
from avionics.analysis.frames import Frames
from avionics.analysis.series import (
    EstimateSeries,
    HealthSeries,
    ImuSeries,
    Series,
    TimeArray,
    TrackSeries,
    TruthSeries,
)
from avionics.config import Config, FlightConfig
from avionics.config.wings import config_of_camera, config_of_wing
from avionics.desk import desk_imports
from avionics.records import Event, FloatArray

if TYPE_CHECKING:
    import pandas as pd

Column: TypeAlias = NDArray[Any] | Sequence[str]
Columns: TypeAlias = dict[str, Column]
AXES = "xyz"
FAMILIES = ("phi", "theta", "psi")


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    Attributes
    ----------
    name : str
        File name without its ending.
    topic : str
        Where its records stand in the log.
    columns : dict of str to ndarray, shape (n,), or sequence of str
        By name, in order. Floating-point columns hold NaN where nothing is available.
    """

    name: str
    topic: str
    columns: Columns

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), []))

    def to_pandas(self) -> "pd.DataFrame":
        """Return the table for pandas.

        Raises
        ------
        AvionicsError
            If pandas is not installed.
        """
        with desk_imports("a table for pandas"):
            import pandas as pd  # noqa: PLC0415
        return pd.DataFrame(self.columns)


def tables_of(topics: Mapping[str, TopicArrays], config: FlightConfig) -> dict[str, Table]:
    """Return the tables of a log by their names.

    Parameters
    ----------
    topics : mapping of str to Series, Frames, HealthSeries or tuple of Event
        By topic, in order of appearance.
    config : Config or WingsConfig
        Names pods and markers.

    Returns
    -------
    dict of str to Table
        ``imu_<pod>``, ``frames``, ``tracks``, ``estimate_<kind>``, ``innovations``, ``truth``,
        ``health``, ``events``. Where several wings flew, tables of a wing or a camera carry its
        name, e.g. ``estimate_crg_left``; otherwise those of a second camera or wing do.
    """
    tables: dict[str, Table] = {}
    several = len(config.wing_configs) > 1
    for topic, arrays in topics.items():
        for base, columns in _tables(arrays, config).items():
            is_named = several and topic.startswith(("/wing/", "/camera/"))
            name = f"{base}_{topic.split('/')[2]}" if is_named or base in tables else base
            tables[name] = Table(name, topic, columns)
    return tables


def _tables(source: TopicArrays, config: FlightConfig) -> dict[str, Columns]:
    match source:
        case EstimateSeries():
            return _estimate(source, config_of_wing(config, source.wing))
        case ImuSeries():
            named = f"imu_{source.pod}", _imu(source)
        case Frames():
            named = "frames", {**_times(source), "frame": source.index}
        case TrackSeries():
            named = "tracks", _tracks(source, config_of_camera(config, source.camera))
        case TruthSeries():
            named = "truth", _truth(source, config_of_wing(config, source.wing))
        case HealthSeries():
            named = "health", _health(source)
        case _:
            named = "events", _events(source)
    return dict([named])


def _times(source: Series | Frames, *, arrival: bool = True) -> Columns:
    columns: Columns = {"t_ns": source.t_ns}
    return {**columns, "arrival_ns": source.arrival_ns} if arrival else columns


def _named(names: Iterable[str], values: FloatArray | None) -> Columns:
    """Name the columns of an array; of one that no record holds there are none."""
    if values is None:
        return {}
    return dict(zip(names, values.reshape(len(values), -1).T, strict=False))


def _imu(samples: ImuSeries) -> Columns:
    columns = {**_times(samples), "seq": samples.seq}
    for stem, unit, values in (
        ("rate", "rad_s", samples.rate_rad_s),
        ("specific_force", "m_s2", samples.specific_force_m_s2),
        ("magnetic_flux", "t", samples.magnetic_flux_t),
    ):
        columns |= _named([f"{stem}_{axis}_{unit}" for axis in AXES], values)
    return columns


def _tracks(tracks: TrackSeries, config: Config) -> Columns:
    frames, count = tracks.found.shape
    ids = _padded_ids([marker.id for marker in config.markers], count)
    return {
        "t_ns": np.repeat(tracks.t_ns, count),
        "frame": np.repeat(tracks.frame_index, count),
        "marker": np.tile(ids, frames),
        "u_px": tracks.pixel[..., 0].ravel(),
        "v_px": tracks.pixel[..., 1].ravel(),
        "sigma_px": tracks.sigma_px.ravel(),
        "found": tracks.found.ravel(),
    }


def _padded_ids(known: list[int], count: int) -> TimeArray:
    """Return ``count`` ids; a log may hold more markers than a changed configuration names."""
    free = (number for number in range(count + len(known)) if number not in known)
    return np.array([*known, *free][:count], dtype=np.int64)


def _estimate(estimates: EstimateSeries, config: Config) -> dict[str, Columns]:
    values: Columns = {}
    sigmas: Columns = {}

    def add(names: Sequence[str], value: FloatArray, sigma: FloatArray) -> None:
        values.update(_named(names, value))
        sigmas.update(_named(names, sigma))

    for family in FAMILIES:
        value: FloatArray = getattr(estimates, f"{family}_rad")
        names = [f"{family}_{number + 1}_rad" for number in range(value.shape[1])]
        add(names, value, getattr(estimates, f"{family}_sigma_rad"))
    if np.isfinite(estimates.bias_rad_s).any():
        names = [f"bias_{pod}_{axis}_rad_s" for pod in config.pod_names for axis in AXES]
        add(names, estimates.bias_rad_s, estimates.bias_sigma_rad_s)
    markers = _padded_ids([one.id for one in config.markers], estimates.marker_px.shape[1])
    names = [f"marker_{marker}_{axis}_px" for marker in markers for axis in "uv"]
    add(names, estimates.marker_px, estimates.marker_sigma_px)
    add([f"tip_{axis}_m" for axis in AXES], estimates.tip_in_body_m, estimates.tip_sigma_m)
    nothing = np.full(len(estimates.t_ns), np.nan)
    columns = {**_times(estimates, arrival=False), **values}
    columns |= {f"{name}_sigma": sigmas.get(name, nothing) for name in values}
    tables = {f"estimate_{estimates.kind}": columns}
    if estimates.kind == "filtered":
        used = [f"marker_{marker}_used" for marker in markers]
        tables["innovations"] = {
            **_times(estimates),
            "nis_per_dof": estimates.nis,
            **dict(zip(used, estimates.used.T, strict=False)),
        }
    return tables


def _truth(truth: TruthSeries, config: Config) -> Columns:
    columns = _times(truth, arrival=False)
    known = [marker.id for marker in config.truth_markers]
    ids = _padded_ids(known, truth.marker_in_body_m.shape[1])
    names = [f"marker_{marker}_{axis}_m" for marker in ids for axis in AXES]
    columns |= _named(names, truth.marker_in_body_m)
    columns |= _named([f"tip_{axis}_m" for axis in AXES], truth.tip_in_body_m)
    line = truth.line_in_body_m
    stations = range(0 if line is None else line.shape[1])
    columns |= _named([f"station_{n}_{axis}_m" for n in stations for axis in AXES], line)
    for family in FAMILIES:
        angles: FloatArray | None = getattr(truth, f"{family}_rad")
        count = 0 if angles is None else angles.shape[1]
        columns |= _named([f"station_{n}_{family}_rad" for n in range(count)], angles)
    return columns


def _health(health: HealthSeries) -> Columns:
    return {
        "t_ns": health.t_ns,
        "source": health.source,
        "counter": health.counter,
        "count": health.count,
    }


def _events(events: tuple[Event, ...]) -> Columns:
    return {
        "t_ns": np.array([event.t_ns for event in events], dtype=np.int64),
        "source": [event.source for event in events],
        "level": [event.level for event in events],
        "message": [event.message for event in events],
    }
