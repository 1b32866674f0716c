"""From records to series: what is kept of each record while a log is read, and what becomes of it.

A collector takes the records of one topic one by one and holds on to none of them.
"""

from collections.abc import Callable
from math import isqrt
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from avionics.analysis.columns import Column, Numbers, Rows, SparseRows
from avionics.analysis.series import (
    Covariances,
    EstimateSeries,
    HealthSeries,
    ImuSeries,
    Series,
    TimeArray,
    TrackSeries,
    TruthSeries,
    seconds,
)
from avionics.records import FloatArray, Health, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import ImuSample


class Kept(NamedTuple):
    """What is kept of one kind of record.

    Attributes
    ----------
    series : type
        What it becomes.
    texts : tuple of str
        Attributes that are the same in every record of a topic.
    columns : callable
        Returns empty columns by attribute.
    """

    series: Callable[..., Series]
    texts: tuple[str, ...]
    columns: Callable[[], dict[str, Column]]


def _imu() -> dict[str, Column]:
    return {
        "seq": Numbers(np.int64),
        "rate_rad_s": Rows(),
        "specific_force_m_s2": Rows(is_optional=True),
        "magnetic_flux_t": Rows(is_optional=True),
    }


def _tracks() -> dict[str, Column]:
    return {
        "frame_index": Numbers(np.int64),
        "pixel": Rows(2),
        "sigma_px": Rows(),
        "found": Rows(dtype=np.bool_),
    }


def _estimates() -> dict[str, Column]:
    families = ("phi", "theta", "psi")
    return {
        **{f"{family}_rad": Rows() for family in families},
        **{f"{family}_sigma_rad": Rows() for family in families},
        "bias_rad_s": Rows(3),
        "bias_sigma_rad_s": Rows(3),
        "line_in_body_m": Rows(3),
        "tip_sigma_m": Rows(),
        "marker_px": Rows(2),
        "marker_sigma_px": Rows(2),
        "nis": Numbers(np.float64),
        "used": Rows(dtype=np.bool_),
        "covariance": SparseRows(),
    }


def _truths() -> dict[str, Column]:
    angles = ("phi_rad", "theta_rad", "psi_rad")
    return {
        "marker_in_body_m": Rows(3),
        "line_in_body_m": Rows(3, is_optional=True),
        **{name: Rows(is_optional=True) for name in angles},
    }


KEPT: dict[type, Kept] = {
    ImuSample: Kept(ImuSeries, ("pod",), _imu),
    MarkerTracks: Kept(TrackSeries, ("camera", "tracker"), _tracks),
    WingShapeEstimate: Kept(EstimateSeries, ("wing", "kind", "basis"), _estimates),
    Truth: Kept(TruthSeries, ("wing", "source"), _truths),
}
"""By record. Events, health and pictures have their own way; others are only counted."""


class SeriesCollector:
    """Takes the records of a topic that becomes a series.

    Parameters
    ----------
    topic : str
        The topic.
    record : object
        Its first record, not taken yet.

    Attributes
    ----------
    record : type
        Class of its records.
    """

    def __init__(self, topic: str, record: Any) -> None:
        self.record = type(record)
        kept = KEPT[self.record]
        self._topic, self._series = topic, kept.series
        self._texts = {name: getattr(record, name) for name in kept.texts}
        self._t_ns, self._arrival_ns = Numbers(np.int64), Numbers(np.int64)
        self._columns = {"t_ns": self._t_ns, **kept.columns()}
        self._values: Callable[[Any], tuple[Any, ...]] = attrgetter(*self._columns)
        self._appends = [column.append for column in self._columns.values()]

    def take(self, record: Any, arrival_ns: int) -> None:
        """Take one record that arrived at ``arrival_ns``."""
        for append, value in zip(self._appends, self._values(record), strict=True):
            append(value)
        self._arrival_ns.append(arrival_ns)

    def times(self) -> TimeArray:
        """Return the ``t_ns`` of the records; none can be taken after that."""
        return self._t_ns.frozen()

    def series(self, start_ns: int) -> Series:
        """Return the series; ``start_ns`` is the start of the flight."""
        values: dict[str, Any] = {name: column.frozen() for name, column in self._columns.items()}
        t_ns = self.times()
        if "covariance" in values:
            values["covariance"] = _covariances(t_ns, *values["covariance"])
        return self._series(
            topic=self._topic,
            arrival_ns=self._arrival_ns.frozen(),
            t_s=seconds(t_ns, start_ns),
            **self._texts,
            **values,
        )


def _covariances(t_ns: TimeArray, rows: TimeArray, packed: FloatArray) -> Covariances | None:
    if not rows.size:
        return None
    size = isqrt(packed.shape[1])
    return Covariances(t_ns[rows], packed.reshape(-1, size, size))


class HealthCollector:
    """Takes the reports of all sources."""

    def __init__(self) -> None:
        self._t_ns, self._arrival_ns, self._count = (Numbers(np.int64) for _ in range(3))
        self._sources: list[str] = []
        self._counters: list[str] = []
        self._last: dict[str, dict[str, int]] = {}
        self._known: dict[str, str] = {}

    def take(self, report: Health, arrival_ns: int) -> None:
        """Take one report that arrived at ``arrival_ns``."""
        # A name is kept once however often it comes.
        source = self._known.setdefault(report.source, report.source)
        self._last[source] = report.counters
        for name, count in report.counters.items():
            self._t_ns.append(report.t_ns)
            self._arrival_ns.append(arrival_ns)
            self._sources.append(source)
            self._counters.append(self._known.setdefault(name, name))
            self._count.append(count)

    def series(self) -> HealthSeries:
        """Return the reports; none can be taken after that."""
        return HealthSeries(
            self._t_ns.frozen(),
            self._arrival_ns.frozen(),
            tuple(self._sources),
            tuple(self._counters),
            self._count.frozen(),
            self._last,
        )
