"""The process in which torch runs: what starts it, how it ends, and what it says when it fails."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.recipe import TrainingError
from jmm_agent.mapping.torch_process import TorchProcess, shared
from tests.jmm_agent.small_map import make_map, postures

ROOT = Path(__file__).resolve().parents[3]
CALLS = "tests.jmm_agent.mapping.torch_calls"

TRAINING = """
import sys
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import train
from tests.jmm_agent.straight_muscles import nominal_model
quick = Recipe(hidden=20, samples=500, steps=2)
print("error", train(nominal_model(), 0, quick)[1].groups["tip"].validation_rmse)
print("torch" in sys.modules)
"""


def runs(process: int) -> bool:
    """Whether a process runs; a zombie does not."""
    try:
        os.kill(process, 0)
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return state != "Z"


def ends(process: int, within: float = 10.0) -> bool:
    """Whether a process ends within some time [s]."""
    last = time.monotonic() + within
    while runs(process) and time.monotonic() < last:
        time.sleep(0.05)
    return not runs(process)


def python(*arguments: str, stdin: str = "", cwd: Path = ROOT) -> str:
    """Standard output of a Python that finds this checkout."""
    done = subprocess.run(
        [sys.executable, *arguments],
        input=stdin,
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_call_returns_a_result_and_reports_shares() -> None:
    shares: list[float] = []
    with TorchProcess() as process:
        result, number = process.call(f"{CALLS}:answer", 21, progress=shares.append)
        assert result == 42
        assert number == process.process_id != os.getpid()
        assert shares == [0.5, 1.0]
        assert process.call(f"{CALLS}:threads") == (1, False)
    assert process.process_id is None
    assert ends(number)


@pytest.mark.parametrize(
    "kind", ["script", "standard input", "interactive", pytest.param("-c", marks=pytest.mark.slow)]
)
def test_programs_without_a_guard_can_train(kind: str, tmp_path: Path) -> None:
    # In a folder whose files have names of modules that torch and this package import.
    for name in ("types", "random", "torch", "jmm_agent"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not this one')\n")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "program.py").write_text(TRAINING)
    if kind == "script":
        output = python(str(elsewhere / "program.py"), cwd=tmp_path)
    elif kind == "standard input":
        output = python("-", stdin=TRAINING)
    elif kind == "interactive":
        output = python("-i", "-q", stdin=TRAINING)
    else:
        output = python("-c", TRAINING)
    error, torch = output.split("\n")[:2]
    assert 0.0 < float(error.removeprefix("error ")) < 0.1
    assert torch == "False"


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        ("refuse", r"^The rate is too high\.$"),
        ("fail", r"^Training: RuntimeError: .*size.*\.$"),
        ("kill", r"^Training: the process that runs torch was killed by signal 9\.$"),
        ("leave", r"^Training: the process that runs torch ended with exit code 3\.$"),
        ("missing", r"^Training: AttributeError: .*'missing'\.$"),
    ],
)
def test_a_failure_is_one_sentence_and_the_next_call_works(call: str, sentence: str) -> None:
    with TorchProcess() as process:
        with pytest.raises(TrainingError, match=sentence) as caught:
            process.call(f"{CALLS}:{call}")
        assert "\n" not in str(caught.value)
        assert process.call(f"{CALLS}:answer", 1)[0] == 2


def test_torch_that_cannot_be_imported_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "torch.py").write_text("raise ImportError('libtorch.so: not found')\n")
    monkeypatch.syspath_prepend(tmp_path)
    with TorchProcess() as process, pytest.raises(TrainingError, match=r"libtorch\.so: not found"):
        process.call("jmm_agent.networks.fit:fit")


def test_an_interpreter_that_cannot_be_started_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(TrainingError, match=r"could not be started: .*/nowhere/python"):
        TorchProcess().call(f"{CALLS}:answer", 1)


class Stop(Exception):
    """What interrupts a call."""


@pytest.mark.parametrize("error", [Stop, KeyboardInterrupt, OSError])
def test_an_interrupted_call_ends_the_process(error: type[BaseException]) -> None:
    numbers: list[int] = []

    def interrupt(share: float) -> None:
        assert process.process_id is not None
        numbers.append(process.process_id)
        raise error

    process = TorchProcess()
    with pytest.raises(error):
        process.call(f"{CALLS}:work", progress=interrupt)
    assert process.process_id is None
    assert ends(numbers[0])
    assert process.call(f"{CALLS}:answer", 1)[0] == 2
    process.close()


PARENT = """
import sys
from jmm_agent.mapping.torch_process import TorchProcess
process = TorchProcess()
process.call("tests.jmm_agent.mapping.torch_calls:answer", 1)
print(process.process_id, flush=True)
{then}
"""


@pytest.mark.parametrize("then", ["work", "silent", ""])
def test_the_process_ends_with_the_program_that_started_it(then: str) -> None:
    """Killed while the process works, with and without reports, or at the end of the program."""
    call = f"process.call('{CALLS}:{then}')" if then else ""
    program = subprocess.Popen(
        [sys.executable, "-c", PARENT.format(then=call)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert program.stdout is not None
    number = int(program.stdout.readline())
    if then:
        assert runs(number)
        program.send_signal(signal.SIGKILL)
    program.communicate()
    assert ends(number)


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_a_process_of_its_own() -> None:
    number = shared().call(f"{CALLS}:answer", 1)[1]
    reader, writer = os.pipe()
    forked = os.fork()
    if forked == 0:
        try:
            os.write(writer, str(shared().call(f"{CALLS}:answer", 2)[1]).encode())
        finally:
            os._exit(0)  # whatever happens, this is not the process of the tests
    os.waitpid(forked, 0)
    os.close(writer)
    others = int(os.read(reader, 20))
    os.close(reader)
    assert others != number
    assert ends(others)
    assert shared().call(f"{CALLS}:answer", 3) == (6, number)
    shared().close()


def test_calls_of_several_threads_do_not_mix() -> None:
    found: dict[int, int] = {}
    with TorchProcess() as process:

        def ask(number: int) -> None:
            for _ in range(20):
                found[number] = process.call(f"{CALLS}:answer", number)[0]

        threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert found == {number: 2 * number for number in range(4)}


def test_the_papers_rule_repeats_its_bits_in_a_new_process() -> None:
    start, q = make_map(), postures(10, 3)
    pairs = Pairs(q, start.lengths(q) + 0.01, np.full(10, 1e-3))
    moved = []
    for _ in range(2):
        moved.append(MinibatchRule().move(start, Pairs.none(4, 5), pairs))
        shared().close()
    for one, other, before in zip(*(jmm.groups for jmm in (*moved, start)), strict=True):
        for name, layer in one.layers._asdict().items():
            np.testing.assert_array_equal(layer, getattr(other, name))
            assert np.abs(layer - getattr(before, name)).max() > 0.0
