"""A daemon of the built program for the tests, named by `STERADIAN_BINARY` or in `target/release`."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import steradian

# Far longer than any test takes: tests wait for events, and never assert durations.
PATIENCE_S = 120.0

# One star, without glare: all light in a picture comes from the star.
STAR_RA_DEG, STAR_DEC_DEG, STAR_MAGNITUDE = 30.0, 10.0, 2.0
CONFIGURATION = """
[scene]
catalogues = ["star.csv"]
time = 2026-01-01T00:00:00Z
[[views]]
name = "flat"
type = "perspective"
size = [160, 120]
fov_y_deg = 40.0
[[views]]
name = "dome"
type = "fisheye"
mapping = "equidistant"
fov_deg = 180.0
size = [128, 128]
[[views]]
name = "eyes"
type = "stereo"
ipd_m = 0.06
size = [64, 48]
fov = { left_deg = -40.0, right_deg = 40.0, up_deg = 30.0, down_deg = -30.0 }
[stars]
method = "bspline"
[glare]
method = "none"
[exposure]
mode = "manual"
ev100 = -6.0
[server]
state = "state.redb"
"""


class Daemon:
    """A running daemon; `stop` or the end of the test kills it."""

    def __init__(self, folder: Path, configuration: str = CONFIGURATION, listen: str = "127.0.0.1:0") -> None:
        self.folder = folder
        self._log = folder / "daemon.log"
        (folder / "test.toml").write_text(configuration)
        star = f"{STAR_RA_DEG},{STAR_DEC_DEG},{STAR_MAGNITUDE},5800"
        (folder / "star.csv").write_text(f"ra_deg,dec_deg,v_mag,teff_k\n{star}\n")
        self.address = listen
        self.start()

    def start(self) -> None:
        """Starts it, or restarts it at the same address."""
        command = [str(binary()), "serve", "--config", "test.toml", "--listen", self.address]
        with self._log.open("a") as log:
            self._process = subprocess.Popen(command, cwd=self.folder, stdout=subprocess.PIPE, stderr=log, text=True)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line.startswith("listening on "), f"{line!r}\n{self._log.read_text()}"
        self.address = line.removeprefix("listening on ").strip()

    def kill(self) -> None:
        """SIGKILL."""
        self._end(signal.SIGKILL)

    def hang(self) -> None:
        """SIGSTOP: its connections stay open, and nothing answers."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """SIGCONT."""
        self._process.send_signal(signal.SIGCONT)

    def stop(self) -> int:
        """Sends SIGTERM; returns the exit code."""
        return self._end(signal.SIGTERM)

    def _end(self, number: signal.Signals) -> int:
        self._process.send_signal(number)
        assert self._process.stdout is not None
        self._process.stdout.close()
        return self._process.wait(PATIENCE_S)


def binary() -> Path:
    """Returns the path of the program."""
    named = os.environ.get("STERADIAN_BINARY")
    path = Path(named) if named else Path(__file__).parents[2] / "target/release/steradian"
    assert path.is_file(), f"{path} does not exist: build it, or name another one by STERADIAN_BINARY"
    return path.resolve()


def until(condition: Callable[[], bool], what: str) -> None:
    """Waits until a condition is true."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"never: {what}"
        time.sleep(0.01)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon for tests that restore its state."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"))
    yield daemon
    assert daemon.stop() == 0, "the daemon does not end with exit code 0"


@pytest.fixture
def client(shared: Daemon) -> Iterator[steradian.Client]:
    """A client of the shared daemon, with camera and scene as configured."""
    with steradian.Client(shared.address) as made:
        scene, camera = made.scene(), made.camera()
        yield made
        made.set_camera(camera)
        old = {"stars": scene.message.stars, "bodies": list(scene.message.bodies), "time": scene.message.time}
        made.update_scene(old)
        for view in made.views():
            made.update_view(view.name, {"exposure": None, "glare": None, "tone_map": None})


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    """A daemon for a single test."""
    made = Daemon(tmp_path)
    yield made
    made.kill()
