"""Estimates photos on a local Ray cluster of two nodes, one of which is killed in the middle, and measures throughput.

    python checks/ray_workers.py PHOTOS [--kill worker|node] [--throughput] [--expected FOLDER]

It needs the package with Ray, `pip install './python[ray]'`. PHOTOS is a folder. The results are compared with those of
the command `batch` in one process, which are kept in FOLDER.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

# Agents of the nodes start slowly on a busy machine.
os.environ.setdefault("RAY_agent_register_timeout_ms", "300000")

import ray
import ray.data
from ray.cluster_utils import Cluster

import lightoctree.ray

warnings.simplefilter("ignore")


def rss_mib() -> float:
    """Resident memory of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024


def workers() -> list[int]:
    """Processes that estimate photos, by their titles."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            title = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if title.startswith(b"ray::") and b"Estimate" in title and int(process.name) != os.getpid():
            found.append(int(process.name))
    return found


def run(photos: Path, output: Path, actors: int, kill: object = None) -> tuple[list[dict[str, object]], list[float]]:
    """Estimates all photos, and returns their rows with the time of each."""
    results = lightoctree.ray.photos(str(photos)).map_batches(
        lightoctree.ray.Estimate,
        fn_constructor_kwargs={"root": str(photos), "output": str(output)},
        batch_size=1,
        num_cpus=1,
        compute=ray.data.ActorPoolStrategy(size=actors),
    )
    rows: list[dict[str, object]] = []
    times: list[float] = []
    memory: list[float] = []
    for row in results.iter_rows():
        rows.append(row)
        times.append(time.monotonic())
        memory.append(rss_mib())
        if callable(kill) and len(rows) == 40:
            kill()
    quarter = len(memory) // 4
    print(f"  driver: {memory[quarter]:.0f} MiB after a quarter, {memory[-1]:.0f} MiB at the end", flush=True)
    return rows, times


def rate(times: list[float]) -> float:
    """Photos per second, without the first ones, which wait for the start of the workers."""
    begin = min(20, len(times) // 4)
    return (len(times) - 1 - begin) / (times[-1] - times[begin])


def contents(folder: Path) -> dict[str, bytes]:
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*.scene")}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("photos", type=Path)
    parser.add_argument("--kill", choices=["worker", "node"])
    parser.add_argument("--throughput", action="store_true")
    parser.add_argument("--expected", type=Path)
    args = parser.parse_args()
    photos = args.photos.resolve()
    folder = Path(tempfile.mkdtemp())
    one_process = args.expected or folder / "expected"
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
    try:
        ray.init(address=cluster.address, log_to_driver=False)
        context = ray.data.DataContext.get_current()
        context.enable_progress_bars = False
        if args.throughput:
            rates = []
            for actors in (1, 2):
                _, times = run(photos, folder / str(actors), actors)
                rates.append(rate(times))
                print(f"{actors} workers: {rates[-1]:.2f} photos per second, load {os.getloadavg()[0]:.1f}", flush=True)
            print(f"ratio {rates[1] / rates[0]:.2f}")
        if args.kill:
            program = Path(sys.executable).with_name("lightoctree")
            subprocess.run([program, "batch", photos, "-o", one_process, "--quiet"], check=True)
            expected = contents(one_process)

            def kill() -> None:
                if args.kill == "worker":
                    os.kill(workers()[0], signal.SIGKILL)
                else:
                    cluster.remove_node(nodes.pop(), allow_graceful=False)
                    nodes.append(cluster.add_node(num_cpus=1))
                print(f"  killed a {args.kill}", flush=True)

            rows, _ = run(photos, folder / "killed", 2, kill)
            paths = [str(row["path"]) for row in rows]
            assert len(paths) == len(set(paths)) == len(expected), (len(paths), len(set(paths)), len(expected))
            assert all(row["error"] is None for row in rows)
            assert contents(folder / "killed") == expected
            leftovers = [file for file in (folder / "killed").rglob(".*") if file.is_file()]
            kept = sum(bool(row["kept"]) for row in rows)
            print(f"{len(paths)} photos, each once, with the bytes of one process; {kept} were done by a killed worker")
            print(f"before it could report them; {len(leftovers)} temporary files are left")
    finally:
        ray.shutdown()
        cluster.shutdown()  # type: ignore[no-untyped-call]
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
