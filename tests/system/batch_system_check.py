#!/usr/bin/env python3
"""Runs campaigns by `proofmass factory` on PBS and HTCondor, both played by batch_system_mock.py.

Coordinator, workers and factory are the real programs; the mock starts what is submitted. On each
of the two batch systems, at the same time:

- the workers of a factory do not start: it pauses, and `status` says why; one that is to end when
  all is done ends with an error;
- the first submissions of another one are refused as by a full queue; it waits, and goes on;
- it is started again, and finds what it had submitted;
- a worker is told to leave, as when its node is needed; another one takes its place;
- the batch system cannot be reached for a while;
- two allocations are held and never start: when there is no more work the factory cancels them, of
  which one cannot be cancelled.

The digest must be that of `proofmass run`. Factories wait for minutes: libfaketime moves their
clocks.
Exit code 0 if all holds, 1 if not; 77 without libfaketime, but 1 if the environment has CI.
"""

import concurrent.futures
import contextlib
import json
import re
import signal
import tempfile
import threading
import time
from pathlib import Path

import batch_system_mock as mock
import checking
from checking import check, wait_until
from slurm_check import Site, free_ports

NUM_RUNS = 300
INTERVAL_S = 600  # So long that no factory looks by itself.
# What `status` says before the coordinator is there.
NOTHING = {"factories": [], "campaigns": [], "num_workers": 0}


def faketime_library():
    found = list(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
    return found[0] if found else None


def said(program, answer, *names):
    """How a factory quotes a command that failed."""
    text, code = answer
    return f"{program}: exit code {code}: {text.format(*names)}"


class System:
    """The words of a batch system: numbers of allocations, and how a factory quotes its errors."""

    def __init__(self, name, form, refused, down, kept):
        self.name = name
        self.form = form
        self.refused = said(*refused)
        self.down = said(*down)
        self.answer_kept = kept

    def identifier(self, number):
        return self.form.format(number)

    def kept(self, number):
        return said(*self.answer_kept, self.identifier(number))


SYSTEMS = (
    # The factory asks PBS by a script of sh.
    System("pbs", "{}.head", ("qsub", mock.PBS_FULL), ("sh", mock.PBS_DOWN, "qselect"),
           ("qdel", mock.PBS_KEPT)),
    System("condor", "{}.0", ("condor_submit", mock.CONDOR_FULL), ("condor_q", mock.CONDOR_DOWN),
           ("condor_rm", mock.CONDOR_KEPT)),
)


class Batch:
    """A batch system, a coordinator, and the factories that work for it."""

    def __init__(self, system, directory, programs, port):
        self.system = system
        self.queue = mock.Queue(directory / "batch", system.name, programs)
        self.site = Site(self.queue, directory / "site", programs, NUM_RUNS)
        self.workers = f"tcp://127.0.0.1:{port}"
        self.clients = ("--connect", f"tcp://127.0.0.1:{port + 1}")
        self.is_over = False

    @contextlib.contextmanager
    def running(self):
        def play():
            while not self.is_over:
                self.queue.turn()
                time.sleep(0.02)

        thread = threading.Thread(target=play)
        thread.start()
        try:
            yield
        finally:
            self.is_over = True
            thread.join()
            self.queue.close()

    def coordinator(self):
        (self.site.directory / "served").mkdir()
        return self.site.started(
            "coordinator.log",
            *("proofmass-coordinator", "--directory", "served", "short.toml"),
            *("--bind", self.workers, "--bind-clients", self.clients[1]),
        )

    def ask(self, *command):
        return self.site.proofmass(*command, *self.clients)

    def status(self):
        answer = self.site.answer("proofmass", "status", "--json", *self.clients)
        return json.loads(answer.stdout) if answer.stdout else NOTHING

    def num_done(self):
        return sum(campaign["num_done"] for campaign in self.status()["campaigns"])

    def num_open(self):
        campaigns = self.status()["campaigns"]
        return sum(campaign["phase"] == "active" for campaign in campaigns)

    def wait_for_workers(self, count):
        wait_until(f"{count} workers", lambda: self.status()["num_workers"] == count)

    def wait_for(self, states, count):
        """So many allocations in these states; their numbers."""
        wait_until(f"{count} in {states}", lambda: len(self.numbers(states)) == count)
        return self.numbers(states)

    def numbers(self, states):
        with mock.locked(self.queue.directory):
            items = mock.allocations(self.queue.directory)
            return [item.number for item in items if item.state in states]

    def trouble(self, name, text=""):
        path = self.queue.directory / "trouble" / name
        path.write_text(str(text))
        return path

    @contextlib.contextmanager
    def factory(self, name, log, *further):
        """A factory that has looked once."""
        keeper = Factory(self, name, log)
        with self.site.started(log, *keeper.command(*further)) as keeper.process:
            keeper.wait_for_report()
            yield keeper


class Factory:
    """`proofmass factory` with a clock that the test moves: so it looks when the test wants it."""

    def __init__(self, batch, name, log):
        self.batch = batch
        self.name = name
        self.log_file = batch.site.directory / log
        self.clock = batch.site.directory / f"{log}.clock"
        self.process = None
        self.moved_s = 0
        self.begin = time.monotonic()
        self.move_clock(0)

    def command(self, *further):
        batch = self.batch
        return (
            *("env", f"LD_PRELOAD={faketime_library()}", f"FAKETIME_TIMESTAMP_FILE={self.clock}"),
            *("FAKETIME_NO_CACHE=1", "proofmass", "factory", "--batch-system", batch.system.name),
            *("--name", self.name, *batch.clients, "--worker-connect", batch.workers),
            *("--processors", "1", "--walltime", "20", "--idle-timeout", "5"),
            *("--interval", str(INTERVAL_S), *further),
        )

    def set_clock(self):
        new = self.clock.with_suffix(".new")
        new.write_text(f"+{self.moved_s}\n")
        new.rename(self.clock)

    def look(self, after_s=INTERVAL_S + 1):
        """It looks so much later by its clock. It sleeps when it has reported."""
        self.begin = time.monotonic()
        self.move_clock(after_s)
        return self.wait_for_report()

    def move_clock(self, after_s):
        self.moved_at = time.monotonic()
        self.moved_s += after_s
        self.set_clock()

    def wait_for_report(self):
        """Its report since the clock was moved; None if it has ended."""

        def newest():
            now = time.monotonic()
            if now - self.moved_at > 15:  # It went to sleep after that.
                self.move_clock(INTERVAL_S + 1)
            for report in self.batch.status()["factories"]:
                if report["name"] == self.name and now - report["silent_s"] > self.begin:
                    return report
            return None

        reports = []
        wait_until(
            f"a report of {self.name}",
            lambda: self.process.poll() is not None or reports.append(newest()) or reports[-1],
        )
        return reports[-1] if reports else None

    def report(self):
        return next(item for item in self.batch.status()["factories"] if item["name"] == self.name)

    def log(self):
        return self.log_file.read_text()

    def check_end(self, code):
        wait_until(f"the end of {self.name}", lambda: self.process.poll() is not None)
        check(self.process.returncode == code, f"{self.name} ends with {self.process.returncode}")

    def interrupt(self):
        self.process.send_signal(signal.SIGTERM)
        self.check_end(130)


def check_report(report, **expected):
    for key, value in expected.items():
        check(report[key] == value, f"{key} = {report[key]} (must be {value})")


def pause(batch):
    """Factories whose workers do not start."""
    options = ("--worker-start-cmd", "false", "--workers-min", "3", "--backlog", "3")
    text = "3 workers in a row did not start; allocation "
    with batch.factory("broken", "paused.log", *options) as factory:
        batch.wait_for("QR", 0)
        report = factory.look()
        check_report(report, phase="paused", num_wanted=3, num_registered=0, num_queued=0)
        check(report["reason"].startswith(text), report["reason"])
        check(f"factory broken ({batch.system.name}) paused: 3 workers" in batch.ask("status"), "")
        check_report(factory.look(3600), phase="paused")
        check(factory.log().count("worker_requested") == 3, factory.log())
        check(factory.log().count("factory_paused") == 1, factory.log())
        factory.interrupt()
    with batch.factory("ended", "ended.log", *options, "--exit-when-done") as factory:
        batch.wait_for("QR", 0)
        factory.look()
        factory.check_end(1)
        check(f"proofmass: error: factory: {text}" in factory.log(), factory.log())


def refuse(batch):
    """A factory whose first two submissions are refused; the third one waits in the queue."""
    batch.trouble("refused-fleet", 2)
    batch.queue.waiting = {"fleet"}
    reason = f"submission: {batch.system.refused}"
    with batch.factory("fleet", "refused.log") as factory:
        check_report(factory.report(), phase="waiting", reason=reason, num_queued=0)
        report = factory.look()  # Refused again.
        check_report(report, phase="waiting", reason=reason, num_queued=0)
        check(890 < report["wait_s"] <= 900, f"{report['wait_s']} s (must be 15 minutes)")
        check_report(factory.look(), phase="waiting", reason=reason, num_queued=0)
        check_report(factory.look(), phase="active", reason=None, num_queued=1)
        factory.interrupt()
        waits = re.findall(r"submission_failed retry_min=(\d+)", factory.log())
        check(waits == ["1", "15"], f"waits = {waits} (must be 1 and 15 minutes)")


def work(batch):
    """The factory is started again; its first allocation is in the queue."""
    (first,) = batch.wait_for("Q", 1)
    batch.queue.held = {first + 2, first + 5}
    batch.queue.waiting = set()
    options = ("--workers-min", "5", "--workers-max", "5", "--backlog", "2", "--exit-when-done")
    with batch.factory("fleet", "fleet.log", *options) as factory:
        batch.wait_for_workers(2)
        factory.look()  # Requests one that is held, and one that is not.
        batch.wait_for_workers(3)
        check(batch.wait_for("H", 1) == [first + 2], "another one is held")
        wait_until("runs", lambda: batch.num_done() > 0)
        batch.queue.preempt(first)
        batch.wait_for_workers(2)
        check_report(factory.look(), phase="active", num_registered=2, num_queued=2)
        batch.wait_for_workers(3)

        down = batch.trouble("down")
        for _ in range(2):
            check_report(factory.look(), phase="waiting", reason=batch.system.down)
        down.unlink()
        check_report(factory.look(), phase="active", num_registered=3, num_queued=2)
        check(batch.wait_for("H", 2) == [first + 2, first + 5], "others are held")

        batch.trouble("kept", first + 5)
        batch.ask("cancel", "endless")
        wait_until("the end of the campaign", lambda: batch.num_open() == 0)
        factory.look()
        factory.check_end(0)
        check_cancellations(batch, factory.log(), first + 2, first + 5)


def check_cancellations(batch, log, cancelled, kept):
    """That the newer one cannot be cancelled is no reason to keep the other."""
    identifier = batch.system.identifier
    failed = f"cancellation_failed allocation={identifier(kept)} "
    done = f"allocation_cancelled allocation={identifier(cancelled)}\n"
    check(failed in log and batch.system.kept(kept) in log and done in log, log)
    check(log.index(failed) < log.index(done), log)
    check(batch.wait_for("H", 1) == [kept], "another one is held")


def play(system, directory, programs, port):
    """The digest of the campaign."""
    batch = Batch(system, directory, programs, port)
    text = (batch.site.directory / "short.toml").read_text()
    text = re.sub(r"^name = .*", 'name = "endless"', text, count=1, flags=re.MULTILINE)
    (batch.site.directory / "endless.toml").write_text(text)
    with batch.running(), batch.coordinator() as service:
        wait_until("the coordinator", lambda: batch.status()["campaigns"])
        # There is work until the test ends it.
        batch.ask("submit", "endless.toml", "--runs", "100000")
        for scenario in (pause, refuse, work):
            since = time.monotonic()
            scenario(batch)
            took_s = time.monotonic() - since
            print(f"{system.name}: {scenario.__name__}: {took_s:.1f} s", flush=True)
        service.terminate()
        check(service.wait() == 0, "the coordinator does not end in order")
        batch.wait_for("RE", 0)
    return batch.site.digest("served/hardy2013.db")


def main():
    programs = checking.parser_of(__doc__).parse_args().programs.resolve()
    if faketime_library() is None:
        checking.skip("needs libfaketime")
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor() as pool:
        directory = Path(name)
        port = free_ports(4)
        played = [
            pool.submit(play, system, directory / system.name, programs, port + 2 * index)
            for index, system in enumerate(SYSTEMS)
        ]
        with checking.failure_told(lambda: directory.glob("*/site/*.log")):
            digests = [future.result() for future in played]
            queue = mock.Queue(directory / "none", "pbs", programs)
            expected = Site(queue, directory / "reference", programs, NUM_RUNS).reference()
            check(digests == [expected] * len(digests), f"{digests} (must be {expected})")


if __name__ == "__main__":
    main()
