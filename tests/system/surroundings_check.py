#!/usr/bin/env python3
"""What callers hand over to the programs: file systems, limits, descriptors, files of others.

Each check is a function whose name says what holds. Exit code 0 if all hold, 1 if not.
"""

import argparse
import datetime
import errno
import inspect
import json
import os
import resource
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import checking

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
STRANGER = 12345  # A user that is neither root nor this one.
NO_CORE = (0, 0)


class Site:
    """A directory with a finished campaign of 16 runs, and the programs."""

    def __init__(self, programs, libraries, directory):
        self.programs = Path(programs).resolve()
        self.library = Path(libraries).resolve() / "proofmass_poor_file_system.so"
        self.directory = Path(directory).resolve()
        self.directory.chmod(0o755)
        self.poor = self.directory / "poor"
        self.poor.mkdir()
        checking.write_short_campaign(self.programs, self.directory, 100)
        self.path("short.toml").rename(self.path("c.toml"))
        self.done("run", "c.toml", "--runs", "16", "--quiet")

    def path(self, name):
        return self.directory / name

    def start(self, *arguments, program="proofmass", **options):
        environment = {**os.environ, **options.pop("environment", {})}
        options.setdefault("stdin", subprocess.DEVNULL)
        return subprocess.Popen(
            [str(self.programs / program), *map(str, arguments)], cwd=self.directory,
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)

    def ends(self, *arguments, **options):
        """Exit code and what it wrote to standard error."""
        process = self.start(*arguments, **options)
        _, errors = process.communicate(timeout=100)
        return process.returncode, errors

    def done(self, *arguments, **options):
        code, errors = self.ends(*arguments, **options)
        assert code == 0, (arguments, code, errors)

    def refused(self, text, *arguments, code=1, **options):
        ended, errors = self.ends(*arguments, **options)
        assert ended == code and text in errors, (arguments, ended, errors)

    def on_poor(self, **further):
        """The environment of a program for which `poor` lacks links, permissions and more."""
        return {"LD_PRELOAD": str(self.library), "PROOFMASS_POOR_DIRECTORY": str(self.poor),
                **further}


def mode_of(path):
    return path.stat().st_mode & 0o777


def limited(kind, value, user=None):
    """For a process that begins: a limit that it cannot raise."""

    def prepare():
        resource.setrlimit(resource.RLIMIT_CORE, NO_CORE)
        resource.setrlimit(kind, (value, value))
        if user is not None:
            os.setgroups([])
            os.setuid(user)

    return prepare


def files_have_no_more_permissions_than_the_umask_leaves(site):
    private = {"umask": 0o077}
    site.done("init", "private.toml", **private)
    site.done("report", "c.db", "--html", "private.html", **private)
    site.done("keygen", "private", **private)
    for name in ("private.toml", "private.html", "private/authorized_workers",
                 "private/authorized_clients", "private/coordinator.pub"):
        assert mode_of(site.path(name)) == 0o600, name
    site.path("private/authorized_workers").chmod(0o644)
    site.done("keygen", "private", "--worker", "second", **private)
    assert mode_of(site.path("private/authorized_workers")) == 0o644  # It is not a new file.


def links_are_neither_followed_nor_replaced(site):
    target = site.path("target")
    target.write_text("precious")
    for name in ("link.html", "link.csv", "link.db.lock", "c.db.part", "link.toml"):
        site.path(name).symlink_to(target)
    is_link = "is a symbolic link; name the file that it leads to"
    site.refused(is_link, "report", "c.db", "--html", "link.html", "--force", code=2)
    site.refused(is_link, "export", "c.db", "--output", "link.csv", "--force", code=2)
    site.refused(is_link, "init", "link.toml", "--force", code=2)
    site.refused("lock = ", "run", "c.toml", "--db", "link.db", "--runs", "16", "--quiet")
    for name in ("link.html", "link.csv", "link.toml", "link.db.lock"):
        assert site.path(name).is_symlink(), name
    assert target.read_text() == "precious"


def fetch_writes_to_no_file_of_others_and_to_no_full_disk(site):
    served = site.path("served")
    coordinator = site.start("c.toml", "--directory", "served", "--bind", f"ipc://{served}/w",
                             program="proofmass-coordinator")
    try:
        connect = ("--connect", f"ipc://{served}/clients")
        while not (served / "hardy2013.db").exists() or not (served / "clients").exists():
            assert coordinator.poll() is None, coordinator.stderr.read()
            time.sleep(0.01)
        target = site.path("precious")
        target.write_text("precious")
        part = site.path("f.db.part")
        part.symlink_to(target)
        site.refused("must not be a symbolic link", "fetch", "hardy2013", "f.db", *connect)
        part.unlink()
        part.hardlink_to(target)
        site.refused("must be a regular file with one name", "fetch", "hardy2013", "f.db",
                     *connect)
        part.unlink()
        if os.geteuid() == 0:
            part.write_text("")
            os.chown(part, STRANGER, STRANGER)
            site.refused(f"owner = user {STRANGER}", "fetch", "hardy2013", "f.db", *connect)
            part.unlink()
        assert target.read_text() == "precious"
        site.done("fetch", "hardy2013", "f.db", *connect)
    finally:
        coordinator.send_signal(signal.SIGINT)
        coordinator.communicate(timeout=100)


def keys_are_taken_only_from_where_others_cannot_write(site):
    site.done("keygen", "keys")
    serve = ("--directory", "keyed", "--bind", "tcp://127.0.0.1:*", "--keys", "keys")

    def refused(text):
        site.refused(text, *serve, program="proofmass-coordinator")

    site.path("keys").chmod(0o770)
    refused("key directory = keys (mode 0770; must be writable by its owner alone: chmod go-w)")
    site.refused("key directory = keys (mode 0770", "keygen", "keys", "--worker", "second")
    site.path("keys").chmod(0o700)
    if os.geteuid() != 0:
        return
    for name, what in (("authorized_clients", "allow-list = keys/authorized_clients"),
                       ("", "key directory = keys")):
        os.chown(site.path("keys") / name, STRANGER, STRANGER)
        refused(f"{what} (owner = user {STRANGER}; must be owned by user 0")
        os.chown(site.path("keys") / name, 0, 0)


def all_files_can_be_made_without_links_and_permissions(site):
    for arguments in (("init", "poor/a.toml"), ("keygen", "poor/keys"),
                      ("report", "c.db", "--html", "poor/a.html"),
                      ("plot", "c.db", "--chart", "errors", "--output", "poor/a.svg"),
                      ("export", "c.db", "--output", "poor/a.h5"),
                      ("backup", "c.db", "poor/copy.db")):
        site.done(*arguments, environment=site.on_poor())
    site.refused("exists already", "init", "poor/a.toml", code=2, environment=site.on_poor())
    site.done("init", "poor/a.toml", "--force", environment=site.on_poor())


def secret_keys_are_not_written_where_everybody_reads_them(site):
    site.refused("its file system would let other users read it", "keygen", "poor/open",
                 environment=site.on_poor(PROOFMASS_POOR_MODE="1"))
    assert not (site.poor / "open").exists()


def finished_campaigns_are_read_where_there_are_no_locks(site):
    (site.poor / "c.db").write_bytes(site.path("c.db").read_bytes())
    for number in (errno.ENOLCK, errno.ENOSYS):
        unlocked = {"environment": site.on_poor(PROOFMASS_POOR_LOCKS=str(number))}
        site.done("report", "poor/c.db", **unlocked)
        site.done("query", "poor/c.db", "SELECT count(*) FROM run", **unlocked)
        site.done("backup", "poor/c.db", f"poor/copy{number}.db", **unlocked)
        site.done("export", "c.db", "--format", "hdf5", "--output", f"poor/{number}.h5",
                  **unlocked)
        no_locks = "is on a file system without locks; use a local disk"
        site.refused(no_locks, "run", "c.toml", "--db", "poor/c.db", "--runs", "17", **unlocked)
        (site.poor / "c.db-journal").write_text("journal")
        site.refused("copy all of its files to a local disk", "report", "poor/c.db", **unlocked)
        (site.poor / "c.db-journal").unlink()


def processors_are_those_of_the_affinity(site):
    one = sorted(os.sched_getaffinity(0))[:1]
    process = site.start("check", "c.toml", "--json",
                         preexec_fn=lambda: os.sched_setaffinity(0, one))
    assert json.loads(process.communicate()[0])["num_cores"] == 1


def closed_standard_descriptors_go_to_no_file(site):
    directory = site.path("closed")
    process = site.start("--directory", directory, "--bind", f"ipc://{directory}/w",
                         program="proofmass-coordinator",
                         preexec_fn=lambda: [os.close(number) for number in range(3)])
    try:
        while not (directory / "clients").exists():
            assert process.poll() is None
            time.sleep(0.01)
        for number in range(3):
            assert os.readlink(f"/proc/{process.pid}/fd/{number}") == "/dev/null"
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=100)
    site.refused("", "report", "c.db", preexec_fn=lambda: os.close(1))  # What it says is lost.


def signals_that_are_blocked_or_ignored_are_set_right(site):
    def block():
        signal.pthread_sigmask(signal.SIG_BLOCK, set(signal.Signals))
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)

    process = site.start("run", "c.toml", "--db", "blocked.db", "--runs", "100000", "--quiet",
                         preexec_fn=block)
    stored = "SELECT count(*) FROM run_result"
    while (not site.path("blocked.db").exists()
           or sqlite3.connect(site.path("blocked.db")).execute(stored).fetchone()[0] == 0):
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=100) == 130, process.stderr.read()


def logs_tell_the_time_in_utc(site):
    process = site.start("--directory", "utc", "--bind", f"ipc://{site.path('utc')}/w",
                         "--exit-when-done", program="proofmass-coordinator",
                         environment={"TZ": "XYZ-11"})
    errors = process.communicate(timeout=100)[1]
    written = datetime.datetime.strptime(errors[:25], "[%Y-%m-%d %H:%M:%S.%fZ")
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None)
    assert abs((now - written).total_seconds()) < 600, errors


def limits_are_named(site):
    run = ("run", "c.toml", "--db", "limited.db", "--runs", "16", "--quiet")
    for number in (8, 16):
        for arguments, program in (
                (run, "proofmass"), (("status", "--connect", "ipc:///nobody"), "proofmass"),
                (("--directory", "few", "--bind", "ipc://few/w"), "proofmass-coordinator"),
                (("--connect", "ipc:///nobody"), "proofmass-worker")):
            site.refused("descriptors = ", *arguments, program=program,
                         preexec_fn=limited(resource.RLIMIT_NOFILE, number))
    site.refused("File too large", "report", "c.db", "--html", "large.html",
                 preexec_fn=limited(resource.RLIMIT_FSIZE, 1000))
    site.refused("stack in bytes = 131072 (must be at least", *run,
                 preexec_fn=limited(resource.RLIMIT_STACK, 128 << 10))
    if os.geteuid() != 0:
        return
    site.directory.chmod(0o777)
    for number in (4, 6):
        for arguments, program in ((run, "proofmass"),
                                   (("--directory", "few", "--bind", "ipc://few/w"),
                                    "proofmass-coordinator"),
                                   (("--connect", "ipc:///nobody", "--no-supervisor"),
                                    "proofmass-worker")):
            site.refused("threads = ", *arguments, program=program,
                         preexec_fn=limited(resource.RLIMIT_NPROC, number, STRANGER))
    site.directory.chmod(0o755)


def byte_order_marks_and_line_ends_of_windows_are_read(site):
    def windows(name, text):
        site.path(name).write_bytes(BYTE_ORDER_MARK + text.replace("\n", "\r\n").encode())

    heading = ("time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,"
               "angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2\n")
    rows = "".join(f"{time_s},1e-8,0,0,0,0,0\n" for time_s in (0, 7000))
    windows("w.toml", site.path("c.toml").read_text())
    windows("w.csv", heading + rows)
    table = ("check", "w.toml", "--set", "environment.kind=file", "--set",
             "environment.file=w.csv")
    site.done(*table)
    windows("w.csv", heading.replace("linear_z", "linear_w") + rows)
    site.refused('w.csv:1: column 4 is "linear_w_m_s2"; the first line must be', *table, code=2)
    site.path("w.csv").write_bytes((heading + rows).encode("utf-16"))
    site.refused("is UTF-16; save it as UTF-8", *table, code=2)
    windows("options.toml", "[check]\njson = true\n")
    site.done("--config", "options.toml", "check", "c.toml")
    windows("requirements.toml", '[[requirements]]\nid = "R1"\ntext = "text"\n'
            'requirement = "all objectives for 1% with 50%"\n')
    code, errors = site.ends("report", "c.db", "--requirements", "requirements.toml")
    assert code in (0, 3), errors
    site.done("keygen", "windows")
    for name in ("authorized_workers", "coordinator.key"):
        windows(f"windows/{name}", site.path(f"windows/{name}").read_text())
    site.done("c.toml", "--directory", "windows-served", "--bind", "tcp://127.0.0.1:*", "--keys",
              "windows", "--help", program="proofmass-coordinator")
    site.done("keygen", "windows", "--worker", "second")


def accelerations_of_grace_become_an_environment(site):
    rows = "".join(f"{1000 + time_s} A 1e-8 2e-9 -3e-9 1e-8 0 0 0 0 0 00000000\n"
                   for time_s in range(0, 7000, 10))
    site.path("acc1b.asc").write_text("header:\n# End of YAML header\n" + rows
                                      + "9000 A 1 1 1 1 1 1 0 0 0 00000100\n")
    script = Path(__file__).parents[2] / "deploy/python/acc1b_environment.py"
    table = subprocess.run([sys.executable, script, site.path("acc1b.asc")], check=True, text=True,
                           stdout=subprocess.PIPE).stdout
    assert table.splitlines()[2] == "10,1e-8,2e-9,-3e-9,1e-8,0,0"
    assert len(table.splitlines()) == 701
    site.path("grace.csv").write_text(table)
    site.done("check", "c.toml", "--set", "environment.kind=file", "--set",
              "environment.file=grace.csv")


def an_export_can_be_read_by_old_sqlite(site):
    site.done("export", "c.db", "--format", "sqlite", "--output", "plain.db")
    plain = sqlite3.connect(site.path("plain.db"))
    ours = sqlite3.connect(site.path("c.db"))
    for name, kind, sql in plain.execute("SELECT name, type, sql FROM sqlite_master"):
        # STRICT is of 3.37, computed columns of 3.31; 3.26 has the rest.
        assert "STRICT" not in (sql or ""), name
        assert kind != "table" or " AS (" not in sql, name
    names = [name for name, in ours.execute(
        "SELECT name FROM sqlite_master WHERE type IN ('table', 'view')")]
    for name in names:
        query = f'SELECT * FROM "{name}"'
        assert plain.execute(query).fetchall() == ours.execute(query).fetchall(), name
    assert plain.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    site.refused("is not a Proofmass campaign", "report", "plain.db")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--programs", required=True)
    parser.add_argument("--libraries", required=True)
    parser.add_argument("--only", default="", help="part of the names of the checks to run")
    options = parser.parse_args()
    checks = [function for name, function in inspect.getmembers(sys.modules["__main__"])
              if inspect.isfunction(function) and list(inspect.signature(function).parameters)
              == ["site"] and options.only in name]
    num_failed = 0
    with tempfile.TemporaryDirectory(prefix="proofmass-surroundings-") as directory:
        site = Site(options.programs, options.libraries, directory)
        for check in checks:
            try:
                check(site)
                print("holds:", check.__name__)
            except Exception as error:  # Each check is reported by itself.
                num_failed += 1
                print("FAILS:", check.__name__, type(error).__name__, error)
    return 1 if num_failed else 0


if __name__ == "__main__":
    sys.exit(main())
