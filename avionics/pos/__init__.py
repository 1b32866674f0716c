"""Distributed position and orientation: how far a node on a flexing wing has turned.

Short names of the sources, as the docstrings of this package use them:

Gong et al.
    X. Gong et al., "Deformation measuring methods based on inertial sensors for airborne
    distributed POS", Int. J. Aerospace Engineering 2017, 9343215. Methods IMU, Gs, As.
Guo and Zhu
    T. Guo, Z. Zhu, "A new modeling approach of flexible baseline for distributed POS".
    Timoshenko wing, velocity-and-attitude transfer alignment.

Axes: n = East-North-Up; body m (master) and s (slave) = right-forward-up. Heading psi clockwise
from north, pitch theta nose up, roll gamma right wing down. Everything is SI and radians.
"""
