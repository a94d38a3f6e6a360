"""Pull loops: their frames, their order, and their end. Frames are identified by their numbers and revisions; no times
are asserted."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from conftest import PATIENCE_S, Daemon, until

import steradian


def turn(client: steradian.Client, angle_rad: float) -> int:
    """Turns the camera; returns its revision."""
    return client.set_camera(orientation=steradian.quaternion([0, 1, 0], angle_rad)).revision


def test_frames_follow_each_other(client: steradian.Client) -> None:
    numbers = []
    with client.frames("flat") as frames:
        for frame in frames:
            numbers.append(frame.frame_number)
            turn(client, 0.01 * len(numbers))
            if len(numbers) == 5:
                break
    assert numbers == sorted(set(numbers))
    assert frames.closed and frames.received >= 5
    assert list(frames) == []
    with pytest.raises(steradian.Closed):
        frames.next()


def test_a_slow_reader_gets_the_newest_frame_and_the_number_of_skipped_ones(client: steradian.Client) -> None:
    with client.frames("flat") as frames:
        taken = frames.next(PATIENCE_S)
        for step in range(20):
            revision = turn(client, 0.01 * step)
            # Render a frame after each turn: in a stream, these frames would wait in the buffers.
            client.render("flat")
        # A frame in transit may be older, but not a frame that is requested after the last turn.
        come = frames.received
        until(lambda: frames.received >= come + 2, "frames of a camera at rest")
        shown = frames.next(PATIENCE_S)
        assert shown.camera_revision == revision and shown.frame_number > taken.frame_number
        # Two frames were taken; at most one of the others is waiting.
        assert 0 <= frames.received - frames.skipped - 2 <= 1
        assert frames.skipped >= 1
        latest = frames.latest()
        assert latest is not None and latest.frame_number >= shown.frame_number


def test_the_daemon_answers_with_the_newest_frame_beyond_a_number(client: steradian.Client) -> None:
    def next_frame(after: int) -> steradian.Frame:
        answer = client.call("ViewService", "NextFrame", view="flat", encoding="JPEG", after_frame_number=after)
        return steradian.Frame.of(answer)

    first = next_frame(0)
    for step in range(10):
        revision = turn(client, 0.02 * step)
        client.render("flat")
    second = next_frame(first.frame_number)
    assert second.frame_number > first.frame_number and second.camera_revision == revision
    # Request a frame after a number beyond the newest one, as after a restart.
    assert next_frame(second.frame_number + 1000).frame_number >= second.frame_number


def test_one_loop_serves_several_views(client: steradian.Client) -> None:
    seen: dict[str, int] = {}
    with client.frames_of({"flat": "RGBA8", "dome": "JPEG"}) as loop:
        for frames in loop:
            assert frames
            for view, frame in frames.items():
                assert frame.view == view and frame.frame_number > seen.get(view, 0)
                assert frame.image().encoding == {"flat": "RGBA8", "dome": "JPEG"}[view]
                seen[view] = frame.frame_number
            turn(client, 0.01 * loop.received)
            if loop.received > 8 and len(seen) == 2:
                break
        latest = loop.latest()
        assert latest is not None and set(latest) == {"flat", "dome"}
    with client.frames_of(["flat", "eyes"], max_rate_hz=50.0) as loop:
        loop.next(PATIENCE_S)


def test_errors_are_raised_where_frames_are_taken(client: steradian.Client) -> None:
    with client.frames("none", reconnect=True) as frames:
        with pytest.raises(steradian.NotFound, match="the views are"):
            frames.next(PATIENCE_S)
        with pytest.raises(steradian.NotFound):
            frames.latest()
        with pytest.raises(steradian.NotFound):
            next(frames)
        assert frames.closed


def test_waiting_ends_by_time_and_by_close(client: steradian.Client) -> None:
    frames = client.frames("flat", max_rate_hz=0.01)
    frames.next(PATIENCE_S)
    with pytest.raises(TimeoutError):
        frames.next(0.05)
    ended: list[BaseException] = []

    def wait() -> None:
        try:
            frames.next()
        except steradian.Closed as closed:
            ended.append(closed)

    waiting = threading.Thread(target=wait)
    waiting.start()
    frames.close()
    waiting.join(PATIENCE_S)
    assert len(ended) == 1


def test_loops_leave_no_thread_and_end_with_their_client(shared: Daemon) -> None:
    before = {thread for thread in threading.enumerate() if thread.name.startswith("frames of")}
    client = steradian.Client(shared.address)
    loops = [client.frames("flat"), client.frames("dome", "JPEG")]
    for loop in loops:
        loop.next(PATIENCE_S)
    client.close()
    assert all(loop.closed for loop in loops)
    assert {thread for thread in threading.enumerate() if thread.name.startswith("frames of")} == before


def test_a_loop_continues_when_the_daemon_is_back(daemon: Daemon) -> None:
    with steradian.Client(daemon.address) as client:
        with client.frames("flat", reconnect=True) as frames, client.frames("flat") as strict:
            first = frames.next(PATIENCE_S)
            strict.next(PATIENCE_S)
            daemon.kill()
            until(lambda: frames.problem != "", "the loss is noticed")
            with pytest.raises(steradian.Unavailable):
                while True:
                    strict.next(PATIENCE_S)
            daemon.start()
            # A frame from before the restart may still be waiting.
            until(lambda: frames.reconnects == 1, "frames come again")
            again = frames.next(PATIENCE_S)
            assert again.render_time > first.render_time and frames.problem == ""
            assert again.image().data == first.image().data, "the scene is as it was"


def is_key(frame: steradian.Frame) -> bool:
    """Returns whether a picture of H.264 can be decoded without others: it has a slice of an IDR picture, the NAL
    unit type 5 (ITU-T H.264, table 7-1)."""
    units = frame.image().data.split(b"\0\0\1")[1:]
    return any(unit[0] & 31 == 5 for unit in units)


def test_only_the_first_picture_of_a_video_is_a_key_picture(client: steradian.Client) -> None:
    with client.frames("flat", "H264") as frames:
        pictures = []
        for step in range(13):
            pictures.append(frames.next(PATIENCE_S))
            # While the reader is busy, pictures that continue the last one must not be replaced.
            turn(client, 0.01 * step)
            client.render("flat")
        assert frames.skipped == 0
    assert [is_key(picture) for picture in pictures] == [True] + [False] * 12
    with client.frames_of({"flat": "H264", "dome": "H264"}) as both:
        keys: dict[str, list[bool]] = {"flat": [], "dome": []}
        step = 0
        while min(len(of) for of in keys.values()) < 4:
            for view, frame in both.next(PATIENCE_S).items():
                keys[view].append(is_key(frame))
            step += 1
            turn(client, 0.02 * step)
    assert all(of[0] and not any(of[1:]) for of in keys.values())
    # A loop also ends if its reader takes no frames.
    with client.frames("flat", "H264") as idle:
        until(lambda: idle.received == 1, "the first picture")


def test_a_daemon_that_hangs_is_noticed(daemon: Daemon) -> None:
    with steradian.Client(daemon.address) as client, client.frames("flat") as frames:
        frames.next(PATIENCE_S)
        daemon.hang()
        with pytest.raises(steradian.Unavailable):
            frames.next(PATIENCE_S)
        daemon.go_on()
        until(lambda: answers(client), "an answer after the daemon continues")


def answers(client: steradian.Client) -> bool:
    """Returns whether the daemon answers."""
    try:
        client.camera()
    except (steradian.Unavailable, steradian.DeadlineExceeded):
        return False
    return True


def test_clients_have_their_own_connections_over_sockets_too(tmp_path: Path) -> None:
    for listen in (f"unix:{tmp_path / 'with space'}", "127.0.0.1:0"):
        daemon = Daemon(tmp_path, listen=listen)
        clients = [steradian.Client(daemon.address) for _ in range(3)]
        try:
            assert [client.camera().revision for client in clients] == [0, 0, 0]
            stats = next(iter(clients[0].stats(0.1)))
            assert stats.message.connections == 3
        finally:
            for client in clients:
                client.close()
            daemon.kill()
