#!/usr/bin/env python3
"""Makes the Debian packages of deploy/debian-packages.sh and runs them in a Debian 12 of their own.

That Debian is booted by systemd-nspawn, so that systemd starts, watches and stops the services. It
has the essential packages, systemd and what the packages depend on, and nothing else. To be fast,
its files are copied from the packages that are installed here; with --mmdebstrap, a fresh one is
made from a mirror, which takes minutes. In turn:

- the packages are made twice, with the same bytes, and together hold what `cmake --install` does;
- `systemd-analyze` accepts both units and finds that they are exposed by less than 2.5 of 10;
- the packages are installed and start nothing;
- keys are made, coordinator and worker are started, and a campaign gets the digest that the
  programs of the build give it;
- systemd restarts a worker that hangs; the coordinator is restarted while the worker goes on;
- the packages are removed while the services run, and purged: of all that they brought, only keys
  and campaign databases stay.

Needs root, Debian 12 and systemd-nspawn. Exit code 0 if all holds, 1 if not; 77
without these programs, but 1 if the environment has CI.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import checking
from checking import check, output_of, wait_until

NEEDED = ("systemd-nspawn", "systemd-analyze", "dpkg-shlibdeps", "nsenter")
PACKAGES = ("proofmass-worker", "proofmass")
UNITS = ("proofmass-coordinator.service", "proofmass-worker@.service")
EXPOSURE_MAX = 2.5  # Of 10, as `systemd-analyze security` counts.
WORKER_SIZE_MAX = 4_000_000  # Bytes of its package.
NUM_RUNS = 40
# What changes while a Debian runs, whatever is installed.
VOLATILE = re.compile(r"/(dev|proc|run|sys|tmp|root|var/(cache|log|tmp|lib/(dpkg|systemd)))(/|$)")
KEPT = re.compile(r"/etc/proofmass(/|$)|/var/lib/(private/)?proofmass(/|$)|/var/lib/private$")


def make_packages(build, directory):
    directory.mkdir()
    script = checking.SOURCE / "deploy/debian-packages.sh"
    output_of(script, "--build", build, "--output", directory)
    files = {path.name.split("_")[0]: path for path in directory.iterdir()}
    check(sorted(files) == sorted(PACKAGES), f"packages = {sorted(files)} (must be {PACKAGES})")
    return files


def files_of(package):
    listing = output_of("dpkg-deb", "--contents", package).splitlines()
    check(all(" root/root " in line for line in listing), f"{package} (must be owned by root)")
    return [line.split()[5].removeprefix(".") for line in listing if not line.endswith("/")]


def dependencies_of(package):
    field = output_of("dpkg-deb", "--field", package, "Depends")
    return [part.split()[0] for part in field.split(",")]


def check_contents(build, packages, directory):
    """Each installed file is in exactly one package, and nothing else but what belongs to Debian."""
    output_of("cmake", "--install", build, "--prefix", directory)
    installed = {
        "/usr/" + str(path.relative_to(directory))
        for path in directory.rglob("*")
        if not path.is_dir() and not path.name.endswith(".default")
    }
    packaged = [name for package in packages.values() for name in files_of(package)]
    check(len(packaged) == len(set(packaged)), f"{packaged} (a file is in both packages)")
    packaged = {name for name in packaged if not name.startswith("/etc/default/")}
    check(packaged == installed, f"packaged and installed differ by {packaged ^ installed}")

    for package in packages.values():
        version = output_of("dpkg-deb", "--field", package, "Version")
        check(re.search(r"\+\d{8}\.\d{6}", version), f"version = {version} (must have a time)")

    worker = packages["proofmass-worker"]
    size = worker.stat().st_size
    check(size < WORKER_SIZE_MAX, f"size = {size} bytes (must be below {WORKER_SIZE_MAX})")
    unwanted = [name for name in dependencies_of(worker) if re.search("sqlite|hdf5|http", name)]
    check(not unwanted, f"the worker depends on {unwanted}")


def parse_alternatives(field):
    """Of a list of dependencies; each is a list of names, of which one is enough."""
    parts = [part for part in field.split(",") if part.strip()]
    return [[re.split(r"[ :(]", one.strip())[0] for one in part.split("|")] for part in parts]


def installed_closure(names):
    """These packages, the essential ones and all that they depend on, as they are installed here."""
    fields = ("binary:Package", "Essential", "Provides", "Pre-Depends", "Depends")
    form = "\t".join(f"${{{field}}}" for field in fields) + "\n"
    lines = output_of("dpkg-query", "--show", f"-f={form}").splitlines()
    rows = [line.split("\t") for line in lines]
    packages = {row[0].partition(":")[0]: row for row in rows}
    providers = {}
    for name, row in packages.items():
        for (virtual,) in parse_alternatives(row[2]):
            providers.setdefault(virtual, name)
    found = set()
    wanted = [*names, *(name for name, row in packages.items() if row[1] == "yes")]
    while wanted:
        name = wanted.pop()
        name = name if name in packages else providers.get(name)
        check(name, "a package that is needed is not installed here")
        if name in found:
            continue
        found.add(name)
        for field in packages[name][3:]:
            for alternatives in parse_alternatives(field):
                wanted += [one for one in alternatives if one in packages or one in providers][:1]
    return [packages[name][0] for name in sorted(found)]


def copy_installed(names, root):
    """A root with the files of these packages and with dpkg's records of them."""
    for link in ("bin", "lib", "lib64", "sbin"):
        (root / "usr" / link).mkdir(parents=True)
        (root / link).symlink_to(f"usr/{link}")
    files = output_of("dpkg-query", "--listfiles", *names).splitlines()
    files = [file for file in files if re.match(r"/(?!usr/share/(doc|man|locale)/|\.$)", file)]
    records = Path("/var/lib/dpkg/info")
    files.append(f"{records}/format")
    for name in names:
        files += [f"{records}/{name}.list", f"{records}/{name.partition(':')[0]}.list"]
    subprocess.run(
        "tar --directory=/ --create --no-recursion --ignore-failed-read --files-from=- 2> /dev/null"
        f" | tar --extract --keep-directory-symlink --directory={root}",
        input="\n".join(sorted({"." + file for file in files})),
        shell=True,
        text=True,
        check=True,
    )
    bare_names = {name.partition(":")[0] for name in names}
    paragraphs = Path("/var/lib/dpkg/status").read_text(encoding="utf-8").split("\n\n")
    kept = [text for text in paragraphs if text.split("\n")[0].split(" ")[-1] in bare_names]
    database = root / "var/lib/dpkg"
    for directory in ("info", "updates", "triggers"):
        (database / directory).mkdir(parents=True, exist_ok=True)
    (database / "status").write_text("\n\n".join(kept) + "\n\n", encoding="utf-8")
    # What the scripts of these packages make.
    for file in ("passwd", "group"):
        shutil.copy(root / f"usr/share/base-passwd/{file}.master", root / "etc" / file)
    if not (root / "bin/sh").exists():
        (root / "bin/sh").symlink_to("dash")
    output_of("ldconfig", "-r", root)


class Machine:
    """A Debian that systemd-nspawn has booted, with a network of its own."""

    def __init__(self, root):
        self.root = root
        (root / "etc/machine-id").write_text("")
        self.log = open(root.parent / "boot.log", "w", encoding="utf-8")
        # Without a systemd outside there is nobody to register with.
        command = ["systemd-nspawn", "--quiet", "--register=no", "--keep-unit", "--private-network"]
        self.container = subprocess.Popen(
            [*command, "--boot", f"--directory={root}"],
            stdin=subprocess.DEVNULL,
            stdout=self.log,
            stderr=subprocess.STDOUT,
        )
        self.init = None
        wait_until("the start of systemd", self.finds_init)
        wait_until("the end of the boot", lambda: self.has_state("running", "degraded"))

    def finds_init(self):
        check(self.container.poll() is None, "systemd-nspawn has ended")
        process = self.container.pid
        children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
        self.init = next(iter(children), None)
        return self.init is not None and Path(f"/proc/{self.init}/comm").read_text() == "systemd\n"

    def has_state(self, *states):
        answer = self.answer("systemctl is-system-running")
        return answer.stdout.strip() in states

    def answer(self, lines):
        """Of a shell in the machine; it gets a minute."""
        enter = ["timeout", "60", "nsenter", "--target", self.init, "--all", "--wdns=/root"]
        clean = ["env", "--ignore-environment", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root"]
        return subprocess.run(
            [*enter, *clean, "sh", "-e", "-c", lines],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            check=False,
        )

    def run(self, lines):
        answer = self.answer(lines)
        check(answer.returncode == 0, f"{lines}: gives {answer.returncode}\n{answer.stdout}")
        return answer.stdout

    def property_of(self, unit, name):
        return self.run(f"systemctl show --property={name} --value '{unit}'").strip()

    def files(self):
        """All but what changes anyway."""
        names = self.run("find / -xdev").splitlines()
        return {name for name in names if not VOLATILE.match(name)}

    def stop(self):
        self.container.terminate()  # systemd-nspawn asks the machine to power off.
        try:
            self.container.wait(20)
        except subprocess.TimeoutExpired:
            self.container.kill()
            self.container.wait()
        self.log.close()


def check_units(machine):
    for unit in UNITS:
        path = f"/usr/lib/systemd/system/{unit}"
        machine.run(f"systemd-analyze verify {path.replace('@', '@1')}")
        limit = int(10 * EXPOSURE_MAX)
        report = machine.run(f"systemd-analyze security --offline=yes --threshold={limit} {path}")
        print(report.splitlines()[-1].strip("→ "))


def run_campaign(machine, expected):
    machine.run(
        "(umask 077; proofmass keygen /etc/proofmass/keys)\n"
        "echo PROOFMASS_CONNECT=tcp://127.0.0.1:5555 >> /etc/default/proofmass-worker\n"
        "systemctl enable --now proofmass-coordinator\n"
        "systemctl enable --now proofmass-worker@1\n"
        "proofmass init paper.toml\n"
        f"sed -E '{checking.shortening(NUM_RUNS)}' paper.toml > short.toml\n"
        "export PROOFMASS_CLIENT_CONNECT=tcp://127.0.0.1:5556 PROOFMASS_KEYS=/etc/proofmass/keys\n"
        "proofmass submit short.toml\n"
        "timeout 60 proofmass watch hardy2013"
    )
    report = machine.run("proofmass report /var/lib/proofmass/hardy2013.db")
    digest = checking.digest_of(report)
    check(digest == expected, f"digest = {digest} (must be {expected})")


def restart_hung_worker(machine):
    """The watchdog and the time to the next start are shortened for this."""
    unit = "proofmass-worker@1"
    machine.run(
        f"mkdir -p /run/systemd/system/{unit}.service.d\n"
        "printf '[Service]\\nWatchdogSec=2s\\nRestartSec=1s\\n'"
        f" > /run/systemd/system/{unit}.service.d/short.conf\n"
        "systemctl daemon-reload\n"
        f"systemctl restart {unit}\n"
        f"systemctl kill --signal=STOP {unit}"
    )
    wait_until("a restart of the worker", lambda: machine.property_of(unit, "NRestarts") == "1")
    wait_until("its registration", lambda: machine.property_of(unit, "SubState") == "running")


def restart_coordinator(machine):
    worker = machine.property_of("proofmass-worker@1", "MainPID")
    before = machine.property_of("proofmass-coordinator", "MainPID")
    registered = "journalctl --unit=proofmass-worker@1 | grep -c ' registered'"
    num_registered = int(machine.run(registered))
    machine.run("systemctl restart proofmass-coordinator")
    check(machine.property_of("proofmass-coordinator", "MainPID") != before, "no restart")
    wait_until("the worker", lambda: int(machine.run(registered)) > num_registered)
    check(machine.property_of("proofmass-worker@1", "MainPID") == worker, "the worker has ended")


def remove(machine, before):
    machine.run(f"dpkg --remove {' '.join(PACKAGES)}")
    for service in ("proofmass-coordinator", "proofmass-worker@1"):
        check(machine.answer(f"pgrep {service[:15]}").returncode != 0, f"{service} still runs")
    machine.run(f"dpkg --purge {' '.join(PACKAGES)}")
    changed = before ^ machine.files()
    changed = {name for name in changed if not KEPT.match(name)}
    check(not changed, f"files before and after differ by {sorted(changed)}")
    kept = machine.run("ls /var/lib/private/proofmass /etc/proofmass/keys")
    check("hardy2013.db" in kept and "coordinator.key" in kept, f"{kept} (keys, databases missing)")


def check_in_machine(machine, packages, expected):
    before = machine.files()
    place = machine.root / "root/packages"
    place.mkdir()
    for package in packages.values():
        shutil.copy(package, place)
    print(machine.run("dpkg --install packages/*.deb").strip())
    for unit in ("proofmass-coordinator", "proofmass-worker@1"):
        state = machine.property_of(unit, "ActiveState")
        check(state == "inactive", f"{unit} = {state} (must be inactive after the installation)")
    for scenario in (
        check_units,
        lambda machine: run_campaign(machine, expected),
        restart_hung_worker,
        restart_coordinator,
        lambda machine: remove(machine, before),
    ):
        scenario(machine)


def main():
    parser = checking.parser_of(__doc__, "build")
    parser.add_argument("--mmdebstrap", action="store_true", help="make a fresh Debian")
    arguments = parser.parse_args()
    build = arguments.build.resolve()
    if os.geteuid() != 0 or not all(shutil.which(name) for name in NEEDED):
        checking.skip(f"needs root and {', '.join(NEEDED)}")
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        machine = None
        try:
            with ThreadPoolExecutor() as pool:
                places = [directory / name for name in ("first", "second")]
                packages, again = pool.map(lambda place: make_packages(build, place), places)
            needed = {one for package in packages.values() for one in dependencies_of(package)}
            needed = needed - set(PACKAGES) | {"systemd", "systemd-sysv", "procps"}
            root = directory / "root"
            if arguments.mmdebstrap:
                include = f"--include={','.join(sorted(needed))}"
                output_of("mmdebstrap", "--quiet", "--variant=essential", include, "bookworm", root)
            else:
                copy_installed(installed_closure(needed), root)
            for name, package in packages.items():
                is_same = package.read_bytes() == again[name].read_bytes()
                check(is_same, f"{name}: the same programs make other bytes")
            check_contents(build, packages, directory / "installed")
            expected = checking.reference(build / "bin", directory, NUM_RUNS)
            machine = Machine(root)
            check_in_machine(machine, packages, expected)
        except AssertionError as error:
            print(f"FAILED: {error}")
            if machine:
                print(machine.answer("journalctl --no-pager --lines=60").stdout)
            sys.exit(1)
        finally:
            if machine:
                machine.stop()


if __name__ == "__main__":
    main()
