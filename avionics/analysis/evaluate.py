"""How good the estimates of a flight are, where the log holds the truth."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from avionics.analysis.comparison import SETTLE_S, Comparison, KindScore
from avionics.analysis.flight import Flight
from avionics.analysis.frames import CameraData
from avionics.analysis.series import WingData
from avionics.config.wings import config_of_wing
from avionics.errors import RecordingError


@dataclass(slots=True)
class Evaluation:
    """How good the estimates of a log are.

    Attributes
    ----------
    truth : str
        "sim" or "mocap".
    kinds : dict of str to KindScore
        By kind of estimate.
    tracks : dict
        Markers found and lost.
    """

    truth: str
    kinds: dict[str, KindScore]
    tracks: dict[str, Any]

    def to_json_dict(self) -> dict[str, Any]:
        """Return the figures for ``json.dumps``; what is not available is null."""
        result: dict[str, Any] = {}
        for kind, score in self.kinds.items():
            result[kind] = {
                "eq17_px": score.eq17_px,
                "tip_mm": score.tip_mm,
                "nees_tip": score.nees_tip,
                "nis_per_dof": score.nis_per_dof,
                **score.more,
            }
        result["truth"] = self.truth
        result["tracks"] = self.tracks
        return result

    def table(self, about: str = "") -> Table:
        """Return the figures for a person; ``about`` stands before the title."""
        # Fits a terminal of 80 columns: units stand in a second line of the heads.
        title = (
            f"{about}against {self.truth}, after the first {SETTLE_S:.0f} s;"
            " marker error (Eq. 17), tip"
        )
        table = Table(title=title, title_justify="left", box=None, pad_edge=False)
        table.add_column("estimate")
        heads = ("median\npx", "mean\npx", "95 %\npx", "max\npx", "slope\npx/min")
        for head in (*heads, "tip\nmm", "max\nmm", "NEES\ntip", "NIS\n/dof"):
            table.add_column(head, justify="right")
        for kind, score in self.kinds.items():
            eq17 = score.eq17_px or {}
            keys = ("median", "mean", "p95", "max", "slope_per_min")
            values = [eq17.get(key) for key in keys]
            values += [score.tip_mm.get("rmse"), score.tip_mm.get("max")]
            values += [score.nees_tip, score.nis_per_dof]
            table.add_row(kind, *("-" if v is None else f"{v:.2f}" for v in values))
        return table


def evaluate(flight: Flight, wing: str | None = None) -> Evaluation:
    """Compare the estimates of one wing with its truth.

    Parameters
    ----------
    flight : Flight
        A log with estimates, and truth from the simulator or motion capture.
    wing : str, optional
        Which wing; by default the only one.

    Raises
    ------
    RecordingError
        If the log cannot be read, holds no estimates, no truth, or no instant common to both.
    """
    log = flight.path
    data = flight.wing_named(wing)
    of = f" of wing '{data.name}'" if len(flight.wings) > 1 else ""
    if not data.estimates:
        msg = (
            f"{log}: holds no estimates{of}; make them with: avionics replay {log} -o replayed.mcap"
        )
        raise RecordingError(msg)
    if data.truth is None:
        msg = f"{log}: holds no truth and no motion capture{of}; there is nothing to compare with"
        raise RecordingError(msg)
    comparison = compare(flight, data)
    if not comparison.t_ns.size:
        msg = (
            f"{log}: estimates and truth{of} have no instant in common after the first "
            f"{SETTLE_S:.0f} s, which are not scored"
        )
        raise RecordingError(msg)
    kinds = {kind: comparison.score(data.estimates[kind]) for kind in sorted(data.estimates)}
    return Evaluation(data.truth.source, kinds, _track_figures(flight.camera_of(data)))


def evaluate_wings(flight: Flight) -> dict[str, Evaluation]:
    """Compare the estimates of every wing with its truth.

    Parameters
    ----------
    flight : Flight
        A log with estimates and truth.

    Returns
    -------
    dict of str to Evaluation
        By name of the wing, in the order of the configuration.

    Raises
    ------
    RecordingError
        As ``evaluate``, for the first wing that cannot be compared.
    """
    order = [one.wing.name for one in flight.config.wing_configs]
    names = sorted(flight.wings, key=lambda name: order.index(name) if name in order else 0)
    return {name: evaluate(flight, name) for name in names}


def figures(evaluations: Mapping[str, Evaluation]) -> dict[str, Any]:
    """Return the figures of a flight for ``json.dumps``: its only wing's, or ``wings`` by name."""
    by_wing = {name: one.to_json_dict() for name, one in evaluations.items()}
    return next(iter(by_wing.values())) if len(by_wing) == 1 else {"wings": by_wing}


def compare(flight: Flight, wing: WingData, *, settle_s: float = SETTLE_S) -> Comparison:
    """Return the truth of a wing at the exposures of its camera, to score estimates against.

    Parameters
    ----------
    flight : Flight
        The log.
    wing : WingData
        One of its wings, with estimates and truth.
    settle_s : float
        Left out after the first common instant, s.
    """
    config = config_of_wing(flight.config, wing.name)
    camera = flight.camera_of(wing)
    frame_ns = np.empty(0, dtype=np.int64) if camera is None else camera.exposures_ns()
    return Comparison(config, wing, frame_ns, settle_s=settle_s)


def _track_figures(camera: CameraData | None) -> dict[str, Any]:
    if camera is None or camera.tracks is None:
        return {"frames": 0, "found": None, "lost": None}
    found = camera.tracks.found
    lost = int((found[:-1] & ~found[1:]).sum())
    return {"frames": len(found), "found": float(found.mean()), "lost": lost}
