"""Measures the age of pictures that slow readers get, and the frame rate.

    python frame_ages.py --connect 127.0.0.1:7143 --view ahead

During the measurement, the camera turns with 20 poses per second for the ages and 200 for the rates. The age of a
picture is the time from the arrival of its pose at the daemon to the moment when the reader has it; daemon and reader
must share a clock. Prints tables in Markdown, and restores the camera.
"""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import steradian


@contextmanager
def turning(client: steradian.Client, rate_hz: float) -> Iterator[None]:
    """Turns the camera by half a turn per minute, and restores it afterwards."""
    start = client.camera()
    ends = threading.Event()

    def turn() -> None:
        step = 0
        while not ends.wait(1 / rate_hz):
            step += 1
            turned = steradian.quaternion([0, 1, 0], 0.052 * step / rate_hz)
            steer(orientation=steradian.multiply(start.orientation, turned))

    steer = client.steer(holder="frame_ages.py")
    thread = threading.Thread(target=turn)
    thread.start()
    try:
        # While the camera is at rest, its pose is old: it does not show how old the pictures are. Wait for the first
        # movement.
        while client.camera().revision == start.revision and thread.is_alive():
            time.sleep(0.01)
        yield
    finally:
        ends.set()
        thread.join()
        # Restore the camera and release the lease after any failure.
        steer(start)
        steer.close()


def greatest_age_s(take: Callable[[], steradian.Frame], period_s: float, frames: int) -> float:
    """Returns the maximum age of `frames` pictures, s, for a reader that pauses for `period_s` after each."""
    ages = []
    for _ in range(frames):
        frame = take()
        ages.append(time.time() - frame.pose_time.timestamp())
        time.sleep(period_s)
    return max(ages)


def print_ages(client: steradian.Client, view: str, encoding: str, periods_s: Sequence[float], frames: int) -> None:
    """Prints a row for each way to read frames, and a column for each pause."""
    print(f"| reader, {encoding} | " + " | ".join(f"{period_s:g} s" for period_s in periods_s) + " |")
    print("|---" * (len(periods_s) + 1) + "|")
    seen = 0

    def call() -> steradian.Frame:
        nonlocal seen
        answer = client.call("ViewService", "NextFrame", view=view, encoding=encoding, after_frame_number=seen)
        frame = steradian.Frame.of(answer)
        seen = frame.frame_number
        return frame

    with turning(client, 20.0):
        with client.frames(view, encoding) as loop:
            ages = [greatest_age_s(loop.next, period_s, frames) for period_s in periods_s]
        print("| `client.frames` | " + " | ".join(f"{age:.2f} s" for age in ages) + " |", flush=True)
        ages = [greatest_age_s(call, period_s, frames) for period_s in periods_s]
        print("| `NextFrame`, one call at a time | " + " | ".join(f"{age:.2f} s" for age in ages) + " |", flush=True)


def print_rates(client: steradian.Client, view: str, encodings: Sequence[str], seconds: float) -> None:
    """Prints a row for each encoding."""
    print("| `client.frames` | frames/s | MB/s | skipped |\n|---|---|---|---|")
    for encoding in encodings:
        with turning(client, 200.0), client.frames(view, encoding) as loop:
            loop.next()
            begun, count, size = time.monotonic(), 0, 0
            while time.monotonic() < begun + seconds:
                frame = loop.next()
                count += 1
                size += sum(len(image.data) for image in frame.images)
            spent = time.monotonic() - begun
            skipped = loop.skipped
        print(f"| {encoding} | {count / spent:.1f} | {size / spent / 1e6:.1f} | {skipped} |", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the program."""
    parser = argparse.ArgumentParser(description="Measures ages and rates of frames.")
    parser.add_argument("--connect", default="127.0.0.1:7143", help="address of the daemon")
    parser.add_argument("--view", required=True, help="the view")
    parser.add_argument("--encoding", default="JPEG", help="encoding of the pictures whose age is measured")
    parser.add_argument("--periods", type=float, nargs="*", default=[0.5, 2.0, 10.0], help="pauses of the readers, s")
    parser.add_argument("--frames", type=int, default=10, help="pictures of each reader")
    parser.add_argument("--rates", nargs="*", default=["JPEG", "RGB32F"], help="encodings whose rate is measured")
    parser.add_argument("--seconds", type=float, default=10.0, help="duration of each rate measurement, s")
    given = parser.parse_args(arguments)
    with steradian.Client(given.connect) as client:
        info = client.info()
        print(f"{info.adapter}, {info.driver}, view {given.view}\n")
        if given.periods:
            print_ages(client, given.view, given.encoding, given.periods, given.frames)
            print()
        if given.rates:
            print_rates(client, given.view, given.rates, given.seconds)


if __name__ == "__main__":
    try:
        main()
    except (steradian.SteradianError, ValueError) as error:
        sys.exit(f"error: {error}")
