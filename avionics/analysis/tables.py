"""The records of a log as tables: one per topic, a column per quantity, units in the names."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config
from avionics.kinds import FILTERED
from avionics.recording import EncodedFrame, LoggedRecord
from avionics.records import Event, FloatArray, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import Frame, ImuSample

Column: TypeAlias = NDArray[Any] | list[str]
AXES = "xyz"


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    Attributes
    ----------
    name : str
        File name without its ending.
    columns : dict of str to ndarray, shape (n,), or list of str
        By name, in order. Floating point columns hold NaN where nothing is available.
    """

    name: str
    columns: dict[str, Column]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), []))


def tables_of(records: Iterable[LoggedRecord], config: Config) -> list[Table]:
    """Return the tables of a log, sorted by name.

    Parameters
    ----------
    records : iterable of LoggedRecord
        In file order; images may stay encoded.
    config : Config
        Names pods and markers.

    Returns
    -------
    list of Table
        ``imu_<pod>``, ``frames``, ``tracks``, ``estimate_<kind>``, ``innovations``, ``truth``,
        ``health``, ``events``; those of a second camera or wing carry its name.
    """
    by_topic: dict[str, list[LoggedRecord]] = {}
    for item in records:
        by_topic.setdefault(item.topic, []).append(item)
    tables: dict[str, Table] = {}
    for topic, items in by_topic.items():
        for base, columns in _TABLES[type(items[0].record)](items, config).items():
            name = f"{base}_{topic.split('/')[2]}" if base in tables else base
            tables[name] = Table(name, columns)
    return [tables[name] for name in sorted(tables)]


Columns: TypeAlias = dict[str, Column]
Items: TypeAlias = Sequence[LoggedRecord]


def _times(items: Items, *, arrival: bool = True) -> Columns:
    columns: Columns = {"t_ns": np.array([item.record.t_ns for item in items], dtype=np.int64)}
    if arrival:
        columns["arrival_ns"] = np.array([item.arrival_ns for item in items], dtype=np.int64)
    return columns


def stacked(rows: Sequence[FloatArray | None]) -> FloatArray:
    """Return the flattened rows as one array; NaN where a row is absent or shorter."""
    flat = [np.empty(0) if row is None else row.ravel() for row in rows]
    width = max((len(row) for row in flat), default=0)
    out = np.full((len(flat), width), np.nan)
    for number, row in enumerate(flat):
        out[number, : len(row)] = row
    return out


def _named(names: Sequence[str], values: FloatArray) -> Columns:
    """Name the columns of an array."""
    return dict(zip(names, values.T, strict=False))


def _imu(items: Items, _: Config) -> dict[str, Columns]:
    samples: list[ImuSample] = [item.record for item in items]  # type: ignore[misc]
    columns = _times(items)
    columns["seq"] = np.array([sample.seq for sample in samples], dtype=np.int64)
    for stem, unit, values in (
        ("rate", "rad_s", [s.rate_rad_s for s in samples]),
        ("specific_force", "m_s2", [s.specific_force_m_s2 for s in samples]),
        ("magnetic_flux", "t", [s.magnetic_flux_t for s in samples]),
    ):
        columns |= _named([f"{stem}_{axis}_{unit}" for axis in AXES], stacked(values))
    return {f"imu_{samples[0].pod}": columns}


def _frames(items: Items, _: Config) -> dict[str, Columns]:
    frames: list[Frame | EncodedFrame] = [item.record for item in items]  # type: ignore[misc]
    index = np.array([frame.index for frame in frames], dtype=np.int64)
    return {"frames": {**_times(items), "frame": index}}


def _tracks(items: Items, config: Config) -> dict[str, Columns]:
    tracks: list[MarkerTracks] = [item.record for item in items]  # type: ignore[misc]
    counts = [len(one.found) for one in tracks]
    ids = _marker_ids(config, max(counts, default=0))
    pixel = np.concatenate([one.pixel for one in tracks])
    columns: Columns = {
        "t_ns": np.repeat(np.array([one.t_ns for one in tracks], dtype=np.int64), counts),
        "frame": np.repeat(np.array([one.frame_index for one in tracks], dtype=np.int64), counts),
        "marker": np.concatenate([ids[:count] for count in counts]),
        "u_px": pixel[:, 0],
        "v_px": pixel[:, 1],
        "sigma_px": np.concatenate([one.sigma_px for one in tracks]),
        "found": np.concatenate([one.found for one in tracks]),
    }
    return {"tracks": columns}


def _marker_ids(config: Config, count: int) -> NDArray[np.int64]:
    return _padded_ids([marker.id for marker in config.markers], count)


def _padded_ids(known: list[int], count: int) -> NDArray[np.int64]:
    """Return ``count`` ids; a log may hold more markers than a changed configuration names."""
    free = (number for number in range(count + len(known)) if number not in known)
    return np.array([*known, *free][:count], dtype=np.int64)


def _estimate(items: Items, config: Config) -> dict[str, Columns]:
    estimates: list[WingShapeEstimate] = [item.record for item in items]  # type: ignore[misc]
    values: Columns = {}
    sigmas: Columns = {}

    def add(names: Sequence[str], value: str, sigma: str) -> None:
        values.update(_named(names, stacked([getattr(one, value) for one in estimates])))
        sigmas.update(_named(names, stacked([getattr(one, sigma) for one in estimates])))

    for family in ("phi", "theta", "psi"):
        count = max(getattr(one, f"{family}_rad").size for one in estimates)
        names = [f"{family}_{number + 1}_rad" for number in range(count)]
        add(names, f"{family}_rad", f"{family}_sigma_rad")
    if any(np.isfinite(one.bias_rad_s).any() for one in estimates):
        names = [f"bias_{pod}_{axis}_rad_s" for pod in config.pod_names for axis in AXES]
        add(names, "bias_rad_s", "bias_sigma_rad_s")
    markers = _marker_ids(config, max(len(one.marker_px) for one in estimates))
    names = [f"marker_{marker}_{axis}_px" for marker in markers for axis in "uv"]
    add(names, "marker_px", "marker_sigma_px")
    tip = stacked([one.line_in_body_m[-1:] for one in estimates])
    values |= _named([f"tip_{axis}_m" for axis in AXES], tip)
    tip_sigma = stacked([one.tip_sigma_m for one in estimates])
    sigmas |= _named([f"tip_{axis}_m" for axis in AXES], tip_sigma)
    nothing = np.full(len(estimates), np.nan)
    columns = {**_times(items, arrival=False), **values}
    columns |= {f"{name}_sigma": sigmas.get(name, nothing) for name in values}
    kind = estimates[0].kind
    tables = {f"estimate_{kind}": columns}
    if kind == FILTERED:
        tables["innovations"] = _innovations(items, estimates, markers)
    return tables


def _innovations(
    items: Items, estimates: list[WingShapeEstimate], markers: NDArray[np.int64]
) -> Columns:
    used = stacked([one.used.astype(np.float64) for one in estimates]) == 1.0
    return {
        **_times(items),
        "nis_per_dof": np.array([one.nis for one in estimates]),
        **{
            f"marker_{marker}_used": column for marker, column in zip(markers, used.T, strict=False)
        },
    }


def _truth(items: Items, config: Config) -> dict[str, Columns]:
    truths: list[Truth] = [item.record for item in items]  # type: ignore[misc]
    columns = _times(items, arrival=False)
    count = max(len(one.marker_in_body_m) for one in truths)
    ids = _padded_ids([marker.id for marker in config.truth_markers], count)
    names = [f"marker_{marker}_{axis}_m" for marker in ids for axis in AXES]
    columns |= _named(names, stacked([one.marker_in_body_m for one in truths]))
    lines = [one.line_in_body_m for one in truths]
    tip = stacked([None if line is None else line[-1:] for line in lines])
    columns |= _named([f"tip_{axis}_m" for axis in AXES], tip)
    line = stacked(lines)
    stations = range(line.shape[1] // 3)
    columns |= _named([f"station_{n}_{axis}_m" for n in stations for axis in AXES], line)
    for family in ("phi", "theta", "psi"):
        angles = stacked([getattr(one, f"{family}_rad") for one in truths])
        names = [f"station_{n}_{family}_rad" for n in range(angles.shape[1])]
        columns |= _named(names, angles)
    return {"truth": columns}


def _health(items: Items, _: Config) -> dict[str, Columns]:
    rows = [
        (report.t_ns, report.source, name, count)
        for report in (item.record for item in items)
        if isinstance(report, Health)
        for name, count in report.counters.items()
    ]
    columns: Columns = {
        "t_ns": np.array([row[0] for row in rows], dtype=np.int64),
        "source": [row[1] for row in rows],
        "counter": [row[2] for row in rows],
        "count": np.array([row[3] for row in rows], dtype=np.int64),
    }
    return {"health": columns}


def _events(items: Items, _: Config) -> dict[str, Columns]:
    events: list[Event] = [item.record for item in items]  # type: ignore[misc]
    columns: Columns = {
        **_times(items, arrival=False),
        "source": [event.source for event in events],
        "level": [event.level for event in events],
        "message": [event.message for event in events],
    }
    return {"events": columns}


_TABLES: dict[type, Callable[[Items, Config], dict[str, Columns]]] = {
    ImuSample: _imu,
    Frame: _frames,
    EncodedFrame: _frames,
    MarkerTracks: _tracks,
    WingShapeEstimate: _estimate,
    Truth: _truth,
    Health: _health,
    Event: _events,
}
