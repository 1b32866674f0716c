"""From a configuration and a scenario to the simulated wing."""

from dataclasses import replace

import numpy as np

from avionics.config import Config
from sim_bus.wing.beam import Beam
from sim_bus.wing.loads import ScenarioLoads
from sim_bus.wing.root_motion import RootMotion, Swing
from sim_bus.wing.scenario import Scenario, WingProperties
from sim_bus.wing.sim_wing import SimWing
from sim_bus.wing.uniform_beam import uniform_beam

AXES = ("roll", "pitch", "yaw", "north", "east", "down")
AIR_KG_M3 = 1.225
QUARTER_CHORD_AHEAD = 0.19  # of the chord: the line lies at 44 %, as on the Pazy wing


def make_beam(properties: WingProperties, *, span_m: float, psi0_rad: float = 0.0) -> Beam:
    """Return the beam of a scenario's wing."""
    p = properties
    beam = uniform_beam(
        span_m=span_m, elements=p.elements, mass_per_m=p.mass_per_m, ei_out_n_m2=p.ei_out_n_m2,
        ei_in_n_m2=p.ei_in_n_m2, gj_n_m2=p.gj_n_m2, ea_n=p.ea_n, chord_m=p.chord_m,
        cg_aft_m=p.cg_aft_m, tip_mass_kg=p.tip_mass_kg, damping_s=p.damping_s, psi0_rad=psi0_rad,
    )  # fmt: skip
    stiffness = beam.stiffness.copy()
    stiffness[:, 1, 2] = stiffness[:, 2, 1] = p.bend_twist_n_m2
    middle = (np.cumsum(beam.length_m) - beam.length_m / 2) / span_m
    stiffness *= (1 - p.taper * middle)[:, None, None]
    width = np.concatenate([[0.0], beam.length_m]) / 2 + np.concatenate([beam.length_m, [0.0]]) / 2
    air = np.zeros((p.elements + 1, 3))
    air[:, 0] = 0.5 * AIR_KG_M3 * p.chord_m * p.lift_slope_per_rad * width
    air[:, 1] = QUARTER_CHORD_AHEAD * p.chord_m
    air[:, 2] = p.air_damping_n_s_m2 * width
    return replace(beam, stiffness=stiffness, air=air)


def make_root(scenario: Scenario) -> RootMotion:
    """Return how the root moves."""
    return RootMotion(
        tuple(
            Swing(
                axis=AXES.index(s.axis),
                amplitude=float(np.radians(s.amplitude)) if s.axis in AXES[:3] else s.amplitude,
                hz=s.hz,
                phase_rad=float(np.radians(s.phase_deg)),
                start_s=s.at_s,
                stop_s=s.at_s + s.for_s,
                fade_s=s.fade_s,
            )
            for s in scenario.root
        )
    )


def make_wing(
    config: Config,
    scenario: Scenario,
    *,
    rng: np.random.Generator,
    epoch_ns: int = 0,
    keep_s: float = 40.0,
) -> SimWing:
    """Return the simulated wing of a configuration in a scenario.

    Parameters
    ----------
    config : Config
        Span, sweep and truth markers (the LEDs where there are none).
    scenario : Scenario
        Structure, loads and root motion.
    rng : numpy.random.Generator
        Turbulence.
    epoch_ns : int
        Clock reading at time zero of the scenario, ns.
    keep_s : float
        How far back the flight is remembered, s.
    """
    beam = make_beam(scenario.wing, span_m=config.wing.span_m, psi0_rad=config.wing.psi0_rad)
    root = make_root(scenario)
    row = beam.drive()
    row[:12] = root.drive(np.zeros(1))[0]
    s_nodes = np.concatenate([[0.0], np.cumsum(beam.length_m)])
    rest, _ = beam.shape(beam.static(row), s_nodes)
    return SimWing(
        beam,
        ScenarioLoads(scenario.loads, rest_tip_m=rest[-1], node_y_m=rest[:, 1], rng=rng),
        root=root,
        epoch_ns=epoch_ns,
        step_s=scenario.wing.step_s,
        keep_s=keep_s,
        is_left=config.wing.side == "left",
        name=config.wing.name,
        markers=config.truth_markers or config.markers,
    )
