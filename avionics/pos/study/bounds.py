"""The Riccati bounds of a study's methods, in its own segments."""

import numpy as np

from avionics.pos.bound import difference_bound
from avionics.pos.bound_imu import imu_bound
from avionics.pos.compiled import Array
from avionics.pos.simulate import simulate
from avionics.pos.study.spec import ProfileTable, Spec
from avionics.pos.trajectory import Trajectory


def riccati_bounds(
    spec: Spec, table: ProfileTable, trajectory: Trajectory, seed: int
) -> dict[str, Array]:
    """Return the bound of every method that has one, mean over the segments, rad, shape (3,).

    Methods on instant samples have none: what they miss between samples is no noise of theirs.
    """
    if table.truth.gyro != "integrating":
        return {}
    bounds = {}
    for method in table.methods:
        if method.kind == "wing":
            continue
        node = spec.slave(table.truth, method.arm)
        truth, _ = simulate(trajectory, node, np.random.default_rng(seed))
        if method.kind == "imu":
            bound = imu_bound(trajectory, node, truth, every=method.every)
        else:
            bound = difference_bound(
                trajectory, node, truth,
                gyros=method.kind != "as", forces=method.kind != "gs",
            )  # fmt: skip
        inside = [(bound.t >= s.from_s) & (bound.t <= s.to_s) for s in spec.segments]
        parts = [np.sqrt(np.mean(bound.sigma[mine] ** 2, axis=0)) for mine in inside]
        bounds[method.name] = np.mean(parts, axis=0)
    return bounds
