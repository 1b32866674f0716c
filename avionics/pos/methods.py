"""One name and one call for every method, filter options included."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from avionics.pos.compiled import Array
from avionics.pos.difference_filter import DifferenceOptions, difference_filter
from avionics.pos.estimate import Estimates
from avionics.pos.flexure import Flexure
from avionics.pos.imu_filter import ImuOptions, imu_filter
from avionics.pos.motion import Start
from avionics.pos.simulate import Measured, Node, Sampling, slave_truth
from avionics.pos.trajectory import Trajectory
from avionics.pos.wing_filter import wing_filter

Kind = Literal["imu", "gs", "as", "ga", "wing"]


@dataclass(frozen=True, slots=True)
class Method:
    """A method and its options.

    Attributes
    ----------
    kind : {"imu", "gs", "as", "ga", "wing"}
        Gong et al.'s three, gyros and accelerometers together, Guo and Zhu's.
    nonlinear, sampling, rho_sigma
        Every kind, see ``ImuOptions`` and ``DifferenceOptions``.
    every, arm_rate, sampling_noise
        Kinds "imu" and "wing", see ``ImuOptions``.
    arm_in_H, arm_model
        Kinds "as" and "ga", see ``DifferenceOptions``.
    damping : float or None
        Damping that the filter ascribes to the flexure; None takes the node's. 1.0 makes a
        Markov process of a wing mode.
    """

    kind: Kind
    nonlinear: bool = True
    sampling: Sampling = "integrating"
    rho_sigma: float = float(np.deg2rad(0.5))
    every: int = 1
    arm_rate: bool = True
    sampling_noise: float = 0.0
    arm_in_H: bool = True
    arm_model: bool = False
    damping: float | None = None


def estimate(
    method: Method,
    measured: Measured,
    node: Node,
    trajectory: Trajectory,
    *,
    stride: int = 5,
    smooth: bool = False,
) -> Estimates:
    """Run a method over a whole recording.

    Parameters
    ----------
    method : Method
        Which, and how.
    measured : Measured
        N + 1 instants.
    node : Node
        What the filter knows of the node.
    trajectory : Trajectory
        The carrier's; only its step, its start and, for "wing", its height channel are read.
    stride, smooth
        See ``difference_filter``.
    """
    if method.damping is not None:
        law = node.flexure
        damping = np.full_like(law.damping, method.damping)
        node = replace(node, flexure=Flexure(law.frequency, damping, law.sigma))
    if method.kind in ("imu", "wing"):
        options = ImuOptions(
            nonlinear=method.nonlinear,
            sampling=method.sampling,
            every=method.every,
            arm_rate=method.arm_rate,
            sampling_noise=method.sampling_noise,
            rho_sigma=method.rho_sigma,
        )
        if method.kind == "wing":
            return wing_filter(measured, node, trajectory, options, stride=stride, smooth=smooth)
        start = Start(
            float(trajectory.latitude[0]), float(trajectory.longitude[0]),
            float(trajectory.height[0]), float(trajectory.euler[0, 0]), 0.0,
        )  # fmt: skip
        return imu_filter(
            measured, node, start, trajectory.dt, options, stride=stride, smooth=smooth
        )
    difference = DifferenceOptions(
        gyros=method.kind in ("gs", "ga"),
        forces=method.kind in ("as", "ga"),
        nonlinear=method.nonlinear,
        sampling=method.sampling,
        arm_in_H=method.arm_in_H,
        arm_model=method.arm_model,
        rho_sigma=method.rho_sigma,
    )
    return difference_filter(
        measured, node, trajectory.dt, difference, stride=stride, smooth=smooth
    )


def covariance_analysis(
    method: Method, node: Node, trajectory: Trajectory, *, stride: int = 5
) -> Estimates:
    """Return what a method and its smoother can reach, without a single random draw.

    The filter runs over error-free sensors on a node without misalignment or flexure; its
    covariance, which is all that matters of the result, is that of the assumed grades.

    Parameters
    ----------
    method, node, trajectory
        As for ``estimate``.
    stride : int
        See ``difference_filter``.
    """
    zero = np.zeros((len(trajectory.t), 3))
    still = replace(node, rho=np.zeros(3))
    truth, rate_m, force_m = slave_truth(trajectory, still, zero, zero, _no_bias())
    measured = Measured(
        euler=trajectory.euler,
        velocity=trajectory.velocity,
        rate_m=rate_m,
        rate_s=truth.rate,
        force_m=force_m,
        force_s=truth.force,
    )
    return estimate(method, measured, node, trajectory, stride=stride, smooth=True)


def _no_bias() -> dict[str, Array]:
    return {name: np.zeros(3) for name in ("rate_m", "rate_s", "force_m", "force_s")}
