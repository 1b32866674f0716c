"""Everything that the filters are set to, in SI units and radians."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from avionics.wse.adaptive_noise import AdaptiveNoise, UpdateRules
from avionics.wse.modes import ModeBasis
from avionics.wse.process import Process
from avionics.wse.rates import ModalRates
from avionics.wse.state import RandomWalk, StateLayout

Array = NDArray[Any]

# "auto" truncation noise: a floor while the wing rests, rad/sqrt(s).
TRUNCATION_FLOOR = 5e-4
# A camera's clock against the gyros', s/sqrt(s): 1 ms in a minute and a half.
OFFSET_WALK = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class FilterSettings:
    """Everything the filters need to know, SI and radians.

    Attributes
    ----------
    rates, paper_rates : ModalRates
        Gyro kinematics in the filter's basis and in RG-WSE's.
    layout, paper_layout : StateLayout
        What the states of CRG-WSE and RG-WSE hold.
    rules : UpdateRules
        How measurements are gated and weighted.
    prior, paper_prior : ndarray
        Prior variances of the amplitudes, rad^2.
    pods_s : ndarray, shape (M,)
        Stations of the pods, m.
    psi0 : float
        Sweep at the root, rad.
    gyro_noise : float
        Noise density of the gyros, rad/s/sqrt(Hz).
    bias : RandomWalk
        Of the gyros' biases, rad/s.
    pod_period_ns, step_ns, history_ns : int
        Sample period of the pods, step of the filter, oldest frame used, ns.
    row_time : float
        Rolling shutter, s per row.
    """

    rates: ModalRates
    paper_rates: ModalRates
    layout: StateLayout
    paper_layout: StateLayout
    rules: UpdateRules
    prior: Array
    paper_prior: Array
    pods_s: Array
    psi0: float
    gyro_noise: float
    bias: RandomWalk
    pod_period_ns: int
    step_ns: int
    history_ns: int
    row_time: float

    @property
    def basis(self) -> ModeBasis:
        """The camera-aided filter's modes."""
        return self.rates.basis

    def process(self) -> Process:
        """Return the camera-aided filter's time update."""
        return Process(self.rates, self.layout, self.gyro_noise)

    def paper_process(self) -> Process:
        """Return that of RG-WSE, whose biases stay zero."""
        return Process(self.paper_rates, self.paper_layout, self.gyro_noise)

    def start_noise(self) -> AdaptiveNoise:
        """Return the adaptive noise before the first frame."""
        variance = self.rules.start_noise**2
        if len(self.pods_s):
            return AdaptiveNoise(variance)
        # Without gyros the activity is not measured: 1 rad/s instead of its start value.
        return AdaptiveNoise(variance, scale_partial=100.0)
