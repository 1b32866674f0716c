"""Everything that the filters are set to, in SI units and radians."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.adaptive_noise import Trust, UpdateRules
from avionics.wse.modes import ModeBasis
from avionics.wse.process import Process, ProcessNoise
from avionics.wse.rates import ModalRates

Array = NDArray[Any]

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
    psi0 : float
        Sweep at the root, rad.
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
    psi0: float
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
