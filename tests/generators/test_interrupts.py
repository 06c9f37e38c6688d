"""What the signals do by which users, Slurm and Docker ask a program to end."""

import importlib
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from typer.testing import CliRunner

import fgf_warp.renderer
from generators import interrupts
from generators.checking.verify import verify_dataset
from generators.cli import app
from generators.dataset.reader import Dataset
from generators.interrupts import SIGNALS, handlers_kept, held_back, listening, unheard
from tests.generators.small_plan import content, write_config

SECOND = """
import os, signal, time
from generators.interrupts import listening
with listening():
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)
    except KeyboardInterrupt:
        print("first", flush=True)
        time.sleep(60)
"""


@pytest.fixture(autouse=True)
def handlers():
    """A process that was started in the background may ignore the signals."""
    with handlers_kept():
        for number in SIGNALS:
            signal.signal(number, signal.default_int_handler)
        yield


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_signal_is_an_interrupt(number):
    with listening(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(number)
        time.sleep(1)
    assert signal.getsignal(number) is signal.default_int_handler


def test_one_that_is_sent_twice_at_once_is_one():
    with listening():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)
        time.sleep(0.05)


def test_the_second_ends_the_program_at_once():
    with subprocess.Popen([sys.executable, "-c", SECOND], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "first\n"
        time.sleep(2 * interrupts.SAME_SECONDS)
        process.send_signal(signal.SIGHUP)
        assert process.wait(timeout=20) == 128 + signal.SIGHUP


def test_what_is_ignored_stays_so():
    """As under nohup."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with listening():
        signal.raise_signal(signal.SIGHUP)
        time.sleep(0.05)


def test_only_the_main_thread_listens():
    heard = []

    def listen():
        with listening():
            heard.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=listen)
    thread.start()
    thread.join()
    assert heard == [signal.default_int_handler]


def test_the_last_work_of_a_run_is_not_cut_off():
    with listening():
        with held_back():
            signal.raise_signal(signal.SIGTERM)
            time.sleep(0.05)
        time.sleep(0.05)


def test_an_import_is_not_cut_in_two(tmp_path, monkeypatch):
    lines = "import signal, time\nsignal.raise_signal(signal.SIGTERM)\ntime.sleep(0.2)\nwhole = True\n"
    (tmp_path / "imported_meanwhile.py").write_text(lines)
    monkeypatch.syspath_prepend(tmp_path)
    with listening(), pytest.raises(KeyboardInterrupt):
        importlib.import_module("imported_meanwhile")
        time.sleep(5)
    assert sys.modules["imported_meanwhile"].whole


def test_workers_never_hear_them():
    script = "import time\nprint('there', flush=True)\ntime.sleep(60)"
    with unheard():
        process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "there\n"
    for number in SIGNALS:
        process.send_signal(number)
    time.sleep(0.2)
    assert process.poll() is None
    process.kill()
    process.communicate()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []).isdisjoint(SIGNALS)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_stopped_run_publishes_what_it_has_and_goes_on(tmp_path, fake_renderer, monkeypatch, number):
    advance = fgf_warp.renderer.advance

    def stop_at_the_third(*arguments):
        for image in advance(*arguments):
            if len(fake_renderer) == 2:
                os.kill(os.getpid(), number)
                time.sleep(30)
            yield image

    command = ["generate", str(write_config(tmp_path)), "--out", str(tmp_path / "data")]
    monkeypatch.setattr(fgf_warp.renderer, "advance", stop_at_the_third)
    stopped = CliRunner().invoke(app, command)
    assert stopped.exit_code == 3, stopped.output
    assert "stopped at 2 of 6; the same command goes on from here" in stopped.stderr
    assert not verify_dataset(Dataset(tmp_path / "data")).is_damaged
    assert (tmp_path / "data/README.md").is_file()
    monkeypatch.setattr(fgf_warp.renderer, "advance", advance)
    assert CliRunner().invoke(app, command).exit_code == 0
    assert CliRunner().invoke(app, [*command[:-1], str(tmp_path / "whole")]).exit_code == 0
    assert content(tmp_path / "data") == content(tmp_path / "whole")


def test_a_signal_while_labels_are_written_does_not_stop_that(tmp_path, fake_renderer, monkeypatch):
    from generators.running import run

    publish = run.publish

    def publish_late(dataset):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.05)
        publish(dataset)

    monkeypatch.setattr(run, "publish", publish_late)
    outcome = CliRunner().invoke(app, ["generate", str(write_config(tmp_path)), "--out", str(tmp_path / "data")])
    assert outcome.exit_code == 0, outcome.output
    assert verify_dataset(Dataset(tmp_path / "data")).is_whole


def test_every_command_says_that_it_was_stopped(monkeypatch):
    def be_stopped(*_, **__):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(30)

    monkeypatch.setattr("generators.law.evaluate_law", be_stopped)
    outcome = CliRunner().invoke(app, ["law", "--H", "-0.25", "--S_w", "1", "--sigma_m", "1"])
    assert outcome.exit_code == 3
    assert outcome.stderr == "error: stopped before the end; what is written is whole\n"


DURING_IMPORTS = """
import signal, sys
class Finder:
    def find_spec(self, name, *_):
        if name == "typer":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Finder())
signal.signal(signal.SIGINT, signal.default_int_handler)
from generators.entry import main
main()
"""


def test_before_it_listens_a_program_ends_without_a_word():
    done = subprocess.run([sys.executable, "-c", DURING_IMPORTS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
