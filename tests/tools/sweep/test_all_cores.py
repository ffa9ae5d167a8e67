"""Jobs on all cores: each once, in fresh processes that never outlive the one that began them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from tests.support.patience import until
from tools.sweep.all_cores import asked_to_stop, on_all_cores

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]


def square(number: int) -> int:
    return number * number


def fail(number: int) -> int:
    raise ValueError(f"no {number}")


def until_stopped(number: int) -> int:
    while not asked_to_stop():
        time.sleep(0.01)  # what a long job does between two looks
    return number


def test_each_job_is_done_once():
    found = [result for result in on_all_cores(square, range(20), 2) if result is not None]
    assert sorted(found) == [(n, n * n) for n in range(20)]


def test_an_error_in_a_job_is_raised():
    with pytest.raises(ValueError, match="no 1"):
        list(on_all_cores(fail, [1], 1))


def die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_worker_is_one_sentence():
    with pytest.raises(LindyError, match="a worker process was killed, perhaps because"):
        list(on_all_cores(die, range(3), 2))


def test_asked_to_stop_it_ends_with_the_jobs_at_hand():
    """Of a thousand jobs, those that a worker has taken are finished and no others begun."""
    began = time.monotonic()
    results = on_all_cores(until_stopped, range(1000), 2, lambda: time.monotonic() > began + 2.0)
    found = [result for result in results if result is not None]
    assert 1 <= len(found) < 20


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("late", [False, True], ids=["while they start", "at work"])
def test_a_signal_to_the_whole_process_group_is_one_interruption(
    number: signal.Signals, late: bool, tmp_path: Path
):
    """As a terminal sends Ctrl-C: no worker says anything."""
    program = (
        "import sys\n"
        "from tests.tools.sweep.test_all_cores import tell_until_stopped\n"
        "from tools.live.stop_signals import StopSignals\n"
        "from tools.sweep.all_cores import on_all_cores\n"
        "if __name__ == '__main__':\n"
        "    with StopSignals() as stop:\n"
        "        print('begun', flush=True)\n"
        "        jobs = [sys.argv[1]] * 100\n"
        "        list(on_all_cores(tell_until_stopped, jobs, 2, lambda: stop.asked))\n"
        "    print('interrupted' if stop.asked else 'done')\n"
    )
    script, told = tmp_path / "program.py", tmp_path / "pid"
    script.write_text(program)
    parent = subprocess.Popen(
        [sys.executable, str(script), str(told)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert parent.stdout is not None
    assert parent.stdout.readline() == "begun\n"
    if late:
        _awaited(told)
    else:
        time.sleep(0.3)  # some moment of the workers' start
    os.killpg(parent.pid, number)
    assert parent.communicate() == ("interrupted\n", "")
    assert parent.returncode == 0


def tell_until_stopped(told: str) -> None:
    Path(told).touch()
    until_stopped(0)


def test_workers_end_when_their_parent_is_killed(tmp_path: Path):
    program = (
        "import os, sys, time\n"
        "from tests.tools.sweep.test_all_cores import tell_and_wait\n"
        "from tools.sweep.all_cores import on_all_cores\n"
        "if __name__ == '__main__':\n"
        "    list(on_all_cores(tell_and_wait, [sys.argv[1]], 1))\n"
    )
    script, told = tmp_path / "program.py", tmp_path / "pid"
    script.write_text(program)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    parent = subprocess.Popen([sys.executable, str(script), str(told)], env=environment)
    try:
        worker = int(_awaited(told))
    finally:
        parent.kill()
        parent.wait()
    until(lambda: not _runs(worker))


def tell_and_wait(told: str) -> None:
    part = Path(f"{told}.part")
    part.write_text(str(os.getpid()))
    part.rename(told)
    while True:
        time.sleep(1.0)  # a job that never looks whether to stop


def _awaited(told: Path) -> str:
    until(told.exists)  # the worker's only sign of life
    return told.read_text()


def _runs(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
