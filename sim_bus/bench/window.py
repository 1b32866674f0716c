"""A page that shows what the simulated camera sees, for a real camera in front of a screen."""

import http.server
import threading
from pathlib import Path

import cv2

from drivers.errors import DeviceNotFoundError
from drivers.samples import Frame

PAGE = b"""<!doctype html><title>wing</title>
<style>html,body{margin:0;height:100%;background:#000;overflow:hidden;cursor:none}
img{width:100vw;height:100vh;object-fit:contain;image-rendering:pixelated}</style>
<img src="/stream" alt="what the camera at the root sees">
"""


class Window:
    """A page that shows the frames, for a real camera in front of a screen.

    Parameters
    ----------
    place : str
        ``host:port`` to listen on.

    Raises
    ------
    DeviceNotFoundError
        If nobody may listen there.
    """

    def __init__(self, place: str) -> None:
        host, _, port = place.rpartition(":")
        self._latest: tuple[int, bytes] = (0, b"")
        self._news = threading.Condition()
        self._viewers = 0
        self._is_open = True
        window = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                window._answer(self)

            def log_message(self, format: str, *args: object) -> None:
                pass

        try:
            self._server = http.server.ThreadingHTTPServer(
                (host or "127.0.0.1", int(port)), Handler
            )
        except (OSError, ValueError, OverflowError) as error:
            msg = (
                f"--camera window: cannot listen on {place} ({error}); "
                "give --camera-device HOST:PORT"
            )
            raise DeviceNotFoundError(msg) from error
        self._server.daemon_threads = True
        self.address = f"http://{host or '127.0.0.1'}:{self._server.server_address[1]}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True
        )
        self._thread.start()

    @property
    def is_watched(self) -> bool:
        """Whether a page is open."""
        return self._viewers > 0

    @property
    def counters(self) -> dict[str, int]:
        """Frames shown, and pages that show them."""
        return {"shown": self._latest[0], "pages": self._viewers}

    def send(self, frame: Frame) -> None:
        """Show a frame."""
        done, packed = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        if done:
            with self._news:
                self._latest = (self._latest[0] + 1, packed.tobytes())
                self._news.notify_all()

    def close(self) -> None:
        """Take the page away; may be called twice."""
        if self._is_open:
            self._is_open = False
            self._server.shutdown()
            self._server.server_close()
            self._thread.join(2.0)

    def _answer(self, request: http.server.BaseHTTPRequestHandler) -> None:
        if Path(request.path).name != "stream":
            request.send_response(200)
            request.send_header("Content-Type", "text/html; charset=utf-8")
            request.end_headers()
            request.wfile.write(PAGE)
            return
        request.send_response(200)
        request.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        request.end_headers()
        self._viewers += 1
        try:
            self._stream(request)
        except OSError:
            pass  # the page was closed
        finally:
            self._viewers -= 1

    def _stream(self, request: http.server.BaseHTTPRequestHandler) -> None:
        shown = 0
        while self._is_open:
            with self._news:
                if self._latest[0] == shown:
                    self._news.wait(timeout=0.5)
                number, packed = self._latest
            if number == shown:
                continue
            shown = number
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(packed)}\r\n\r\n"
            request.wfile.write(head.encode() + packed + b"\r\n")
