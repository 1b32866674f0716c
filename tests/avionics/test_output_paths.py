from pathlib import Path

import pytest

from avionics.errors import OutputExistsError, RecordingError
from avionics.output_paths import claim_file, claim_folder, refuse_inputs

EXISTS = r": exists already; choose another name, or replace it with --force$"


def test_a_file_that_is_there_is_replaced_only_by_force(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    assert claim_file(path, force=False) == path
    path.touch()
    with pytest.raises(OutputExistsError, match=EXISTS):
        claim_file(path, force=False)
    assert claim_file(path, force=True) == path


def test_a_file_needs_its_folder_and_no_folder_in_its_place(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="none does not exist; make it first"):
        claim_file(tmp_path / "none" / "a.mcap", force=True)
    with pytest.raises(RecordingError, match="is a folder"):
        claim_file(tmp_path, force=True)


def test_a_folder_is_made_and_must_be_empty(tmp_path: Path) -> None:
    path = tmp_path / "new" / "out"
    assert claim_folder(path, force=False).is_dir()
    assert claim_folder(path, force=False) == path
    (path / "other").touch()
    with pytest.raises(OutputExistsError, match=EXISTS):
        claim_folder(path, force=False)
    assert claim_folder(path, force=True) == path


def test_a_folder_may_hold_other_files_than_those_to_write(tmp_path: Path) -> None:
    (tmp_path / "other").touch()
    claim_folder(tmp_path, force=False, files=["imu_0.csv"])
    with pytest.raises(OutputExistsError, match=f"other{EXISTS}"):
        claim_folder(tmp_path, force=False, files=["imu_0.csv", "other"])


def test_a_file_in_place_of_a_folder_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(OutputExistsError, match="is a file"):
        claim_folder(tmp_path / "out", force=True)
    with pytest.raises(RecordingError, match="cannot be made a folder"):
        claim_folder(tmp_path / "out" / "below", force=True)


def test_an_output_is_none_of_its_inputs(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    (tmp_path / "same").symlink_to(tmp_path / "a")
    refuse_inputs(tmp_path / "b", tmp_path / "a")
    with pytest.raises(RecordingError, match="is the log itself"):
        refuse_inputs(tmp_path / "same", tmp_path / "none", tmp_path / "a")
