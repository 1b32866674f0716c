"""The mathematics alone: from modal amplitudes to the wing's shape, and from a shape to gyro rates.

``avionics/wse/`` needs no log, no configuration and no hardware; docs/method.md has the equations.

    .venv/bin/python examples/shape_of_angles.py
"""

import numpy as np

from avionics.wse.geometry import WingGeometry
from avionics.wse.jacobian import complex_step
from avionics.wse.kinematics import body_rates, euler_rate_matrix
from avionics.wse.modes import ModeBasis

SPAN_M = 1.5


def main() -> np.ndarray:
    """Bend a wing by 0.3 rad tip up, twist it by 0.1 rad nose up, and look at its tip."""
    basis = ModeBasis("quarter-sine", SPAN_M, bending=2, twist=1, inplane=0)
    wing = WingGeometry(basis, np.array([0.6, 1.2, SPAN_M]))
    q = np.array([-0.3, 0.0, 0.1])  # tip down is positive
    shape = wing.at(q)
    tip = shape.r_in_body[-1]
    print(f"basis {basis.name}: tip at {tip.round(4)} m in body axes (x forward, y right, z down)")

    _, tip_by_q = complex_step(lambda x: wing.at(x).line[..., -1], q)
    print("derivatives of the tip by the amplitudes, m/rad:")
    print(tip_by_q.round(4))

    # The wing passes this shape while it bends at 2 rad/s at the tip: what do gyros there measure?
    angle_rates = np.array([2.0, 0.1, 0.0]) * np.ones((3, 1))
    rates = body_rates(shape.phi, shape.theta, angle_rates)
    print("gyro rates (P, Q, R) at the three stations, rad/s:")
    print(rates.round(4))
    # Eq. 4 turns them back.
    back = (euler_rate_matrix(shape.phi, shape.theta) @ rates[..., None])[..., 0]
    np.testing.assert_allclose(back, angle_rates, atol=1e-12)
    return tip


if __name__ == "__main__":
    main()
