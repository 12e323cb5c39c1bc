"""Events, interruption, threads and processes."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import lightoctree
from lightoctree import Event, LightOctreeWarning, Scene


def test_events_arrive_in_order(photo: Path, depth: Path) -> None:
    events: list[Event] = []
    lightoctree.estimate(photo, depth=depth, on_event=events.append)
    begun = [event.stage for event in events if event.kind == "begun"]
    done = [event.stage for event in events if event.kind == "done"]
    assert begun and sorted(map(str, begun)) == sorted(map(str, done))
    assert all(event.seconds is not None and event.seconds >= 0 for event in events if event.kind == "done")


def test_exceptions_of_the_handler_cancel(photo: Path) -> None:
    seen: list[Event] = []

    def stop(event: Event) -> None:
        seen.append(event)
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        lightoctree.estimate(photo, on_event=stop)
    assert len(seen) == 1


def test_warnings_that_are_errors_cancel(photo: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", LightOctreeWarning)
        with pytest.raises(LightOctreeWarning, match="depth is predicted"):
            lightoctree.estimate(photo)


def test_threads_give_the_same_bytes(photo: Path, depth: Path, scene_file: Path, scene: Scene) -> None:
    expected = (scene_file.read_bytes(), scene.environment((0, 0, -1), (64, 32)))

    def work(_: int) -> tuple[bytes, NDArray[np.float32]]:
        shared = scene.environment((0, 0, -1), (64, 32))
        return lightoctree.estimate(photo, depth=depth).to_bytes(), shared

    with ThreadPoolExecutor(4) as pool:
        for data, panorama in pool.map(work, range(4)):
            assert data == expected[0] and np.array_equal(panorama, expected[1])


def test_the_interpreter_is_free_meanwhile(photo: Path) -> None:
    is_done = threading.Event()
    ticks = 0

    def tick() -> None:
        nonlocal ticks
        while not is_done.wait(0.005):
            ticks += 1

    ticker = threading.Thread(target=tick)
    ticker.start()
    start = time.monotonic()
    lightoctree.estimate(photo)
    took = time.monotonic() - start
    is_done.set()
    ticker.join()
    # A busy machine may delay the thread, the interpreter must not.
    assert ticks > took / 0.1


INTERRUPTED = """
import signal, sys, time
import lightoctree

# A shell's background jobs ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)

def on_event(event):
    if event.kind == "begun":
        print("begun", flush=True)

begin = time.monotonic()
try:
    while time.monotonic() < begin + 60:
        lightoctree.estimate(sys.argv[1], on_event=on_event)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    # Works again.
    print(len(lightoctree.estimate(sys.argv[1], depth=sys.argv[2]).to_bytes()), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends a POSIX signal")
def test_ctrl_c_interrupts_within_a_fifth_of_a_second(photo: Path, depth: Path, scene_file: Path) -> None:
    delays = []
    # A busy machine may delay one of them.
    for attempt in range(3):
        process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", INTERRUPTED, photo, depth], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.15 * attempt)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        while (line := process.stdout.readline()) == "begun\n":
            pass
        delays.append(time.monotonic() - sent)
        assert line == "interrupted\n"
        assert int(process.stdout.readline()) == len(scene_file.read_bytes())
        assert process.wait() == 0
        process.stdout.close()
    print(f"delays: {', '.join(f'{1000 * delay:.0f} ms' for delay in delays)}")
    assert min(delays) < 0.2, delays


FORKED = """
import os, sys
import lightoctree

scene = lightoctree.Scene.load(sys.argv[1])
scene.environment((0, 0, -1), (8, 4))
if child := os.fork():
    os._exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
try:
    scene.environment((0, 0, -1), (8, 4))
except RuntimeError as error:
    os._exit(7 if "spawn" in str(error) else 8)
os._exit(9)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system does not fork")
def test_forked_processes_are_told_to_spawn(scene_file: Path) -> None:
    # Without the check, the child would wait for threads that it does not have.
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORKED, scene_file], timeout=60, check=False)
    assert done.returncode == 7


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("is_terminal", [True, False])
def test_bars_appear_on_terminals(is_terminal: bool, photo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stderr = Terminal() if is_terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stderr)
    lightoctree.estimate(photo)
    assert ("network" in stderr.getvalue()) == is_terminal


def test_bars_follow_the_events() -> None:
    from lightoctree._progress import Bars

    made: list[FakeBar] = []

    class FakeBar:
        def __init__(self, **options: object) -> None:
            self.options, self.n, self.total, self.closed = options, 0, options["total"], False
            self.bar_format: object = options["bar_format"]
            made.append(self)

        def update(self, steps: int) -> None:
            self.n += steps

        def close(self) -> None:
            self.closed = True

    make: Callable[..., object] = FakeBar
    bars = Bars(make)
    for event in (
        Event("begun", "depth"),
        Event("progress", "depth", done=2, total=8),
        Event("progress", "depth", done=5, total=8),
        Event("warning", message="dark"),
    ):
        bars(event)
    assert [(bar.options["desc"], bar.n, bar.total, bar.closed) for bar in made] == [("depth", 5, 8, False)]
    assert made[0].bar_format is None
    bars(Event("done", "depth", seconds=1))
    bars(Event("begun", "light"))
    bars.close()
    assert [bar.closed for bar in made] == [True, True]
