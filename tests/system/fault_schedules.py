#!/usr/bin/env python3
"""Random faults on a real coordinator, real workers and real files.

    tests/system/fault_schedules.py --programs build/release/bin --seeds 1:200 --jobs 4

Each schedule follows from its seed: a coordinator in a directory of its own, two to four workers, one
or two small campaigns, and faults (fault_kinds.py) at random times. Then everything is mended,
and within 300 s every campaign must be finished, with the digest of an undisturbed run, one row a run
and nothing for `proofmass verify` to find; no program may have aborted, and no honest worker failed.
Needs root, for file systems of its own. Exit code 1 if a schedule failed, whose directory is kept; 77
without root, but 1 if the environment has CI.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import traceback

import checking
import fault_kinds
import fault_world
from fault_world import Failure

ADVICE = "mv --backup"  # What a coordinator says of a database that lost its name.
HEAL_MAX_S = 300.0
ACT_AFTER_S = 6.0  # What a healed coordinator does not serve by then is submitted again.
STEP_S = 0.05
LOOK_INTERVAL_S = 0.7
STATUS_INTERVAL_S = 0.5
SCHEDULE_MAX_S = 600
SIZES = fault_world.SIZES
NULL_CAMPAIGNS = ("alpha", "beta")


# What an undisturbed run gives.

def write_campaigns(programs, folder):
    subprocess.run([programs / "proofmass", "init", "paper.toml"], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL)
    text = (folder / "paper.toml").read_text()
    for number, (name, sizes) in enumerate(SIZES.items()):
        short = text
        for key, value in (("name", f'"{name}"'), ("seed", number + 1), ("runs", sizes[0]),
                           ("orbits", 1), ("sample_period_s", 1)):
            short = re.sub(rf"(?m)^{key} = .*", f"{key} = {value}", short, count=1)
        (folder / f"{name}.toml").write_text(short)


class Undisturbed:
    """Digests of campaigns that nothing happened to, each computed when it is first asked for."""

    def __init__(self, programs, folder):
        self.programs = programs
        self.folder = folder
        self.digests = {}
        self.lock = threading.Lock()
        write_campaigns(programs, folder)

    def digest(self, name, num_runs):
        with self.lock:
            if (name, num_runs) not in self.digests:
                self.digests[name, num_runs] = self.compute(name, num_runs)
            return self.digests[name, num_runs]

    def compute(self, name, num_runs):
        worker = "proofmass-null-worker" if name in NULL_CAMPAIGNS else "proofmass-worker"
        text = re.sub(r"(?m)^runs = .*", f"runs = {num_runs}",
                      (self.folder / f"{name}.toml").read_text(), count=1)
        (self.folder / "now.toml").write_text(text)
        endpoint = f"ipc://{self.folder}/undisturbed"
        served = self.folder / f"{name}-{num_runs}"
        with subprocess.Popen([self.programs / "proofmass-coordinator", "now.toml", "--directory",
                               served, "--bind", endpoint, "--exit-when-done"], cwd=self.folder,
                              stderr=subprocess.DEVNULL) as coordinator:
            subprocess.run([self.programs / worker, "--connect", endpoint, "--threads", "1"],
                           cwd=self.folder, check=True, stderr=subprocess.DEVNULL)
            if coordinator.wait() != 0:
                raise RuntimeError(f"the undisturbed campaign {name} failed")
        return fault_world.verified_digest(self.programs, served / f"{name}.db",
                                           name in NULL_CAMPAIGNS)


# One schedule.

def draw_faults(world):
    """Times of begin and end, in order. These draws follow those of the setting."""
    draw = world.random
    moments = []
    for _ in range(draw.randint(3, 8)):
        fault = draw.choice(fault_kinds.KINDS)(world)
        begin = draw.uniform(0.4, world.length_s)
        moments.append((begin, "begin", fault))
        moments.append((begin + draw.choice([0.05, draw.uniform(0.1, 1.0), draw.uniform(0.5, 4.0)]),
                        "end", fault))
    return sorted(moments, key=lambda moment: moment[0])


def drawn_kinds(seed):
    """@return Setting and kinds of faults of a seed, without starting anything."""
    setting = fault_world.Setting(seed)
    kinds = [type(fault).__name__ for _, action, fault in draw_faults(setting) if action == "begin"]
    return setting, kinds


def pass_time(world, until):
    """Watches the processes and looks into the files until that time."""
    while time.monotonic() < until:
        world.watch()
        if time.monotonic() >= world.next_look:
            for campaign in world.campaigns:
                world.look(campaign)
            world.next_look = time.monotonic() + LOOK_INTERVAL_S
        time.sleep(STEP_S)


def begin_campaigns(world):
    world.start_coordinator()
    for slot in range(world.num_workers):
        world.start_worker(slot)
    deadline = time.monotonic() + HEAL_MAX_S
    for campaign in world.campaigns:
        while not world.submit(campaign):
            if time.monotonic() > deadline:
                raise Failure(f"{campaign.name} could not be submitted")
            world.watch()
            time.sleep(STEP_S)


def act_out(world, moments):
    begin = time.monotonic()
    begun = []
    for when, action, fault in moments:
        pass_time(world, begin + when)
        if action == "begin":
            if not fault.begin():
                world.tell(f"{fault} is not possible")
                continue
            world.tell(f"{fault} begins")
            world.num_active += 1
            begun.append(fault)
        elif fault in begun:
            fault.mend()
            world.tell(f"{fault} ends")
            world.watch()  # What the fault ended is not held against it later.
            world.num_active -= 1
            world.quiet_since = time.monotonic()
    return [type(fault).__name__ for fault in begun]


def remove_fault_plans(world):
    """Programs that still lose messages are ended and started again without that."""
    if world.coordinator.is_faulty and not world.coordinator.has_ended():
        world.coordinator.is_end_expected = True
        world.coordinator.signal(signal.SIGTERM)
        code = world.coordinator.wait()
        # It may be one that is told to die somewhere, or that has just begun, or that has
        # abandoned a database.
        if code not in (0, -signal.SIGKILL, -signal.SIGTERM) and not (
                code == 1 and ADVICE in world.coordinator.text()):
            raise Failure(f"{world.coordinator.name} ended with {code} after SIGTERM")
        world.start_coordinator(is_faulty=False)
    for worker in [worker for worker in world.workers if worker.is_faulty]:
        worker.signal(signal.SIGTERM)
        worker.is_end_expected = True
        worker.wait()
        world.check_worker_end(worker)
        world.replace_worker(worker, is_faulty=False)
    world.plans.clear()


def follow_advice(world):
    """Databases that lost their names: the operator ends the coordinator, and gives each name to the
    file that has most, which is the copy that the log names unless the coordinator went on with it."""
    copies = sorted(world.served.glob("*.recovered-*.db"))
    if not copies:
        return
    if not world.coordinator.has_ended():
        world.coordinator.is_end_expected = True
        world.coordinator.signal(signal.SIGTERM)
        world.coordinator.wait()
    for campaign in world.campaigns:
        file = world.file_of(campaign)
        own = [copy for copy in copies if copy.name.startswith(f"{campaign.name}.recovered-")]
        best = max([file, *own], key=lambda one: len(world.rows_in(one) or {}))
        if best != file:
            for suffix in ("-wal", "-shm"):
                file.with_name(file.name + suffix).unlink(missing_ok=True)
            best.rename(file)
            world.tell(f"{campaign.name}: goes on from {best.name}")
        for copy in own:
            copy.unlink(missing_ok=True)
    world.start_coordinator(is_faulty=False)


def remove_refused_log(world, campaign):
    """A log beside a restored file, or without one: the operator does what the message says."""
    is_named = re.search(rf"campaign_not_served.*{campaign.name}\.db.*-wal",
                         world.coordinator.text())
    if not is_named and "-wal" not in campaign.refusal:
        return
    file = world.file_of(campaign)
    for suffix in ("-wal", "-shm"):
        file.with_name(file.name + suffix).unlink(missing_ok=True)
    world.tell(f"removed the log of {campaign.name}")


def is_done(world, campaign, status):
    one = status.get(campaign.name)
    return (one is not None and one["phase"] == "finished" and one["num_runs"] == campaign.num_runs
            and one["num_done"] == campaign.num_runs and not one["storage_failure"])


def attend_to(world, campaign, status):
    """What a patient operator does about a campaign that does not get on by itself."""
    one = status.get(campaign.name)
    if one is not None and ADVICE in (one["storage_failure"] or ""):
        follow_advice(world)
        return
    if one is not None and one["phase"] == "paused":
        world.ask("resume", campaign.name)
        return
    file = world.file_of(campaign)
    if one is None or one["num_runs"] < campaign.num_runs or not file.is_file():
        if one is None:
            remove_refused_log(world, campaign)
        world.counts["resubmissions"] += 1
        world.submit(campaign)


def claims(world, status):
    """A coordinator that says that a campaign is whole has a whole file."""
    for campaign in world.campaigns:
        if not is_done(world, campaign, status):
            continue
        rows = world.rows(campaign)
        if rows is None or len(rows) != campaign.num_runs:
            yield (f"{campaign.name}: said to be finished with {campaign.num_runs} runs, but the "
                   f"file {'cannot be read' if rows is None else f'has {len(rows)}'}")


def wait_until_done(world):
    healed = time.monotonic()
    act_at = healed + ACT_AFTER_S
    while True:
        pass_time(world, time.monotonic() + STATUS_INTERVAL_S)
        status = world.status()
        if status is not None and all(is_done(world, campaign, status)
                                      for campaign in world.campaigns):
            missing = list(claims(world, status))
            if not missing:
                return time.monotonic() - healed
            # Given time to notice.
            if time.monotonic() > act_at + ACT_AFTER_S:
                raise Failure("; ".join(missing))
        elif status is not None and time.monotonic() >= act_at:
            for campaign in world.campaigns:
                if not is_done(world, campaign, status):
                    attend_to(world, campaign, status)
            act_at = time.monotonic() + ACT_AFTER_S
        if time.monotonic() > healed + HEAL_MAX_S:
            raise Failure(f"not finished {HEAL_MAX_S:g} s after healing: "
                          f"{json.dumps(status)[:1000]}")


def end_all(world):
    for program in [*world.workers, world.coordinator]:
        program.is_end_expected = True
        program.signal(signal.SIGTERM)
    for worker in world.workers:
        worker.wait()
        world.check_worker_end(worker)
    code = world.coordinator.wait()
    if code != 0:
        raise Failure(f"{world.coordinator.name} ended with {code} in the end")


def check_campaign(world, campaign):
    """@return The digest of its file, to be compared with that of an undisturbed run."""
    file = world.file_of(campaign)
    connection = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
    rows = dict(connection.execute("SELECT run_index, count(*) FROM run_result GROUP BY run_index"))
    receipts = dict(connection.execute("SELECT run_index, received_unix_s FROM delivery"))
    connection.close()
    if sorted(rows) != list(range(campaign.num_runs)) or set(rows.values()) != {1}:
        raise Failure(f"{campaign.name} has {len(rows)} of {campaign.num_runs} runs")
    world.counts["runs computed again"] += sum(
        receipts[run] != when for run, when in campaign.seen.items())
    return fault_world.verified_digest(world.programs, file, world.is_null)


def check_logs(world):
    for log in sorted(world.directory.glob("*.err")):
        for line in log.read_text(errors="replace").splitlines():
            if fault_world.ABORT_MARKS.search(line):
                raise Failure(f"{log.name}: {line}")


def carry_out(options, seed, directory):
    """@return What is printed of the schedule: an object with `failure` if it failed."""
    world = fault_world.World(options, seed, directory)
    world.next_look = 0.0
    report = {"seed": seed, "setting": world.setting(), "failure": None}
    try:
        moments = draw_faults(world)
        begin_campaigns(world)
        report["faults"] = act_out(world, moments)
        pass_time(world, time.monotonic() + 2 * fault_world.RESTART_DELAY_S)
        remove_fault_plans(world)
        follow_advice(world)
        report["healed_s"] = round(wait_until_done(world), 1)
        end_all(world)
        report["digests"] = [(campaign.name, campaign.num_runs, check_campaign(world, campaign))
                             for campaign in world.campaigns]
    except Failure as failure:
        report["failure"] = str(failure)
    except Exception:  # noqa: BLE001: a schedule that breaks says where.
        report["failure"] = traceback.format_exc()
    finally:
        world.close()
    try:
        check_logs(world)
    except Failure as failure:
        report["failure"] = f"{failure}; {report['failure'] or ''}"
    if report["failure"]:  # The file system goes with this process.
        shutil.copytree(world.served, directory / "served-kept", dirs_exist_ok=True)
    return {**report, "wall_s": round(time.monotonic() - world.start_time, 1), **world.counts}


# All schedules.

def run_one(options, seed, folder, undisturbed):
    directory = folder / f"seed-{seed}"
    command = ["unshare", "-m", sys.executable, __file__, "--programs", options.programs,
               "--faulty-calls", options.faulty_calls, "--reference", options.reference, "--one", str(seed),
               "--directory", directory]
    try:
        done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              timeout=SCHEDULE_MAX_S, check=False)
        report = json.loads(done.stdout.splitlines()[-1])
    except (subprocess.TimeoutExpired, ValueError, IndexError) as error:
        report = {"seed": seed, "failure": f"the schedule itself failed: {error!r}"}
    for name, num_runs, digest in report.get("digests", []):
        if digest != undisturbed.digest(name, num_runs):
            report["failure"] = f"{name} has the digest {digest}"
    if report["failure"] is None:
        shutil.rmtree(directory, ignore_errors=True)
    return report


def print_report(report):
    verdict = "ok    " if report["failure"] is None else "FAILED"
    numbers = ", ".join(f"{name} {report[name]}" for name in
                        ("healed_s", "wall_s", "coordinator starts",
                         "runs computed again", "resubmissions") if name in report)
    print(f"seed {report['seed']:>5} {verdict} {numbers} ({report.get('setting', '')}): "
          f"{' '.join(report.get('faults', []))}")
    if report["failure"] is not None:
        print(f"    {report['failure']}")
    sys.stdout.flush()


def read_options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", type=pathlib.Path, required=True)
    parser.add_argument("--faulty-calls", type=pathlib.Path, help="the library to preload; by "
                        "default that of the build that holds the programs")
    parser.add_argument("--seeds", default="1:10", help="FIRST:LAST, or some with commas")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--directory", type=pathlib.Path, help="where failed schedules stay")
    parser.add_argument("--all-kinds", action="store_true", help="refuse seeds of which none "
                        "draws some kind of fault")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--reference", type=pathlib.Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.programs = options.programs.resolve()
    if options.faulty_calls is None:
        options.faulty_calls = options.programs.parent / "tests" / "proofmass_faulty_calls.so"
    options.faulty_calls = options.faulty_calls.resolve()
    return options


def seeds_of(text):
    if ":" in text:
        first, last = map(int, text.split(":"))
        return list(range(first, last + 1))
    return list(map(int, text.split(",")))


def run_all(options):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="fault_schedules.", dir=options.directory))
    options.reference = folder / "undisturbed"
    options.reference.mkdir()
    undisturbed = Undisturbed(options.programs, options.reference)
    seeds = seeds_of(options.seeds)
    begin = time.monotonic()
    failed = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for report in pool.map(lambda seed: run_one(options, seed, folder, undisturbed), seeds):
            print_report(report)
            if report["failure"] is not None:
                failed.append(report["seed"])
    print(f"{len(seeds) - len(failed)} of {len(seeds)} schedules passed in "
          f"{time.monotonic() - begin:.0f} s")
    if failed:
        print(f"failed: {' '.join(map(str, failed))}; see {folder}")
        return 1
    shutil.rmtree(folder, ignore_errors=True)
    return 0


def kinds_that_lack(seeds):
    drawn = {kind for seed in seeds for kind in drawn_kinds(seed)[1]}
    return sorted({kind.__name__ for kind in fault_kinds.KINDS} - drawn)


def main():
    options = read_options()
    if options.one is None:
        lacking = kinds_that_lack(seeds_of(options.seeds)) if options.all_kinds else []
        if lacking:
            print(f"--seeds = {options.seeds} (no schedule has {' '.join(lacking)})")
            return 2
        if os.geteuid() != 0:
            checking.skip("needs root, for file systems of its own")
        return run_all(options)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # So that all programs are ended.
    # A shell's background jobs ignore SIGINT, and so would the programs until they catch it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    print(json.dumps(carry_out(options, options.one, options.directory)))
    return 0


if __name__ == "__main__":
    # Programs are looked up by what they are started with, not by where this file is.
    os.environ.pop("PROOFMASS_CONNECT", None)
    sys.exit(main())
