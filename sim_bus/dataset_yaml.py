"""``wing.yaml`` of a simulated data set, and the laboratory's axes."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from avionics.config import Camera, Config
from sim_bus.camera.chessboard import INNER_CORNERS, SQUARE_M
from sim_bus.wing.scenario import Scenario

LAB_FROM_BODY = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
LAB_ORIGIN_M = np.array([0.312, -1.204, 1.455])


def description(config: Config, scenario: Scenario, nominal: Camera) -> dict[str, Any]:
    """Return the content of a data set's ``wing.yaml``; the camera in it is the nominal one."""

    def placed(markers: Iterable[Any]) -> list[dict[str, float]]:
        return [{"id": m.id, "s": m.s_m, "x": m.x_m, "z": m.z_m} for m in markers]

    return {
        "frames": "body x forward, y right (span), z down; local DRL x chord forward, y tangent, "
        "z down; camera x optical axis, y image right, z image down",
        "wing": {"span_m": config.wing.span_m, "psi0_deg": config.wing.psi0_deg},
        "pods": [
            {
                "id": pod.id,
                "s_m": pod.s_m,
                "R_sensor_from_drl": [[float(x) for x in row] for row in pod.R_sensor_from_local],
            }
            for pod in config.pods
        ],
        "imu": {
            "rate_hz": 100,
            "gyro_lsb_per_dps": 16,
            "accel_lsb_per_mps2": 100,
            "mag_lsb_per_uT": 16,
            "gyro_bandwidth_hz": float(config.pods[0].chip.gyro_bandwidth_hz),
            "gyro_filter": "second order low-pass",
            "gyro_noise_dps_sqrthz": scenario.imu.noise_dps_sqrthz,
            "zero_rate_offset_dps_max": scenario.imu.offset_dps,
        },
        "markers": placed(config.markers),
        "mocap": {
            "rate_hz": 50,
            "markers": placed(config.truth_markers or config.markers),
            "R_lab_from_body": LAB_FROM_BODY.tolist(),
            "t_lab_m": LAB_ORIGIN_M.tolist(),
        },
        "camera": {
            "width": nominal.width_px,
            "height": nominal.height_px,
            "fps": nominal.fps,
            "exposure_s": nominal.exposure_s,
            "nominal": {
                "f_px": nominal.f_x_px,
                "cx": nominal.c_x_px,
                "cy": nominal.c_y_px,
                "tilt_deg": nominal.tilt_deg,
                "pan_deg": nominal.pan_deg,
                "roll_deg": nominal.roll_deg,
                "r_body_m": list(nominal.r_in_body_m),
                "note": "ruler, protractor and data-sheet values; calibrate",
            },
            "chessboard": {"inner_corners": list(INNER_CORNERS), "square_m": SQUARE_M},
        },
    }
