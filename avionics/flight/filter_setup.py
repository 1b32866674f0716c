"""From configuration to mathematics: bases, camera, marker models and settings of the filters.

The only way from one to the other: ``wse`` and ``pos`` take plain numbers and know no
configuration.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from avionics.config import Camera, Config, Marker, stations
from avionics.kinds import GS, EstimateKind
from avionics.wse.adaptive_noise import UpdateRules
from avionics.wse.attitude import camera_attitude
from avionics.wse.markers import MarkerModel
from avionics.wse.modes import ModeBasis, basis_from_name, observable_modes, prior_variance
from avionics.wse.pinhole import Lens, Pinhole
from avionics.wse.rates import ModalRates
from avionics.wse.settings import OFFSET_WALK, TRUNCATION_FLOOR, FilterSettings
from avionics.wse.state import RandomWalk, StateLayout

if TYPE_CHECKING:
    from avionics.pos.wing_gs import WingGs
    from avionics.wse.gyro_estimator import GyroEstimator


def pinhole_from_config(camera: Camera) -> Pinhole:
    """Return the camera that a configuration describes."""
    lens = Lens(
        camera.f_x_px,
        camera.f_y_px,
        camera.c_x_px,
        camera.c_y_px,
        camera.k1,
        camera.k2,
        camera.p1,
        camera.p2,
        camera.k3,
    )
    roll, tilt, pan = np.radians([camera.roll_deg, camera.tilt_deg, camera.pan_deg])
    attitude = camera_attitude(roll, tilt, pan)
    position = np.array(camera.r_in_body_m, dtype=np.float64)
    return Pinhole(lens, attitude, position, camera.width_px, camera.height_px, lens.fold_radius())


def paper_basis(config: Config) -> ModeBasis:
    """Return one bending and one twist mode, as Srikanth et al. fly them."""
    return _basis(config, 1, 1, 0)


def choose_basis(config: Config) -> ModeBasis:
    """Return the basis of the camera-aided filter: the numbers given, ``observable_modes`` else."""
    estimator = config.estimator
    auto = (1, 1, 0)
    if estimator.form == "general":
        pods_s, markers_s = stations(config.pods), stations(config.markers)
        auto = observable_modes(pods_s, markers_s, config.wing.span_m)
    given = (estimator.bending_modes, estimator.twist_modes, estimator.inplane_modes)
    bending, twist, inplane = (
        a if g == "auto" else int(g) for g, a in zip(given, auto, strict=True)
    )
    return _basis(config, bending, twist, inplane)


def _basis(config: Config, bending: int, twist: int, inplane: int) -> ModeBasis:
    estimator = config.estimator
    return ModeBasis(
        estimator.basis,
        config.wing.span_m,
        bending,
        twist,
        inplane,
        estimator.linear_slope_per_m,
    )


def recorded_basis(config: Config, name: str) -> ModeBasis:
    """Return the basis that a record of this configuration names.

    Raises
    ------
    ValueError
        If the name is none of ours.
    """
    return basis_from_name(name, config.wing.span_m, config.estimator.linear_slope_per_m)


def marker_model(
    config: Config, basis: ModeBasis, *, markers: Sequence[Marker] | None = None
) -> MarkerModel:
    """Return the marker model of a configuration in a basis.

    Parameters
    ----------
    config : Config
        Wing and camera.
    basis : ModeBasis
        Mode shapes.
    markers : sequence of Marker, optional
        Other points than the configuration's markers.
    """
    placed = config.markers if markers is None else markers
    return MarkerModel(
        basis,
        np.array([(m.s_m, m.x_m, m.z_m) for m in placed], dtype=np.float64).reshape(-1, 3),
        pinhole_from_config(config.camera) if config.camera else None,
        psi0=config.wing.psi0_rad,
        is_left=config.wing.side == "left",
    )


def settings_from_config(config: Config) -> FilterSettings:
    """Return the settings that a configuration describes, every "auto" resolved."""
    e = config.estimator
    general = e.form == "general"
    basis, paper = choose_basis(config), paper_basis(config)
    sigma = math.radians(e.start_sigma_deg)
    prior, paper_prior = prior_variance(basis, sigma), prior_variance(paper, sigma)
    s = stations(config.pods)
    psi0 = config.wing.psi0_rad
    has_unobserved = general and e.truncation_rad_sqrts == "auto"
    truncation = TRUNCATION_FLOOR if has_unobserved else 0.0
    if e.truncation_rad_sqrts != "auto":
        truncation = float(e.truncation_rad_sqrts)
    bias = RandomWalk(math.radians(e.bias_sigma_dps), e.bias_walk_rad_s_sqrts)
    has_bias = general if e.bias_states == "auto" else bool(e.bias_states)
    layout = StateLayout(
        basis,
        config.pod_names,
        prior=prior,
        truncation=truncation,
        bias=bias if has_bias else None,
        has_unobserved=has_unobserved,
        offset=RandomWalk(e.time_offset_sigma_s, OFFSET_WALK) if _has_offset(config) else None,
    )
    camera = config.camera
    rate_hz = min((pod.chip.rate_hz for pod in config.pods), default=100.0)
    return FilterSettings(
        rates=ModalRates(basis, s, prior, psi0=psi0),
        paper_rates=ModalRates(paper, s, paper_prior, psi0=psi0),
        layout=layout,
        paper_layout=StateLayout(
            paper, config.pod_names, prior=paper_prior, bias=RandomWalk(bias.sigma)
        ),
        rules=UpdateRules(
            gate=e.gate_sigma,
            adapt=general,
            start_noise=1.0 if general else 8.0,
            # To the millisecond, which is exact enough for the size of a noise.
            frame_s=round(1.0 / (camera.fps if camera else 30.0), 3),
        ),
        prior=prior,
        paper_prior=paper_prior,
        pods_s=s,
        psi0=psi0,
        gyro_noise=math.radians(e.gyro_noise_dps_sqrthz),
        bias=bias,
        pod_period_ns=round(1e9 / rate_hz),
        step_ns=round(1e9 * e.row_period_s),
        history_ns=round(1e9 * e.history_s),
        row_time=camera.row_time_s if camera else 0.0,
    )


def _has_offset(config: Config) -> bool:
    """Return whether the camera's time offset is a state.

    One pod leaves rates unobserved that look like an offset; it takes two to tell them apart.
    """
    wanted = config.estimator.time_offset
    if wanted == "auto":
        return config.estimator.form == "general" and len(config.pods) > 1
    return bool(wanted)


def gyro_estimators(
    config: Config, settings: FilterSettings
) -> "dict[EstimateKind, GyroEstimator]":
    """Return the estimators that fly beside the camera-aided filter, by the kind of their rows."""
    found: dict[EstimateKind, GyroEstimator] = {}
    if GS in config.estimators:
        found[GS] = wing_gs(config, settings)
    return found


def wing_gs(config: Config, settings: FilterSettings) -> "WingGs":
    """Return the distributed POS of a configuration."""
    # Its compiler is slow to load, and few flights want it.
    from avionics.pos.flexure import markov_flexure  # noqa: PLC0415
    from avionics.pos.wing_gs import WingGs  # noqa: PLC0415

    law = config.gs
    flexure = markov_flexure(
        np.array(law.correlation_s), np.deg2rad(np.array(law.flexure_sigma_deg))
    )
    return WingGs(settings, flexure, math.radians(law.misalignment_sigma_deg))
