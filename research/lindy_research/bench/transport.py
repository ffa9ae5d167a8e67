"""What separate processes cost over Zenoh, beside Zenoh with its own threads, pyzmq and bare
sockets: one neutral chain of five processes and three listeners (transport_chain.py)."""

import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np

import services
from lindy_research.bench.costs import Cost, costs, total
from lindy_research.bench.table import Figure
from lindy_research.bench.transport_chain import HEARS, HZ
from services.runtime.bus.zenoh_bus import ONE_THREAD, VARIABLE
from services.runtime.hosts.process_host import HubLaunch

DEFAULT_THREADS = {VARIABLE: "()"}  # nothing set: Zenoh's own five pools
SETTLE_S, WINDOW_S, REST_S = 1.5, 8.0, 0.3
OTHERS: dict[str, tuple[str, dict[str, str]]] = {
    "default threads": ("zenoh", DEFAULT_THREADS),
    "pyzmq, ipc": ("zmq", {}),
    "unix sockets": ("sockets", {}),
}
GOALS = {"p50": 1.0, "cpu": 0.85, "switches": 0.6}  # ratios to Zenoh's default threads


@dataclass(frozen=True, slots=True)
class Run:
    delays: list[float]  # [ms] of the four hops
    cost: Cost  # of all processes, a hub included
    lost: int  # messages of the four streams, at the recorder and at the sink


def figures() -> list[Figure]:
    ours = run("zenoh", {VARIABLE: ONE_THREAD})
    return [
        figure
        for other, (transport, environment) in OTHERS.items()
        for figure in _beside(ours, other, transport, environment)
    ]


def run(transport: str, environment: Mapping[str, str]) -> Run:
    """The chain over one transport, some ten seconds."""
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        workers = dict[str, subprocess.Popen[str]]()
        try:
            if transport == "zenoh":
                workers["hub"] = _hub(folder, environment)
            for role in HEARS:
                command = [sys.executable, "-P", "-m", "lindy_research.bench.transport_chain"]
                workers[role] = _start([*command, role, transport, folder], environment)
            for role in HEARS:
                assert _line(workers[role]) == "ready\n"
            return _measured(workers)
        finally:
            for process in workers.values():
                process.kill()
                process.communicate()


def _measured(workers: Mapping[str, subprocess.Popen[str]]) -> Run:
    time.sleep(REST_S)  # subscriptions are not known to everybody at once
    source = workers["source"].stdin
    assert source is not None
    source.write("go\n")
    source.flush()
    time.sleep(SETTLE_S)
    cost = total(costs({name: process.pid for name, process in workers.items()}, WINDOW_S))
    said = _end(workers["source"])["said"]
    time.sleep(REST_S)  # until the last has arrived
    sink, recorder = _end(workers["sink"]), _end(workers["recorder"])
    lost = sum(said - n for n in recorder["heard"].values()) + said - len(sink["delays"])
    return Run(sink["delays"][round(HZ * SETTLE_S) :], cost, lost)


def _start(command: list[str], environment: Mapping[str, str]) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, stdin=pipe, stdout=pipe, text=True, env=os.environ | dict(environment)
    )


def _hub(folder: str, environment: Mapping[str, str]) -> subprocess.Popen[str]:
    launch = HubLaunch(listen=[f"unixsock-stream/{folder}/hub.sock"], supervised=True)
    text = msgspec.json.encode(launch).decode()
    hub = _start([sys.executable, "-P", "-m", services.__name__, "hub", text], environment)
    while not Path(folder, "hub.sock").exists():
        time.sleep(0.02)  # it does not announce itself
        if hub.poll() is not None:
            raise RuntimeError("the hub has ended")
    return hub


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def _end(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdin is not None
    process.stdin.close()
    answer = json.loads(_line(process))
    process.stdin = None  # for `communicate`
    return answer


def _beside(
    ours: Run, other: str, transport: str, environment: Mapping[str, str]
) -> Iterator[Figure]:
    if transport == "zmq" and importlib.util.find_spec("zmq") is None:
        yield Figure(
            section="transport", name="beside pyzmq", unit="", note="skipped: no pyzmq here"
        )
        return
    theirs = run(transport, environment)
    ours_lost, lost = f"lost {ours.lost}", f"there {theirs.lost}"
    rows = {
        "p50": ("four hops p50", "ms", _percentile(ours, 50), _percentile(theirs, 50)),
        "p99": ("four hops p99", "ms", _percentile(ours, 99), _percentile(theirs, 99)),
        "cpu": ("CPU", "%", ours.cost.cpu, theirs.cost.cpu),
        "system": ("of it system", "%", ours.cost.system, theirs.cost.system),
        "switches": ("voluntary switches", "1/s", ours.cost.switches, theirs.cost.switches),
        "rss": ("memory", "MB", ours.cost.rss_mb, theirs.cost.rss_mb),
    }
    for key, (name, unit, our_value, their_value) in rows.items():
        yield Figure(
            section="transport", name=name, unit=unit, ours=our_value,
            baseline_name=other, baseline=their_value,
            goal=GOALS.get(key) if environment else None,
            note=f"{ours_lost}, {lost}" if key == "p50" else "",
        )  # fmt: skip


def _percentile(run: Run, percent: float) -> float:
    return float(np.percentile(run.delays, percent)) if run.delays else float("inf")
