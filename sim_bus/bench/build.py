"""From a configuration and what is offered to a bench whose interfaces are there."""

import numpy as np

from avionics.config import Camera, Config
from avionics.config.link_checks import check_links
from avionics.config.links import CanLink, I2cLink, Link, SocketCamera, UartLink, V4l2Camera
from avionics.errors import ConfigError
from drivers.clock import SteadyClock
from sim_bus.bench.bench import Bench, BenchOptions
from sim_bus.bench.camera import Feeder, FrameSink
from sim_bus.bench.cuse_i2c import CuseI2cBus
from sim_bus.bench.frame_server import FrameServer
from sim_bus.bench.i2c_adapter import transfer_on
from sim_bus.bench.places import Offer, place_pods
from sim_bus.bench.prepared import PlayedMotion
from sim_bus.bench.pty_uart import PtyUart
from sim_bus.bench.served_can import ServedCan
from sim_bus.bench.v4l2_output import V4l2Output
from sim_bus.bench.window import Window
from sim_bus.buses.factory import DrawnPods, bno055, generator, target_of
from sim_bus.buses.faults import FaultPlan
from sim_bus.buses.i2c import Place, SimI2cBus, Wired
from sim_bus.buses.uart import SimSerialPort
from sim_bus.camera.sim_camera import Exposure
from sim_bus.chip.kinds import make_sim_chip
from sim_bus.rig import imu_grade
from sim_bus.wing.build import make_wing
from sim_bus.wing.scenario import Scenario


def open_bench(config: Config, scenario: Scenario, options: BenchOptions) -> Bench:
    """Return the bench, its interfaces there and its wing at rest.

    Parameters
    ----------
    config : Config
        What flies: pods, markers and camera are the true ones.
    scenario : Scenario
        What happens once it is started.
    options : BenchOptions
        Where it is offered.

    Raises
    ------
    ConfigError
        If a pod has no place on what is offered, or two have the same.
    DeviceNotFoundError
        If an interface cannot be opened; the message names what it needs.
    """
    seed = options.seed
    places = place_pods(config, options.offer)
    bench = Bench(config, SteadyClock(), FaultPlan([], generator(seed, "faults")), scenario, seed)
    try:
        _make_chips(bench, places)
        links = {**places}
        _serve_i2c(bench, places)
        _serve_uart(bench, places, links, options.offer)
        _serve_can(bench, places)
        pods = tuple(
            pod.model_copy(update={"link": links.get(pod.name, pod.link)}) for pod in config.pods
        )
        check_links(pods)
        # The IMU at the root is not served: whoever flies must not wait for it.
        changes: dict[str, object] = {"pods": pods, "root": None}
        if options.camera is not None:
            changes["camera"] = _serve_camera(bench, options)
        bench.config = config.model_copy(update=changes)
        _warm_up(bench)
    except BaseException:
        bench.close()
        raise
    return bench


def _make_chips(bench: Bench, places: dict[str, Link]) -> None:
    grade, now_ns = imu_grade(bench.scenario.imu), bench.clock.now_ns()
    for pod in bench.config.pods:
        if pod.name in places:
            motion = PlayedMotion(bench.wing, pod)
            rng = generator(bench.seed, f"pod {pod.name}")
            bench.motions[pod.name] = motion
            bench.chips[pod.name] = make_sim_chip(
                pod.chip, motion, rng, grade=grade, power_on_ns=now_ns, is_booted=True
            )


def _serve_i2c(bench: Bench, places: dict[str, Link]) -> None:
    buses: dict[int, dict[Place, Wired]] = {}
    for name, link in places.items():
        if isinstance(link, I2cLink):
            place = (link.mux_address, link.mux_channel, link.address)
            buses.setdefault(link.bus, {})[place] = Wired(bench.chips[name], target_of(name))
    byte_ns = round(bench.scenario.imu.i2c_byte_us * 1e3)
    for number, chips in sorted(buses.items()):
        bus = SimI2cBus(bench.clock, chips, bench.faults, byte_ns=byte_ns)
        node = CuseI2cBus(number, transfer_on(bus))
        node.start()
        bench.keep(node.close)


def _serve_uart(
    bench: Bench, places: dict[str, Link], links: dict[str, Link], offer: Offer
) -> None:
    devices = list(offer.uart_devices)
    for name, link in places.items():
        if isinstance(link, UartLink):
            port = SimSerialPort(
                bno055(bench.chips[name]), bench.clock, target=target_of(name),
                faults=bench.faults,
                baud=link.baud,
            )  # fmt: skip
            device = devices.pop(0) if devices else None
            line = PtyUart(port, bench.clock, device=device, baud=link.baud)
            bench.keep(line.close)
            links[name] = link.model_copy(update={"port": line.path})


def _serve_can(bench: Bench, places: dict[str, Link]) -> None:
    groups: dict[tuple[str, str, int | None], list[tuple[str, CanLink]]] = {}
    for name, link in places.items():
        if isinstance(link, CanLink):
            key = (link.interface, link.channel, link.bitrate)
            groups.setdefault(key, []).append((name, link))
    make_pod = DrawnPods(bench.clock, bench.faults, bench.chips, bench.scenario.imu, bench.seed)
    for (interface, channel, bitrate), members in groups.items():
        station = ServedCan(interface, channel, bitrate, bench.clock)
        bench.keep(station.close)
        bench.stations.append(station)
        station.start([make_pod(name, link.node, station.tap()) for name, link in members])


def _serve_camera(bench: Bench, options: BenchOptions) -> Camera:
    camera = bench.config.camera
    if camera is None:
        msg = "the configuration has no [camera]; add one or leave --camera out"
        raise ConfigError(msg)
    look, shown, source = bench.scenario.picture, camera, camera.source
    sink: FrameSink
    if options.camera == "pipe":
        sink = FrameServer(options.folder / "camera.sock", camera.fps)
        source = SocketCamera(kind="socket", path=str(sink.path))
    else:
        # Shown or written at once: the delay is the real camera's.
        look = look.model_copy(update={"delay_s": (0.0, 0.0)})
        if options.camera == "v4l2":
            device = options.camera_device or "/dev/video0"
            sink = V4l2Output(device, camera.width_px, camera.height_px)
            source = V4l2Camera(kind="v4l2", device=sink.device)
        else:
            sink = Window(options.camera_device or "127.0.0.1:8055")
            bench.page = sink.address
            # The lens that looks at the page bends the picture; the page must not.
            flat = dict.fromkeys(("k1", "k2", "k3", "p1", "p2"), 0.0)
            shown = camera.model_copy(update=flat)
    bench.keep(sink.close)
    bench.pictures = sink
    bench.shown, bench.look = shown, look
    bench.camera = bench.make_camera(bench.wing, bench.faults, start_ns=bench.clock.now_ns())
    bench.camera.frame(Exposure(0, bench.clock.now_ns(), 0))  # what is compiled is loaded now
    feeder = Feeder(bench.camera, sink, bench.clock)
    bench.keep(feeder.close)
    feeder.start()
    return camera.model_copy(update={"source": source})


def _warm_up(bench: Bench) -> None:
    """Load what is compiled before anybody waits for it."""
    trial = make_wing(bench.config, bench.scenario, rng=generator(0, "trial"))
    trial.truth(1)
    for motion in bench.motions.values():
        motion.sense(np.array([bench.clock.now_ns()], dtype=np.int64))
