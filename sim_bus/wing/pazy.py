"""The Pazy wing from the files of the Aeroelastic Prediction Workshop's large-deflection group.

Stiffness and masses as published (Riso and Cesnik, 2022; measurements by Avin et al., AIAA J.,
2022), nothing tuned. The files are not shipped; give the folder that holds them.
"""

import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from avionics.errors import DataSetError
from sim_bus.wing.beam import STANDARD_GRAVITY_M_S2, Beam

FloatArray = NDArray[np.float64]
SHEET = "xl/worksheets/sheet1.xml"
NAMESPACE = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
# Published axes: x aft, y out, z up. Ours: x forward, y out, z down.
OURS_FROM_PUBLISHED = np.diag([-1.0, 1.0, -1.0])
# K12, K13, K14, K23, K24, K34; in-plane bending turns the other way about our axis.
COUPLINGS = ((0, 1, 1), (0, 2, 1), (0, 3, -1), (1, 2, 1), (1, 3, -1), (2, 3, -1))


def read_sheet(path: Path) -> FloatArray:
    """Return the numbers of a workbook's first sheet, below its one row of headings.

    Raises
    ------
    DataSetError
        If it is not a workbook of numbers.
    """
    try:
        with zipfile.ZipFile(path) as book:
            rows = list(ET.fromstring(book.read(SHEET)).iter(f"{NAMESPACE}row"))[1:]
        return np.array([[float(_value(cell)) for cell in row] for row in rows])
    except (OSError, KeyError, ValueError, ET.ParseError, zipfile.BadZipFile) as error:
        msg = f"{path}: not a workbook of numbers: {error}"
        raise DataSetError(msg) from error


def _value(cell: ET.Element) -> str:
    found = cell.findtext(f"{NAMESPACE}v")
    if found is None:
        msg = f"cell {cell.get('r')} is empty"
        raise ValueError(msg)
    return found


def pazy_beam(folder: Path) -> Beam:
    """Return the wing with its skin on.

    Parameters
    ----------
    folder : Path
        With ``coordinates.txt``, ``stiffness_skin1.xlsx`` and ``inertia_skin1.xlsx``.
    """
    span = np.loadtxt(folder / "coordinates.txt", delimiter=",", skiprows=1)[:, 1]
    published = read_sheet(folder / "stiffness_skin1.xlsx")
    stiffness = np.zeros((len(published), 4, 4))
    stiffness[:, range(4), range(4)] = published[:, 1:5]
    for column, (i, j, sign) in enumerate(COUPLINGS, start=5):
        stiffness[:, i, j] = stiffness[:, j, i] = sign * published[:, column]
    masses = read_sheet(folder / "inertia_skin1.xlsx")
    xx, yy, zz, xy, xz, yz = masses[:, 5:11].T
    inertia = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), -1, 0)
    return Beam(
        length_m=np.diff(span),
        stiffness=stiffness,
        mass_kg=masses[:, 1],
        cg_m=masses[:, 2:5] @ OURS_FROM_PUBLISHED,
        inertia_kg_m2=OURS_FROM_PUBLISHED @ inertia @ OURS_FROM_PUBLISHED,
    )


def with_tip_mass(beam: Beam, mass_kg: float) -> Beam:
    """Return the beam with a point mass at its last node."""
    mass, cg = beam.mass_kg.copy(), beam.cg_m.copy()
    cg[-1] *= mass[-1] / (mass[-1] + mass_kg)
    mass[-1] += mass_kg
    return replace(beam, mass_kg=mass, cg_m=cg)


def static_sweep(beam: Beam, masses_kg: FloatArray) -> FloatArray:
    """Return the tip's vertical displacement over tip mass, % of semispan, up is positive.

    Relative to the first mass of the sweep; gravity acts on the wing's own masses, too.
    """
    heights, strain = [], None
    for mass_kg in masses_kg:
        loaded = with_tip_mass(beam, float(mass_kg))
        drive = loaded.drive(gravity_m_s2=(0.0, 0.0, STANDARD_GRAVITY_M_S2))
        strain = loaded.static(drive, strain)
        heights.append(-loaded.shape(strain, np.array([loaded.span_m]))[0][0, 2])
    return np.asarray(100 * (np.array(heights) - heights[0]) / beam.span_m)


def measured_sweep(folder: Path) -> FloatArray:
    """Return tip mass (kg) and displacement (% of semispan) as measured, shape (16, 2)."""
    return np.loadtxt(folder / "static_bending_sweep_skin1_disp_exp.txt")
