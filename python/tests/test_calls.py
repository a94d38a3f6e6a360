"""Calls and their refusals."""

from __future__ import annotations

import datetime
import threading
from concurrent import futures

import grpc
import numpy as np
import pytest
from conftest import Daemon, until

import steradian


def test_views_have_types_and_images(client: steradian.Client) -> None:
    assert [(view.name, view.type) for view in client.views()] == [
        ("flat", "perspective"),
        ("dome", "fisheye"),
        ("eyes", "stereo"),
    ]
    dome = client.view("dome").images[0]
    assert dome.projection.mapping == "equidistant" and dome.projection.fov_rad == pytest.approx(np.pi)


def test_errors_have_the_class_of_the_status_and_the_daemons_text(client: steradian.Client) -> None:
    with pytest.raises(steradian.NotFound, match="no view `none`; the views are: flat, dome, eyes") as refused:
        client.render("none")
    assert (refused.value.code, refused.value.call) == ("NOT_FOUND", "ViewService/RenderFrame")
    with pytest.raises(steradian.InvalidArgument, match="unit"):
        client.set_camera(orientation=[0, 0, 0, 2])
    with pytest.raises(steradian.InvalidArgument, match="exposure"):
        client.update_view("flat", {"exposure.ev100": 1e9})
    with pytest.raises(steradian.Conflict, match="revision"):
        client.set_camera(expected_revision=client.camera().revision + 1)
    with pytest.raises(steradian.Conflict, match="revision"):
        client.update_scene({"stars.magnitude_limit": 3.0}, expected_revision=10**6)
    with pytest.raises(steradian.NotFound, match="snapshot"):
        client.load_snapshot("none")
    with pytest.raises(steradian.InvalidArgument, match="none-such"):
        next(client.verify("none-such"))
    with pytest.raises(steradian.InvalidArgument):
        next(client.stats(interval_s=1e9))


def test_an_expired_deadline_raises_deadline_exceeded_on_either_side(client: steradian.Client) -> None:
    passed = 0
    for step in range(200):
        try:
            client.render("flat", "EXR", timeout_s=1e-4 * (1 + step % 20))
        except steradian.DeadlineExceeded as error:
            assert error.code == "DEADLINE_EXCEEDED"
            passed += 1
    assert passed > 0


def test_an_unreachable_daemon_raises_unavailable() -> None:
    with steradian.Client("127.0.0.1:9", timeout_s=30.0) as client:
        with pytest.raises(steradian.Unavailable):
            client.info()
        with pytest.raises(steradian.DeadlineExceeded):
            client.wait_until_ready(0.2)


def test_waiting_ends_when_the_daemon_serves_and_not_when_it_listens() -> None:
    serves = threading.Event()

    class Health(grpc.GenericRpcHandler):  # type: ignore[misc]
        def service(self, details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler | None:
            def check(_: bytes, context: grpc.ServicerContext) -> bytes:
                # SERVING or NOT_SERVING.
                return b"\x08\x01" if serves.is_set() else b"\x08\x02"

            return grpc.unary_unary_rpc_method_handler(check) if details.method.endswith("Health/Check") else None

    server = grpc.server(futures.ThreadPoolExecutor(1), handlers=[Health()])
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    try:
        with steradian.Client(f"127.0.0.1:{port}") as client:
            with pytest.raises(steradian.DeadlineExceeded, match="still starting"):
                client.wait_until_ready(3.0)
            serves.set()
            client.wait_until_ready(30.0)
    finally:
        server.stop(None)


def test_mistakes_are_detected_before_sending(client: steradian.Client) -> None:
    with pytest.raises(ValueError, match="name of an object, or longitude_deg"):
        client.look(roll_deg=3.0)
    with pytest.raises(ValueError, match="RGBA8, PNG, JPEG"):
        client.render("flat", "GIF")
    with pytest.raises(ValueError, match="no service"):
        client.call("Viewservice", "GetView")
    with pytest.raises(ValueError, match="GetView"):
        client.call("ViewService", "GetVeiw")
    with pytest.raises(TypeError, match="no field `name`: it has view"):
        client.call("ViewService", "GetView", name="flat")
    with pytest.raises(TypeError, match="no field `magnitude`"):
        client.update_scene({"stars.magnitude": 1.0})
    with pytest.raises(ValueError, match="time zone"):
        client.update_scene({"time": datetime.datetime(2026, 1, 1)})
    with pytest.raises(ValueError, match="stream"):
        client.call("ViewService", "StreamFrames", view="flat")
    with pytest.raises(TypeError, match="sequence"):
        client.frames_of("flat")
    with pytest.raises(ValueError, match="max_rate_hz"):
        client.frames("flat", max_rate_hz=0.0)


def test_the_camera_survives_a_round_trip(client: steradian.Client) -> None:
    rotation = steradian.quaternion([1, 2, 3], 0.7)
    before = client.camera()
    camera = client.set_camera(
        position_m=np.array([1e11, -2.5, 3]), orientation=rotation, expected_revision=before.revision
    )
    assert camera.revision == before.revision + 1
    np.testing.assert_allclose(camera.position_m, [1e11, -2.5, 3], rtol=1e-15)
    np.testing.assert_allclose(camera.orientation, rotation, atol=1e-15)
    shown = client.render("flat").camera
    assert shown is not None and shown.revision == camera.revision
    np.testing.assert_array_equal(shown.position_m, camera.position_m)
    # Missing values stay unchanged.
    np.testing.assert_array_equal(client.set_camera(velocity_c=[0, 0.1, 0]).position_m, camera.position_m)


def test_the_scene_changes_by_paths(client: steradian.Client) -> None:
    time = datetime.datetime(2030, 5, 6, 7, 8, 9, 123456, tzinfo=datetime.timezone.utc)
    rock = {"position_m": [2e11, 0, 0], "radii_m": (9e3, 7e3, 6e3), "geometric_albedo": 0.15, "spin": {"period_s": 3e4}}
    before = client.scene()
    scene = client.update_scene(
        {"time": time, "stars.magnitude_limit": 3.5, "bodies.rock": rock}, expected_revision=before.revision
    )
    assert (scene.time, scene.magnitude_limit, scene.revision) == (time, 3.5, before.revision + 1)
    assert scene.bodies["rock"].geometric_albedo.green == 0.15 and scene.bodies["rock"].radii_m.y == 7e3
    # A received message can be sent unchanged.
    moved = scene.bodies["rock"]
    moved.position_m.x = 3e11
    scene = client.update_scene({"bodies.rock": moved})
    assert scene.bodies["rock"].position_m.x == 3e11
    assert client.update_scene({"bodies.rock": None}).bodies == {}
    with pytest.raises(ValueError, match="cannot have the name"):
        client.update_scene({"bodies.other": moved})


def test_settings_of_a_view_change_and_are_inherited_again(client: steradian.Client) -> None:
    view = client.update_view("flat", {"exposure.ev100": -8.0, "tone_map": {"operator": "srgb"}})
    assert view.message.exposure.ev100 == -8.0 and view.message.tone_map.operator == "srgb"
    assert client.render("flat").exposure_ev100 == pytest.approx(-8.0)
    view = client.update_view("flat", {"exposure.ev100": None}, expected_revision=view.revision)
    assert view.message.exposure.ev100 == -6.0 and "tone_map.operator" in view.message.own_keys
    assert list(client.update_view("flat", {"tone_map": {}}).message.own_keys) == []


def test_views_are_created_changed_and_deleted(client: steradian.Client) -> None:
    names = [view.name for view in client.views()]
    wide = {"name": "wide", "type": "fisheye", "size": [24, 16], "fov_deg": 200.0, "orientation": [0, 0.6, 0, 0.8]}
    made = client.create_view(wide, expected_revision=client.scene().revision)
    try:
        assert (made.type, made.images[0].width_px, made.images[0].height_px) == ("fisheye", 24, 16)
        assert [view.name for view in client.views()] == [*names, "wide"]
        assert made.message.definition.fov_deg == 200.0 and made.message.definition.orientation.y == 0.6
        assert client.render("wide").array().shape[:2] == (16, 24)
        with pytest.raises(steradian.AlreadyExists, match="`wide`"):
            client.create_view(made.message.definition)
        with pytest.raises(steradian.InvalidArgument, match="definition.fov_deg: 400"):
            client.update_view("wide", {"definition.fov_deg": 400.0})
        with pytest.raises(TypeError, match="colour"):
            client.create_view({"colour": "red"})
        changed = client.update_view("wide", {"definition.size": [8, 8], "definition.fov_deg": 90.0})
        assert (changed.images[0].width_px, changed.revision) == (8, made.revision + 1)
        with client.frames("wide") as loop:
            assert loop.next(timeout_s=30.0).array().shape[:2] == (8, 8)
            with pytest.raises(steradian.Conflict):
                client.delete_view("wide", expected_revision=made.revision)
            assert client.delete_view("wide", expected_revision=changed.revision) == changed.revision + 1
            with pytest.raises(steradian.NotFound, match="`wide`"):
                while True:
                    loop.next(timeout_s=30.0)
    finally:
        if "wide" in [view.name for view in client.views()]:
            client.delete_view("wide")
    assert [view.name for view in client.views()] == names
    with pytest.raises(steradian.NotFound, match="the views are"):
        client.delete_view("wide")


def test_every_call_of_the_protocol_can_be_called_by_name(client: steradian.Client) -> None:
    assert set(steradian.services()) >= {"SceneService", "CameraService", "ViewService", "DiagnosticsService"}
    assert "NextFrames" in steradian.services()["ViewService"]
    assert client.call("ViewService", "GetView", view="dome").type == "fisheye"
    request = steradian.message("SetCameraRequest", position_m=[1, 2, 3])
    assert client.call("steradian.v1.CameraService", "SetCamera", request).position_m.y == 2
    with client.stream("ViewService", "StreamFrames", view="flat", encoding="PNG") as frames:
        assert next(frames).images[0].data.startswith(b"\x89PNG")
    with pytest.raises(TypeError, match="not both"):
        client.call("ViewService", "GetView", steradian.message("GetViewRequest"), view="dome")


def test_snapshots_restore_scene_views_and_camera(client: steradian.Client) -> None:
    camera = client.set_camera(position_m=[5, 6, 7])
    scene = client.update_scene({"stars.magnitude_limit": 4.25})
    client.update_view("dome", {"exposure.ev100": -3.0})
    saved = client.save_snapshot("desk-1")
    assert saved in client.snapshots() and saved.name == "desk-1"
    client.set_camera(position_m=[0, 0, 0])
    client.update_scene({"stars.magnitude_limit": 99.0})
    client.update_view("dome", {"exposure": {}})
    loaded = client.load_snapshot("desk-1")
    assert loaded.magnitude_limit == 4.25 and loaded.revision > scene.revision
    np.testing.assert_array_equal(client.camera().position_m, camera.position_m)
    assert client.view("dome").message.exposure.ev100 == -3.0
    with pytest.raises(steradian.InvalidArgument, match="letters"):
        client.save_snapshot("desk 1")


def test_streams_report_changes_and_end(client: steradian.Client) -> None:
    with client.watch_camera() as cameras, client.watch_scene() as scenes:
        first = next(cameras)
        assert next(scenes).revision == client.scene().revision
        moved = client.set_camera(position_m=[9, 9, 9])
        assert moved.revision == first.revision + 1
        assert next(cameras).revision == moved.revision
        changed = client.update_scene({"stars.magnitude_limit": 1.5})
        assert next(scenes).revision == changed.revision
        cameras.close()
        assert list(cameras) == []
    with client.stats(interval_s=0.1) as stats:
        first_stats, second = next(stats), next(stats)
        assert second.time > first_stats.time and second.problem == ""


def test_the_daemon_returns_information_and_check_results(client: steradian.Client) -> None:
    checks = list(client.verify("two-colours"))
    assert [(check.name, check.outcome) for check in checks] == [("two-colours", "PASS")]
    assert checks[0].message.figures[0].what
    info = client.info()
    assert info.stars == 1 and info.adapter


def test_a_daemon_that_ends_ends_streams_in_order(daemon: Daemon) -> None:
    with steradian.Client(daemon.address) as client, client.watch_camera() as cameras:
        next(cameras)
        assert daemon.stop() == 0
        assert list(cameras) == []
        with pytest.raises(steradian.Unavailable):
            client.info()
        daemon.start()
        until(lambda: _answers(client), "the client reconnects")


def _answers(client: steradian.Client) -> bool:
    try:
        client.info()
    except steradian.Unavailable:
        return False
    return True
