"""A beam of one section all along, lumped into nodes."""

import numpy as np

from sim_bus.wing.beam import Beam


def uniform_beam(
    *,
    span_m: float,
    elements: int,
    mass_per_m: float,
    ei_out_n_m2: float,
    ei_in_n_m2: float,
    gj_n_m2: float,
    ea_n: float,
    chord_m: float = 0.0,
    cg_aft_m: float = 0.0,
    tip_mass_kg: float = 0.0,
    damping_s: float = 0.0,
    psi0_rad: float = 0.0,
) -> Beam:
    """Return a beam of one section all along.

    Parameters
    ----------
    span_m, elements
        Length and number of elements.
    mass_per_m, chord_m, cg_aft_m
        Mass per length (kg/m), chord over which it is spread evenly, and how far its centre lies
        aft of the line, m.
    ei_out_n_m2, ei_in_n_m2, gj_n_m2, ea_n
        Bending out of and in the plane, torsion, and axial stiffness.
    tip_mass_kg : float
        Point mass at the tip, with a tenth of the chord as radius of gyration.
    damping_s, psi0_rad
        See ``Beam``.
    """
    length_m = np.full(elements, span_m / elements)
    share = np.ones(elements + 1)
    share[[0, -1]] = 0.5
    mass = mass_per_m * length_m[0] * share
    about_line = np.einsum("n,i->ni", mass, np.array([0.0, 1.0, 1.0]) * chord_m**2 / 12)
    mass[-1] += tip_mass_kg
    about_line[-1] += tip_mass_kg * (0.1 * chord_m) ** 2
    inertia = np.zeros((elements + 1, 3, 3))
    inertia[:, [0, 1, 2], [0, 1, 2]] = about_line
    cg = np.zeros((elements + 1, 3))
    cg[:, 0] = -cg_aft_m
    section = np.diag([ea_n, gj_n_m2, ei_out_n_m2, ei_in_n_m2])
    return Beam(
        length_m=length_m,
        stiffness=np.repeat(section[None], elements, axis=0),
        mass_kg=mass,
        cg_m=cg,
        inertia_kg_m2=inertia,
        damping_s=damping_s,
        psi0_rad=psi0_rad,
    )
