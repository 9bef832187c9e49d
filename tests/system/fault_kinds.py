"""What can go wrong in a schedule. Each fault begins, lasts for a while and is then mended."""

import contextlib
import errno
import fcntl
import os
import shutil
import signal
import sqlite3
import time


class Fault:
    """What is in `needs` is taken before it starts, and the campaign is given back after it has
    ended. start() returns False where the fault cannot happen now."""

    needs = ()

    def __init__(self, world):
        self.world = world
        self.campaign = None

    def __str__(self):
        campaign = f" of {self.campaign.name}" if self.campaign else ""
        return f"{type(self).__name__}{campaign}"

    def take_campaign(self):
        """A campaign whose file is there and to whose file nothing else is being done."""
        free = [campaign for campaign in self.world.campaigns
                if not campaign.is_busy and self.world.file_of(campaign).is_file()]
        if not free:
            return False
        self.campaign = self.world.random.choice(free)
        self.campaign.is_busy = True
        self.world.look(self.campaign)
        return True

    def take_coordinator(self):
        self.coordinator = self.world.coordinator
        return is_free(self.coordinator)

    def take_worker(self):
        free = [worker for worker in self.world.workers if is_free(worker)]
        if not free:
            return False
        self.worker = self.world.random.choice(free)
        return True

    def begin(self):
        """Whether the fault has begun; if not, nothing must be mended."""
        if not all(getattr(self, f"take_{needed}")() for needed in self.needs):
            return False
        if self.start() is False:
            self.release()
            return False
        return True

    def end_coordinator(self, signals):
        self.coordinator.is_end_expected = True
        self.coordinator.signal(self.world.random.choice(signals))
        self.coordinator.wait()

    def mend(self):
        self.end()
        self.release()

    def release(self):
        if "campaign" in self.needs:
            self.campaign.is_busy = False

    def end(self):
        pass


def is_free(process):
    return not (process.has_ended() or process.is_end_expected or process.is_stopped)


class CoordinatorKilled(Fault):
    needs = ("coordinator",)
    number = signal.SIGKILL

    def start(self):
        self.coordinator.is_end_expected = True
        self.coordinator.signal(self.number)
        code = self.coordinator.wait()
        if code < 0 and code not in (-self.number, -signal.SIGKILL):
            raise RuntimeError(f"{self.coordinator.name} ended with {code}")
        self.world.restart_at = None

    def end(self):
        self.world.start_coordinator()


class CoordinatorTerminated(CoordinatorKilled):
    number = signal.SIGTERM


class CoordinatorInterrupted(CoordinatorKilled):
    number = signal.SIGINT


class CoordinatorStopped(Fault):
    needs = ("coordinator",)

    def start(self):
        self.coordinator.is_stopped = True
        self.coordinator.signal(signal.SIGSTOP)

    def end(self):
        self.coordinator.signal(signal.SIGCONT)
        self.coordinator.is_stopped = False


class WorkerKilled(Fault):
    needs = ("worker",)

    def start(self):
        self.worker.kill()

    def end(self):
        self.world.replace_worker(self.worker)


class WorkerTerminated(Fault):
    """It delivers what it can, and ends without an error in any case."""

    needs = ("worker",)

    def start(self):
        self.worker.signal(signal.SIGTERM)
        self.worker.is_end_expected = True

    def end(self):
        self.worker.wait()
        self.world.check_worker_end(self.worker)
        self.world.replace_worker(self.worker)


class WorkerChildKilled(Fault):
    """The process that computes; the one that watches it starts another."""

    needs = ("worker",)

    def start(self):
        parent = self.worker.process.pid
        with contextlib.suppress(OSError):
            with open(f"/proc/{parent}/task/{parent}/children") as children:
                for child in children.read().split():
                    os.kill(int(child), signal.SIGKILL)


class WorkerStopped(Fault):
    needs = ("worker",)

    def start(self):
        self.worker.is_stopped = True
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.worker.process.pid, signal.SIGSTOP)

    def end(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.worker.process.pid, signal.SIGCONT)
        self.worker.is_stopped = False


class DiskFull(Fault):
    def start(self):
        if (self.world.served / "ballast").exists():
            return False
        self.world.fill_disk()
        return True

    def end(self):
        self.world.free_disk()


class CallsFail(Fault):
    """Some system calls of the coordinator on its files."""

    def start(self):
        if self.world.orders.memory[0:4] != bytes(4):
            return False
        draw = self.world.random
        calls = draw.choice([["write"], ["sync"], ["open"], ["map"], ["truncate"], ["unlink"],
                             ["write", "sync", "open", "truncate", "map"]])
        error = draw.choice([errno.EIO, errno.EIO, errno.ENOSPC, errno.EMFILE])
        first = draw.choice([1, 1, draw.randint(1, 20)])
        last = draw.choice([first, 0xFFFFFFFF, 0xFFFFFFFF])
        self.world.orders.set(calls, error, first, last)
        self.world.tell(f"{calls} fail with {errno.errorcode[error]} from {first} to {last}")
        return True

    def end(self):
        self.world.orders.clear()


class FileMoved(Fault):
    """Renamed, and renamed back."""

    needs = ("campaign",)

    def start(self):
        file = self.world.file_of(self.campaign)
        self.away = self.world.served / f"{self.campaign.name}.away"
        file.rename(self.away)

    def end(self):
        self.away.rename(self.world.file_of(self.campaign))


class FileRemoved(Fault):
    needs = ("campaign",)
    with_log = False

    def start(self):
        file = self.world.file_of(self.campaign)
        file.unlink()
        if self.with_log:
            for suffix in ("-wal", "-shm"):
                with contextlib.suppress(FileNotFoundError):
                    file.with_name(file.name + suffix).unlink()


class FileAndLogRemoved(FileRemoved):
    with_log = True


class BackupRestored(Fault):
    """An older state takes the file's place by `mv`, as rsync and most tools restore files."""

    needs = ("campaign",)

    def start(self):
        self.backup = self.world.backups / f"{self.campaign.name}.db"
        return self.make()

    def make(self):
        self.backup.unlink(missing_ok=True)
        done = self.world.run("backup", self.world.file_of(self.campaign), self.backup)
        return done.returncode == 0

    def end(self):
        """The state is as old as this fault is long, and often from before an extension."""
        self.world.look(self.campaign)
        self.restore()

    def restore(self, *, removes_log=False):
        there = self.world.served / f"{self.campaign.name}.incoming"
        file = self.world.file_of(self.campaign)
        try:
            shutil.copy(self.backup, there)
        except OSError as error:  # No room: the restoration does not take place.
            self.world.tell(f"not restored: {error}")
            there.unlink(missing_ok=True)
            return
        if removes_log:  # Not before there is something to put in the file's place.
            for suffix in ("-wal", "-shm"):
                file.with_name(file.name + suffix).unlink(missing_ok=True)
        there.rename(file)


class BackupRestoredAfterExtension(BackupRestored):
    def make(self):
        if not super().make():
            return False
        extend(self.world, self.campaign)
        return True


class CopyRestored(BackupRestored):
    """Not `proofmass backup`, but the file alone, copied while nobody writes to it."""

    def make(self):
        if not self.take_coordinator():
            return False
        self.coordinator.signal(signal.SIGSTOP)
        time.sleep(0.01)
        try:
            shutil.copy(self.world.file_of(self.campaign), self.backup)
        finally:
            self.coordinator.signal(signal.SIGCONT)
        return is_campaign(self.backup)


class RestoredWhileDown(BackupRestored):
    """As the documentation says: the coordinator is ended first, and the log goes too."""

    signals = [signal.SIGTERM, signal.SIGKILL]
    removes_log = True

    def end(self):
        is_ended_here = self.take_coordinator()
        if is_ended_here:
            self.end_coordinator(self.signals)
        self.world.look(self.campaign)
        self.restore(removes_log=self.removes_log and self.world.coordinator.has_ended())
        if is_ended_here:
            self.world.start_coordinator()


class RestoredBesideALog(RestoredWhileDown):
    """As it should not be done: the write-ahead log of the newer state stays."""

    signals = [signal.SIGKILL]
    removes_log = False


class StartFault(Fault):
    """Something is in the way when a coordinator starts."""

    needs = ("coordinator", "campaign")

    def start(self):
        self.end_coordinator([signal.SIGKILL, signal.SIGTERM])
        self.file = self.world.file_of(self.campaign)
        self.block()
        self.world.start_coordinator()


class DirectoryInPlaceOfFile(StartFault):
    def block(self):
        self.away = self.file.with_suffix(".hidden")
        self.file.rename(self.away)
        self.file.mkdir()

    def end(self):
        self.file.rmdir()
        self.away.rename(self.file)


class LockHeld(StartFault):
    """By another program that is about to end."""

    def block(self):
        self.lock = os.open(f"{self.file}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        with contextlib.suppress(OSError):
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def end(self):
        os.close(self.lock)


class CallsFailAtStart(StartFault):
    def block(self):
        draw = self.world.random
        calls = draw.choice([["open"], ["map"], ["write"], ["sync"]])
        self.world.orders.set(calls, draw.choice([errno.EIO, errno.EMFILE, errno.ENOSPC]),
                              draw.choice([1, draw.randint(1, 12)]))
        self.world.tell(f"{calls} fail at start")

    def end(self):
        self.world.orders.clear()


class ReaderHeld(Fault):
    """Somebody reads one state of the file for long."""

    needs = ("campaign",)

    def start(self):
        try:
            self.connection = sqlite3.connect(
                f"file:{self.world.file_of(self.campaign)}?mode=ro", uri=True, timeout=0.2)
            self.connection.execute("BEGIN")
            self.connection.execute("SELECT count(*) FROM run_result").fetchall()
        except sqlite3.Error:
            self.connection.close()
            return False
        return True

    def end(self):
        self.connection.close()


class Extended(Fault):
    def start(self):
        free = [campaign for campaign in self.world.campaigns
                if not campaign.is_busy and campaign.next_size()]
        if not free:
            return False
        self.campaign = self.world.random.choice(free)
        return extend(self.world, self.campaign)


class Paused(Fault):
    def start(self):
        free = [campaign for campaign in self.world.campaigns
                if not campaign.is_paused and not campaign.is_busy]
        if not free or not self.take_coordinator():
            return False
        self.campaign = self.world.random.choice(free)
        done = self.world.ask("pause", self.campaign.name)
        self.campaign.is_paused = True  # Perhaps, even without an answer.
        return done.returncode == 0

    def end(self):
        if self.world.ask("resume", self.campaign.name).returncode == 0:
            self.campaign.is_paused = False


def extend(world, campaign):
    size = campaign.next_size()
    if size is None or world.coordinator.has_ended():
        return False
    campaign.num_runs = size  # Also if it is refused: then it is submitted again in the end.
    return world.submit(campaign)


def is_campaign(file):
    """Whether a copy has got far enough to hold a campaign."""
    try:
        connection = sqlite3.connect(f"file:{file}?mode=ro&immutable=1", uri=True)
        try:
            return connection.execute("SELECT count(*) FROM campaign").fetchone()[0] == 1
        finally:
            connection.close()
    except sqlite3.Error:
        return False


KINDS = [CoordinatorKilled, CoordinatorKilled, CoordinatorTerminated, CoordinatorInterrupted,
         CoordinatorStopped, WorkerKilled, WorkerKilled, WorkerTerminated, WorkerChildKilled,
         WorkerStopped, DiskFull, DiskFull, CallsFail, CallsFail, CallsFail, FileMoved, FileMoved,
         FileRemoved, FileAndLogRemoved, BackupRestored, BackupRestored,
         BackupRestoredAfterExtension, CopyRestored, RestoredWhileDown, RestoredBesideALog,
         DirectoryInPlaceOfFile, LockHeld, CallsFailAtStart, ReaderHeld, Extended, Extended,
         Paused]
