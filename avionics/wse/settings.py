"""The filter's settings in SI units, resolved from the configuration; what "auto" means."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.config import Config, stations
from avionics.wse.adaptive_noise import Trust, UpdateRules
from avionics.wse.modes import ModeBasis, choose_basis, paper_basis
from avionics.wse.process import Process, ProcessNoise
from avionics.wse.rates import ModalRates

Array = NDArray[Any]

# Static loads bend mostly in the first mode; amplitudes fall off about so with the mode number.
PRIOR_DECAY = 1.0
# A wing is stiff in its own plane: a fifth of the angles that it reaches out of it.
INPLANE_PRIOR = 0.2
# "auto" truncation noise: a floor while the wing rests, rad/sqrt(s), and the time over which
# motion that the pods do not see stays alike, s.
TRUNCATION_FLOOR = 5e-4
UNSEEN_S = 0.1
# A camera's clock against the gyros', s/sqrt(s): 1 ms in a minute and a half.
OFFSET_WALK = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class FilterSettings:
    """Everything the filters need to know, SI and radians.

    Attributes
    ----------
    rates, paper_rates : ModalRates
        Gyro kinematics in the filter's basis and in RG-WSE's.
    noise, paper_noise : ProcessNoise
        Densities.
    rules : UpdateRules
        How measurements are believed.
    prior, paper_prior : ndarray
        Prior variances of the amplitudes, rad^2.
    pods_s : ndarray, shape (M,)
        Stations of the pods, m.
    pod_period_ns, step_ns, history_ns : int
        Sample period of the pods, step of the filter, oldest frame taken, ns.
    has_bias, has_unseen, has_offset : bool
        Whether gyro biases, unseen rates and the camera's time offset are states.
    bias_sigma, offset_sigma : float
        Their initial one-sigmas, rad/s and s.
    row_time : float
        Rolling shutter, s per row.
    """

    rates: ModalRates
    paper_rates: ModalRates
    noise: ProcessNoise
    paper_noise: ProcessNoise
    rules: UpdateRules
    prior: Array
    paper_prior: Array
    pods_s: Array
    pod_period_ns: int
    step_ns: int
    history_ns: int
    has_bias: bool
    has_unseen: bool
    has_offset: bool
    bias_sigma: float
    offset_sigma: float
    row_time: float

    @property
    def basis(self) -> ModeBasis:
        """The camera-aided filter's modes."""
        return self.rates.basis

    def process(self) -> Process:
        """Return the camera-aided filter's time update."""
        return Process(
            self.rates,
            self.noise,
            has_bias=self.has_bias,
            has_unseen=self.has_unseen,
            has_offset=self.has_offset,
        )

    def paper_process(self) -> Process:
        """Return that of RG-WSE, whose biases stay zero."""
        return Process(self.paper_rates, self.paper_noise, has_bias=True)

    def start_P(self, process: Process) -> Array:
        """Return the covariance before anything is known."""
        n = len(self.prior)
        variance = np.zeros(process.size)
        variance[:n] = self.prior
        variance[process.bias] = self.bias_sigma**2
        if process.offset is not None:
            variance[process.offset] = self.offset_sigma**2
        return np.diag(variance)

    def start_trust(self) -> Trust:
        """Return what the updates believe before the first frame."""
        noise = self.rules.start_noise**2
        # Without gyros the activity is not measured: 1 rad/s instead of its start value.
        return Trust(noise) if len(self.pods_s) else Trust(noise, surprise_apart=100.0)

    def paper_start_P(self, size: int) -> Array:
        """Return the covariance of RG-WSE's start; the biases are never estimated."""
        variance = np.full(size, self.bias_sigma**2)
        variance[: len(self.paper_prior)] = self.paper_prior
        return np.diag(variance)


def prior_variance(basis: ModeBasis, sigma: float) -> Array:
    """Return the prior variances of the amplitudes, rad^2, shape (count,)."""
    falloff = (2.0 * basis.order - 1.0) ** -PRIOR_DECAY
    scale = np.ones(basis.count)
    scale[basis.psi] = INPLANE_PRIOR
    if basis.family == "linear":
        # Amplitude times slope times span is the tip angle.
        scale = scale / (basis.linear_slope_per_m * basis.span_m)
    variance: Array = (sigma * falloff * scale) ** 2
    return variance


def settings_from_config(config: Config) -> FilterSettings:
    """Return the settings that a configuration describes."""
    e = config.estimator
    general = e.form == "general"
    basis, paper = choose_basis(config), paper_basis(config)
    sigma = math.radians(e.start_sigma_deg)
    prior, paper_prior = prior_variance(basis, sigma), prior_variance(paper, sigma)
    s = stations(config.pods)
    psi0 = config.wing.psi0_rad
    gyro = math.radians(e.gyro_noise_dps_sqrthz)
    has_unseen = general and e.truncation_rad_sqrts == "auto"
    truncation = TRUNCATION_FLOOR if has_unseen else 0.0
    if e.truncation_rad_sqrts != "auto":
        truncation = float(e.truncation_rad_sqrts)
    noise = ProcessNoise(gyro, truncation, e.bias_walk_rad_s_sqrts, UNSEEN_S, OFFSET_WALK)
    rate_hz = min((pod.chip.rate_hz for pod in config.pods), default=100.0)
    return FilterSettings(
        rates=ModalRates(basis, s, prior, psi0=psi0),
        paper_rates=ModalRates(paper, s, paper_prior, psi0=psi0),
        noise=noise,
        paper_noise=ProcessNoise(gyro, 0.0, 0.0),
        rules=UpdateRules(
            gate=e.gate_sigma,
            adapt=general,
            start_noise=1.0 if general else 8.0,
        ),
        prior=prior,
        paper_prior=paper_prior,
        pods_s=s,
        pod_period_ns=round(1e9 / rate_hz),
        step_ns=round(1e9 * e.row_period_s),
        history_ns=round(1e9 * e.history_s),
        has_bias=general if e.bias_states == "auto" else bool(e.bias_states),
        has_unseen=has_unseen,
        has_offset=_has_offset(config),
        bias_sigma=math.radians(e.bias_sigma_dps),
        offset_sigma=e.time_offset_sigma_s,
        row_time=config.camera.row_time_s if config.camera else 0.0,
    )


def _has_offset(config: Config) -> bool:
    """Return whether the camera's time offset is a state.

    One pod leaves rates unseen that look like an offset; it takes two to tell them apart.
    """
    wanted = config.estimator.time_offset
    if wanted == "auto":
        return config.estimator.form == "general" and len(config.pods) > 1
    return bool(wanted)
