"""A data set as it is read: what is left out and listed, and what it cannot do without."""

import pytest

from avionics.datasets.data_set import read_data_set
from avionics.errors import DataSetError


def told(made) -> str:
    """Read a set and walk through its pictures; return what was left out."""
    data = read_data_set(made.path)
    for _ in data.pictures():
        pass
    return " | ".join(data.skips.texts())


def test_byte_order_mark_crlf_and_nul_bytes(made) -> None:
    text = "\r\n".join(made.lines("imu.csv")[:200])
    (made.path / "imu.csv").write_bytes(b"\xef\xbb\xbf" + text.encode() + b"\r\n\0\0\0\r\n")
    assert "bad rows: 1" in told(made)


def test_video_shorter_than_its_table(made) -> None:
    lines = made.lines("frames.csv")
    last = int(lines[-1].split(",")[1])
    more = [f"{89 + i},{last + i * 33_000_000},{last + i * 33_000_000 + 1}" for i in range(1, 6)]
    made.write("frames.csv", [*lines, *more])
    assert "rows beyond the end of camera.avi: 5" in told(made)


def test_video_longer_than_its_table(made) -> None:
    made.write("frames.csv", made.lines("frames.csv")[:-7])
    assert "pictures without a row in frames.csv: 7" in told(made)


def test_unknown_pod_and_repeated_times(made) -> None:
    lines = made.lines("imu.csv")
    t_ns, _, rest = lines[20].split(",", 2)
    made.write("imu.csv", [*lines, f"{t_ns},9,{rest}", lines[30]])
    text = told(made)
    assert "pods that wing.yaml does not name (9)" in text
    assert "repeat a time" in text


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("imu.csv", b"", ("imu.csv", "empty")),
        ("imu.csv", b"t_ns,pod,gx,gy,gz\n", ("imu.csv", "no rows")),
        ("imu.csv", b"t_ns,pod,gx,gy\n1,0,1,1\n", ("imu.csv", "gz")),
        ("imu.csv", b"t_ns,pod,gx,gy,gz\n1,0,a,b,c\n2,0,a,b,c\n", ("imu.csv", "line 2")),
        ("wing.yaml", b"", ("wing.yaml", "empty")),
        ("wing.yaml", b"wing: [1, 2\n", ("wing.yaml", "not YAML")),
        ("wing.yaml", b"wing:\n  span: 1\n", ("wing.yaml", "wing.span_m")),
        ("camera.avi", b"no video", ("camera.avi",)),
        ("frames.csv", b"frame,when\n0,1\n", ("frames.csv", "t_exposure_ns")),
    ],
)
def test_unusable_files_are_clear_errors(made, name, content, words) -> None:
    (made.path / name).write_bytes(content)
    with pytest.raises(DataSetError) as caught:
        told(made)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("name", ["imu.csv", "wing.yaml"])
def test_missing_needed_files_are_clear_errors(made, name: str) -> None:
    (made.path / name).unlink()
    with pytest.raises(DataSetError, match=name.replace(".", r"\.")):
        told(made)


def test_not_a_folder(tmp_path) -> None:
    with pytest.raises(DataSetError, match="is not a folder"):
        read_data_set(tmp_path / "none")
