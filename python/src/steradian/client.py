"""The client: all calls of a daemon, with plain Python values and numpy arrays."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy.typing as npt

from . import _protocol
from ._channel import PathLike, Transport
from ._protocol import Message
from .camera import Camera, frame_value
from .frames import Frame
from .pull import FrameLoop, FramesLoop, PullLoop
from .scene import Check, Info, Scene, SeenObject, Snapshot, Stats, update_of
from .steering import Steering, pose_fields
from .views import View
from .watch import Watch

Ends = TypeVar("Ends", bound="Watch[Any] | PullLoop[Any]")


def _same(message: Message) -> Message:
    return message


class Client:
    """A connection to a daemon; a context manager. It may be used from any thread.

    The connection is made by the first call, and again after a loss. Every call raises a `SteradianError` if it fails:
    see `steradian.errors`. Each call has a deadline, except streams.

    Args:
        address: `HOST:PORT`, `http://HOST:PORT`, `https://HOST:PORT` for TLS, or `unix:PATH`.
        token: sent with every call. Only with TLS, or to this machine.
        ca_file: trusted certificates (PEM), instead of those of the system.
        cert_file: certificate (PEM) of the client, if the daemon requires one; with `key_file`.
        key_file: its key (PEM).
        timeout_s: default deadline of calls, s.

    Raises:
        ValueError: the address is invalid, or unsuitable for the token or certificates.
        OSError: a file cannot be read.
    """

    def __init__(
        self,
        address: str,
        *,
        token: str | None = None,
        ca_file: PathLike | None = None,
        cert_file: PathLike | None = None,
        key_file: PathLike | None = None,
        timeout_s: float = 60.0,
    ) -> None:
        self._transport = Transport(address, token, ca_file, cert_file, key_file, timeout_s)
        # Loops and streams, which end with the client.
        self._lasting: weakref.WeakSet[Watch[Any] | PullLoop[Any]] = weakref.WeakSet()
        self._guard = threading.Lock()

    def close(self) -> None:
        """Ends the connection, with all loops and streams on it."""
        with self._guard:
            lasting = list(self._lasting)
        for each in lasting:
            each.close()
        self._transport.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _lasts(self, made: Ends) -> Ends:
        with self._guard:
            self._lasting.add(made)
        return made

    def wait_until_ready(self, timeout_s: float = 60.0) -> None:
        """Waits until the daemon is ready for calls, because it listens before its shaders are compiled.

        Raises:
            DeadlineExceeded: it was not ready within `timeout_s`.
        """
        self._transport.wait_until_ready(timeout_s)

    # Any call.

    def call(
        self, service: str, name: str, request: Message = None, /, *, timeout_s: float | None = None, **fields: object
    ) -> Message:
        """Makes any call of the protocol with one answer, such as `call("ViewService", "GetView", view="dome")`.

        Args:
            service: its service.
            name: its name.
            request: its message; if it is absent, the message is made from `fields`.
            timeout_s: its deadline, s; if it is absent, that of the client.
            fields: fields of the message by name; values as of `steradian.message`.

        Returns:
            The message of the answer.

        Raises:
            ValueError: the call does not exist.
            TypeError: the message lacks such a field, or a value does not fit one.
        """
        return self._transport.unary(service, name, self._request(service, name, request, fields), timeout_s)

    def _ask(self, service: str, name: str, fields: Mapping[str, object], timeout_s: float | None = None) -> Message:
        return self._transport.unary(service, name, self._request(service, name, None, fields), timeout_s)

    def stream(self, service: str, name: str, request: Message = None, /, **fields: object) -> Watch[Message]:
        """Opens any server stream, such as `stream("SceneService", "WatchScene")`: an iterator over its messages.
        The arguments are those of `call`."""
        made = self._request(service, name, request, fields)
        return self._lasts(Watch(self._transport, _protocol.method(service, name), made, _same))

    def _request(self, service: str, name: str, request: Message, fields: Mapping[str, object]) -> Message:
        if request is not None and fields:
            raise TypeError("a call takes a message or fields, not both")
        return _protocol.build(_protocol.method(service, name).request, fields) if request is None else request

    # Views and frames.

    def views(self) -> list[View]:
        """Lists all views, in the order of the configuration, the headset last."""
        return [View.of(view) for view in self.call("ViewService", "ListViews").views]

    def view(self, name: str) -> View:
        """Returns a view.

        Raises:
            NotFound: no view has this name.
        """
        return View.of(self.call("ViewService", "GetView", view=name))

    def create_view(self, definition: Message | Mapping[str, object], *, expected_revision: int | None = None) -> View:
        """Creates a view. Its frames can be requested when this returns.

        Args:
            definition: the keys of a table of `[[views]]` in a configuration, as `{"name": "wide", "type": "fisheye",
                "size": [512, 512], "fov_deg": 180.0}`, or a message `ViewDefinition`, such as the one of a view.
            expected_revision: the call is refused if the scene has another revision.

        Returns:
            The view.

        Raises:
            InvalidArgument: a key is missing, unknown to the type, or has an invalid value; the text states the
                valid ones.
            AlreadyExists: a view or the headset already has the name.
            ResourceExhausted: the limit of views, or of their pixels, is reached.
            Conflict: the scene has another revision.
        """
        fields = {"definition": definition, "expected_revision": expected_revision}
        return View.of(self._ask("ViewService", "CreateView", fields))

    def delete_view(self, name: str, *, expected_revision: int | None = None) -> int:
        """Deletes a view. Loops and streams of its frames end with `NotFound`.

        Args:
            name: the view.
            expected_revision: the call is refused if the scene has another revision.

        Returns:
            The new revision of the scene.

        Raises:
            NotFound: no view has this name.
            Conflict: the scene has another revision.
        """
        fields = {"view": name, "expected_revision": expected_revision}
        return int(self._ask("ViewService", "DeleteView", fields).revision)

    def update_view(self, name: str, changes: Mapping[str, object], *, expected_revision: int | None = None) -> View:
        """Changes definition, exposure, glare, tone mapping or exposure group of a view: either all named values or
        none, from the next frame on.

        Args:
            name: the view.
            changes: values by path: `{"exposure.limiting_magnitude": 9.0, "glare": {"method": "none"},
                "exposure_group": "", "definition.fov_deg": 120.0}`. With None, the key is inherited.
            expected_revision: the change is refused if the scene has another revision.

        Returns:
            The view after the change.

        Raises:
            InvalidArgument: a path or value is invalid; the text states the valid ones.
            NotFound: no view has this name.
            Conflict: the scene has another revision.
        """
        view = _protocol.message("View", name=name)
        for path, value in changes.items():
            if value is not None:
                _protocol.put(view, path, value)
        fields = {"view": view, "update_mask": list(changes), "expected_revision": expected_revision}
        return View.of(self._ask("ViewService", "UpdateView", fields))

    def render(self, view: str, encoding: str = "RGBA8", *, max_size: int = 0, timeout_s: float | None = None) -> Frame:
        """Renders a view now, with the newest camera.

        Args:
            view: its name.
            encoding: `RGBA8`, `PNG` or `JPEG` for display images, `RGB32F` or `EXR` for luminance in cd/m^2, or another
                one that the daemon has.
            max_size: longest side of the images, pixels: larger display images are scaled down by a whole number. With
                0, they have the size of the view.
            timeout_s: deadline, s.

        Raises:
            ValueError: the encoding does not exist.
            NotFound: no view has this name.
            ResourceExhausted: too many such calls are waiting.
        """
        fields = {"view": view, "encoding": encoding, "max_size": max_size}
        return Frame.of(self._ask("ViewService", "RenderFrame", fields, timeout_s))

    def frames(
        self,
        view: str,
        encoding: str = "RGBA8",
        *,
        max_size: int = 0,
        max_rate_hz: float | None = None,
        reconnect: bool = False,
        timeout_s: float | None = None,
    ) -> FrameLoop:
        """Returns a background loop with the newest frames of a view: a frame that is taken is always the newest,
        however seldom frames are taken.

        A frame arrives when the picture has changed, and once a second if it has not. There are these ways to take
        frames from a loop: `for frame in loop`, `loop.next(timeout_s)` and `loop.latest()`.

        Each picture of `H264` depends on the previous one, so none is skipped: the next one is requested when the last
        one has been taken.

        Args:
            view: its name.
            encoding: as for `render`.
            max_size: as for `render`.
            max_rate_hz: maximum rate of requests. A frame that is taken may then be older by 1 / max_rate_hz. With
                None, frames are requested as fast as they arrive.
            reconnect: when the daemon goes away, the loop tries again after 0.1 s, then after pauses that double up to
                2 s; otherwise `Unavailable` is raised where frames are taken. Other errors end the loop in both cases.
            timeout_s: deadline of a single call, s.

        Raises:
            ValueError: the encoding does not exist.
        """
        options = _loop_options(max_size, max_rate_hz, reconnect, timeout_s)
        return self._lasts(FrameLoop(self._transport, {view: encoding}, **options))

    def frames_of(
        self,
        views: Sequence[str] | Mapping[str, str],
        encoding: str = "RGBA8",
        *,
        max_size: int = 0,
        max_rate_hz: float | None = None,
        reconnect: bool = False,
        timeout_s: float | None = None,
    ) -> FramesLoop:
        """Returns a background loop with the newest frames of up to 16 views. It yields dictionaries of
        the frames that have not been taken yet, by view.

        Args:
            views: their names, or their encodings by name.
            encoding: encoding of views that are given by name only.
            max_size: as for `render`; the other arguments are as for `frames`.
        """
        if isinstance(views, str):
            raise TypeError(f"views = {views!r}: must be a sequence of names; for one view, use `frames`")
        wanted = dict(views) if isinstance(views, Mapping) else dict.fromkeys(views, encoding)
        options = _loop_options(max_size, max_rate_hz, reconnect, timeout_s)
        return self._lasts(FramesLoop(self._transport, wanted, **options))

    # The camera.

    def camera(self) -> Camera:
        """Returns the current camera."""
        return Camera.of(self.call("CameraService", "GetCamera"))

    def set_camera(
        self,
        pose: Camera | None = None,
        *,
        position_m: npt.ArrayLike | None = None,
        orientation: npt.ArrayLike | None = None,
        velocity_c: npt.ArrayLike | None = None,
        turn: npt.ArrayLike | None = None,
        frame: str | None = None,
        expected_revision: int | None = None,
    ) -> Camera:
        """Moves the camera. Missing values stay unchanged.

        Args:
            pose: the whole pose, instead of the following arguments.
            position_m: (3,), metres, ICRS axes, from the Solar-System barycentre.
            orientation: (4,), unit quaternion x, y, z, w, which takes camera axes to ICRS axes.
            velocity_c: (3,), in units of the speed of light, at most 0.9999.
            turn: (4,), instead of `orientation`: rotation about the axes of the camera, from its orientation when the
                daemon receives the call.
            frame: reference frame with which the camera turns from now on: `icrs`, `galactic`, `ecliptic`, `horizon` or
                a body such as `moon`.
            expected_revision: the pose is refused if the camera has another revision.

        Returns:
            The camera with its new revision. A `render` after this shows this pose or a later one.

        Raises:
            InvalidArgument: the pose is invalid, or the scene cannot be drawn from it.
            Conflict: the camera has another revision.
            LeaseHeld: another client holds the lease of the camera.
        """
        fields = pose_fields(pose, position_m, orientation, velocity_c, turn)
        fields |= {"expected_revision": expected_revision, "frame": frame_value(frame)}
        return Camera.of(self._ask("CameraService", "SetCamera", fields))

    def look(
        self,
        at: str = "",
        *,
        longitude_deg: float | None = None,
        latitude_deg: float | None = None,
        roll_deg: float = 0.0,
        above_deg: float = 0.0,
        frame: str | None = None,
        expected_revision: int | None = None,
    ) -> Camera:
        """Points the camera at an object or in a direction, with the pole of the frame upwards.

        Args:
            at: name of a body, star or constellation, as `find` knows it; instead of a direction.
            longitude_deg: right ascension, longitude or azimuth; 0 if only the other is given.
            latitude_deg: declination, latitude or altitude; 0 if only the other is given.
            roll_deg: rotation of the top of the image to the left.
            above_deg: angle by which the direction is above the middle of the image, as above the front rim of a dome.
            frame: reference frame of the direction, and of the camera from then on: as for `set_camera`. None: the
                current one.
            expected_revision: refused if the camera has another revision.

        Returns:
            The camera with its new revision.

        Raises:
            ValueError: neither an object nor a direction is given.
            InvalidArgument: no object has the name, or a value is invalid.
            Conflict: the camera has another revision.
            LeaseHeld: another client holds the lease of the camera.
        """
        if not at and longitude_deg is None and latitude_deg is None:
            raise ValueError("give the name of an object, or longitude_deg and latitude_deg")
        look = {
            "at": at,
            "longitude_deg": longitude_deg or 0.0,
            "latitude_deg": latitude_deg or 0.0,
            "roll_deg": roll_deg,
            "above_deg": above_deg,
            "frame": frame_value(frame),
        }
        fields = {"look": look, "expected_revision": expected_revision}
        return Camera.of(self._ask("CameraService", "SetCamera", fields))

    def steer(self, *, take_over: bool = False, lease: bool = True, holder: str = "") -> Steering:
        """Opens a stream of poses, at a thousand per second or more:
        `with client.steer() as steer: steer(position_m=...)`. While it lasts, no other client can move the camera.

        Args:
            take_over: takes the lease even from another holder, whose stream then ends with `LeaseHeld`.
            lease: with False, takes no lease; poses are accepted while no other client holds it.
            holder: name of the holder, which refused clients see; at most 64 characters.

        Raises:
            ValueError: take_over is combined with lease=False.
        """
        if take_over and not lease:
            raise ValueError("take_over must not be combined with lease=False")
        wanted = "CAMERA_LEASE_TAKE_OVER" if take_over else "CAMERA_LEASE_TAKE" if lease else "CAMERA_LEASE_NONE"
        return Steering(self._transport, wanted, holder)

    def watch_camera(self) -> Watch[Camera]:
        """Streams the current camera and each change; a slow reader gets only the newest."""
        method = _protocol.method("CameraService", "WatchCamera")
        return self._lasts(Watch(self._transport, method, method.request(), Camera.of))

    # The scene.

    def scene(self) -> Scene:
        """Returns the current scene."""
        return Scene.of(self.call("SceneService", "GetScene"))

    def update_scene(
        self, changes: Mapping[str, object], *, expected_revision: int | None = None, timeout_s: float | None = None
    ) -> Scene:
        """Changes either all of the named values or none, from the next frame on.

        Args:
            changes: values by path: `{"time": datetime(..., tzinfo=timezone.utc), "time_rate": 60.0,
                "stars.magnitude_limit": 6.0, "bodies.rock": {"position_m": [...], ...}, "bodies.old": None}`.
                None removes a member of a list. Lists (`bodies`, `asteroid_fields`) replace all members. Values have
                the forms that `steradian.message` accepts.
            expected_revision: the change is refused if the scene has another revision.
            timeout_s: deadline, s; new asteroids are generated before the answer.

        Returns:
            The scene after the change.

        Raises:
            TypeError: the field does not exist, or a value does not fit it.
            InvalidArgument: a path or value is invalid; the text states the valid ones.
            Conflict: the scene has another revision.
        """
        scene, mask = update_of(changes)
        fields = {"scene": scene, "update_mask": mask, "expected_revision": expected_revision}
        return Scene.of(self._ask("SceneService", "UpdateScene", fields, timeout_s))

    def find(self, name: str) -> SeenObject:
        """Returns a body, star or constellation by name, as the camera sees it.

        Raises:
            NotFound: no object has this name; the text suggests similar ones.
        """
        return SeenObject.of(self.call("SceneService", "Find", name=name).object)

    def identify(self, direction: npt.ArrayLike, *, radius_deg: float = 0.0, most: int = 0) -> list[SeenObject]:
        """Returns the objects in an apparent direction, the most likely one first.

        Args:
            direction: (3,), ICRS axes, of any length except 0.
            radius_deg: search radius for stars, and for bodies that do not cover the direction, at most 10; 0: 0.5.
            most: maximum number of objects, up to 64; 0: 8.

        Raises:
            InvalidArgument: a value is out of range.
            ResourceExhausted: too many such calls are running.
        """
        fields = {"direction": direction, "radius_deg": radius_deg, "most": most}
        return [SeenObject.of(found) for found in self._ask("SceneService", "Identify", fields).objects]

    def watch_scene(self) -> Watch[Scene]:
        """Streams the current scene and each change; a slow reader gets only the newest."""
        method = _protocol.method("SceneService", "WatchScene")
        return self._lasts(Watch(self._transport, method, method.request(), Scene.of))

    def save_snapshot(self, name: str) -> Snapshot:
        """Saves scene, settings of views and camera; replaces an existing snapshot of the name.

        Raises:
            InvalidArgument: the name has characters other than letters, digits, _ and -, or more than 64.
            FailedPrecondition: the daemon has no state file (`serve --state FILE`).
        """
        return Snapshot.of(self.call("SceneService", "SaveSnapshot", name=name))

    def load_snapshot(self, name: str, *, expected_revision: int | None = None) -> Scene:
        """Replaces scene, settings of views and camera by a snapshot.

        Raises:
            NotFound: no snapshot has this name.
            FailedPrecondition: the daemon has no state file, lacks a part that the snapshot needs, or another
                client holds the lease of the camera.
            Conflict: the scene has another revision.
        """
        fields = {"name": name, "expected_revision": expected_revision}
        return Scene.of(self._ask("SceneService", "LoadSnapshot", fields))

    def snapshots(self) -> list[Snapshot]:
        """Lists the snapshots by name.

        Raises:
            FailedPrecondition: the daemon has no state file.
        """
        return [Snapshot.of(snapshot) for snapshot in self.call("SceneService", "ListSnapshots").snapshots]

    # The daemon.

    def info(self) -> Info:
        """Returns version, adapter, driver, and size of the scene."""
        return Info.of(self.call("DiagnosticsService", "GetInfo"))

    def stats(self, interval_s: float = 1.0) -> Watch[Stats]:
        """Streams statistics, now and at each interval, 0.1 to 60 s."""
        method = _protocol.method("DiagnosticsService", "WatchStats")
        request = _protocol.build(method.request, {"interval_s": interval_s})
        return self._lasts(Watch(self._transport, method, request, Stats.of))

    def verify(self, filter: str = "", *, star_method: str = "") -> Watch[Check]:
        """Runs the checks on the daemon's adapter, one after the other, and yields each result. `close` stops them.

        Args:
            filter: selects checks: a name, a part of names, a group, or a number. Empty: all.
            star_method: the star method to check; empty: the one in use.
        """
        method = _protocol.method("DiagnosticsService", "Verify")
        request = _protocol.build(method.request, {"filter": filter, "star_method": star_method})
        return self._lasts(Watch(self._transport, method, request, Check.of))


def _loop_options(max_size: int, max_rate_hz: float | None, reconnect: bool, timeout_s: float | None) -> dict[str, Any]:
    return {"max_size": max_size, "max_rate_hz": max_rate_hz, "reconnect": reconnect, "timeout_s": timeout_s}
