import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from avionics.analysis.flight import read_flight
from avionics.errors import OutputExistsError, RecordingError
from avionics.records import WingShapeEstimate
from tests.avionics.written_flight import flight_records, line_m, write

pytest.importorskip("matplotlib")

from avionics.report.build import write_report
from avionics.report.plots_shape import choose_instants
from avionics.report.subject import subjects_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("log") / "flight.mcap", flight_records())


@pytest.fixture(scope="module")
def page(log: Path) -> str:
    output = log.with_name("report.html")
    write_report(read_flight(log), output)
    return output.read_text(encoding="utf-8")


class Checker(HTMLParser):
    """Collects what a browser would have to fetch, and every id."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name in {"src", "href", "xlink:href"} and value and not value.startswith("#"):
                self.fetched.append(value)


def test_page_is_self_contained(page: str) -> None:
    checker = Checker()
    checker.feed(page)
    assert all(address.startswith("data:") for address in checker.fetched)
    assert not {"script", "link", "iframe"} & set(checker.tags)
    assert "@import" not in page
    assert "url(http" not in page


def test_page_says_what_flew_and_what_was_lost(page: str) -> None:
    for words in (
        "Flight report: flight.mcap",
        "avionics sim",
        "0, 1 at 0.6 m; 2, 3 at 1.2 m; 4, 5 at 1.5 m",
        "/camera/root/tracks",
        "bus_off 1",
        "silent &lt;0.2 s&gt; &amp; back",
        "From exposure to fusion: median 40 ms",
    ):
        assert words in page


def test_every_figure_has_number_and_caption(page: str) -> None:
    captions = re.findall(r"<figcaption><b>Figure (\d+)\. ([^<]*)</b>", page)
    assert [int(number) for number, _ in captions] == list(range(1, page.count("<figure>") + 1))
    titles = " ".join(title for _, title in captions)
    for words in ("Marker error", "Markers over", "Reference line", "Tip", "rates", "bias",
                  "Innovations", "Markers found"):  # fmt: skip
        assert words in titles


def test_names_inside_the_drawings_do_not_clash(page: str) -> None:
    """A clip path of one drawing must not cut another."""
    clips = re.findall(r'<clipPath id="([^"]+)"', page)
    assert len(clips) == len(set(clips)) > 0


def test_same_log_gives_the_same_page(log: Path, page: str, tmp_path: Path) -> None:
    write_report(read_flight(log), tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page


def test_instants_are_the_extremes_of_the_thirds(log: Path) -> None:
    subject = subjects_of(read_flight(log))[0]
    instants = choose_instants(subject)
    heights = [-line_m(one.t_ns * 1e-9)[-1, 2] for one in instants]
    assert [one.label for one in instants] == ["t1", "t2", "t3", "t4"]
    assert heights[1] == pytest.approx(-0.45, abs=0.03)
    assert heights[2] == pytest.approx(0.45, abs=0.03)
    assert heights[3] == pytest.approx(-0.45, abs=0.03)
    tracks = subject.tracks
    exposed = dict(zip(tracks.frame_index.tolist(), tracks.t_ns.tolist(), strict=True))
    assert all(exposed[one.frame_index] == one.t_ns for one in instants)


def test_a_flight_without_camera_and_truth_still_has_a_report(tmp_path: Path) -> None:
    items = flight_records(with_camera=False, with_truth=False)
    write_report(read_flight(write(tmp_path / "bare.mcap", items)), tmp_path / "bare.html")
    text = (tmp_path / "bare.html").read_text(encoding="utf-8")
    assert "no truth" in text
    assert "Tip deflection" in text


def test_an_import_without_estimates_still_has_a_report(tmp_path: Path) -> None:
    items = [item for item in flight_records() if not isinstance(item[1], WingShapeEstimate)]
    write_report(read_flight(write(tmp_path / "raw.mcap", items)), tmp_path / "raw.html")
    assert "Angular rates" in (tmp_path / "raw.html").read_text(encoding="utf-8")


def test_a_cut_log_is_reported_as_cut(log: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    write_report(read_flight(tmp_path / "cut.mcap"), tmp_path / "cut.html")
    assert "The log is not whole" in (tmp_path / "cut.html").read_text(encoding="utf-8")


def test_an_empty_log_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nothing to report"):
        write_report(read_flight(write(tmp_path / "empty.mcap", [])), tmp_path / "empty.html")
    assert not (tmp_path / "empty.html").exists()


def test_existing_report_is_refused(log: Path, tmp_path: Path) -> None:
    (tmp_path / "r.html").write_text("precious")
    with pytest.raises(OutputExistsError):
        write_report(read_flight(log), tmp_path / "r.html")
    assert (tmp_path / "r.html").read_text() == "precious"
