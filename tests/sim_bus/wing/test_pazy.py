"""GIVEN the Pazy wing as published, untuned, THEN it hangs as it was measured to."""

from pathlib import Path

import numpy as np
import pytest

from avionics.errors import DataSetError
from sim_bus.wing.pazy import measured_sweep, pazy_beam, read_sheet, static_sweep


@pytest.fixture(scope="module")
def folder(shared_data: Path) -> Path:
    path = shared_data / "real" / "pazy-wing"
    if not path.is_dir():
        pytest.skip(f"the Pazy wing's files ({path}) are absent")
    return path


def test_measured_deflection_over_tip_mass(folder: Path) -> None:
    measured = measured_sweep(folder)
    found = static_sweep(pazy_beam(folder), measured[:, 0])
    miss = np.abs(found - measured[:, 1])
    assert measured[-1] == pytest.approx([3.0, -50.09], abs=0.01)
    assert miss[measured[:, 0] <= 0.8].max() < 0.5
    assert miss.max() < 4.0


def test_couplings_and_masses_are_those_published(folder: Path) -> None:
    beam = pazy_beam(folder)
    assert beam.elements == 15
    assert beam.span_m == pytest.approx(0.5498, abs=1e-4)
    assert beam.mass_kg.sum() == pytest.approx(0.356, abs=2e-3)
    assert np.linalg.eigvalsh(beam.stiffness).min() > 0
    assert beam.cg_m[-1, 0] == pytest.approx(-5.0927e-3, rel=1e-3)  # aft


def test_a_workbook_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "stiffness_skin1.xlsx"
    path.write_text("no workbook")
    with pytest.raises(DataSetError, match=r"stiffness_skin1\.xlsx: not a workbook"):
        read_sheet(path)
