#!/usr/bin/env python3
"""Makes the tarball of deploy/package.sh twice and runs a campaign with it in a bare root.

That root holds nothing but a static busybox and what the tarball brings, so that every library, the
loader included, must be in there. With --root, a root directory with another Linux is used instead.
The digest must be the one that the programs of the build have.

Needs root and /bin/busybox. Exit code 0 if all holds, 1 if not; 77 without root or busybox, but 1 if
the environment has CI.
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import checking
from checking import check

# Shell that writes the digests of a campaign by `run`, which starts the worker itself, of the same
# campaign by a coordinator and a worker, and again as a coordinator answers, which starts `report`.
CAMPAIGN = f"""set -e
proofmass init paper.toml
sed -E '{checking.shortening(runs=40)}' paper.toml > short.toml
proofmass run short.toml --db run.db --quiet > run.txt
proofmass-coordinator --directory served --bind ipc://$PWD/socket \\
  --exit-when-done short.toml 2> coordinator.log &
proofmass-worker --connect ipc://$PWD/socket 2> worker.log
wait
proofmass report run.db | grep Digest
proofmass report served/hardy2013.db | grep Digest
proofmass-coordinator --directory served --bind ipc://$PWD/socket 2>> coordinator.log &
proofmass report hardy2013 --connect ipc://$PWD/served/clients | grep Digest
kill $!
wait
"""


def make_package(script, build, directory):
    directory.mkdir()
    subprocess.run([script, "--build", build, "--output", directory], check=True)
    (tarball,) = directory.iterdir()
    return tarball


def make_bare_root(root):
    for name in ("bin", "proc", "dev", "tmp", "opt"):
        (root / name).mkdir(parents=True)
    shutil.copy("/bin/busybox", root / "bin/busybox")
    for applet in subprocess.check_output(["/bin/busybox", "--list"], text=True).split():
        if applet != "busybox":
            (root / "bin" / applet).symlink_to("busybox")


def digests(command, programs, directory):
    lines = f"export PATH={programs}:$PATH\ncd {directory}\n{CAMPAIGN}"
    process = subprocess.run([*command, "sh", "-c", lines], stdout=subprocess.PIPE, text=True)
    check(process.returncode == 0, f"exit code = {process.returncode} (must be 0) of {command}")
    return [line.split()[-1] for line in process.stdout.splitlines() if line.startswith("Digest")]


def main():
    parser = checking.parser_of(__doc__, "build")
    parser.add_argument("--root", type=Path, help="root directory of another Linux")
    arguments = parser.parse_args()
    script = checking.SOURCE / "deploy/package.sh"
    if os.geteuid() != 0 or not Path("/bin/busybox").exists():
        checking.skip("needs root and /bin/busybox")
    with tempfile.TemporaryDirectory() as name, checking.failure_told():
        directory = Path(name)
        tarball = make_package(script, arguments.build, directory / "first")
        again = make_package(script, arguments.build, directory / "second")
        check(tarball.read_bytes() == again.read_bytes(), "the same programs make other bytes")

        root = arguments.root or directory / "root"
        if not arguments.root:
            make_bare_root(root)
        place = Path(tempfile.mkdtemp(dir=root / "tmp"))
        subprocess.run(["tar", "--extract", "--file", tarball, "--directory", place], check=True)
        inside = Path("/tmp") / place.name
        (programs,) = place.glob("*/bin")
        enter = 'mount --bind /dev "$0/dev" && mount -t proc proc "$0/proc" && exec chroot "$0" "$@"'
        in_root = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", enter, root]
        packaged = digests(in_root, inside / programs.relative_to(place), inside)

        here = directory / "here"
        here.mkdir()
        expected = digests([], arguments.build.resolve() / "bin", here)
        print("\n".join(packaged + expected))
        check(len(packaged) == 3 and packaged == expected, "the packaged programs have another digest")
        shutil.rmtree(place)


if __name__ == "__main__":
    main()
