#!/usr/bin/env python3
"""Builds the images of deploy/container/Containerfile with buildah and runs a campaign in them.

The base is a Debian 12 made by mmdebstrap, and the packages are those of the build tree, so that no
registry is needed and nothing is compiled; with --compile, the stage that compiles is built, too.
The coordinator runs in the image `proofmass` and the worker in `proofmass-worker`, both as the
image's user on a read-only root file system, and the digest must be that of the programs of the
build. The %post section of deploy/container/proofmass.def is run in the base by a shell.

Needs root, buildah, mmdebstrap, a Debian mirror and a few minutes, so it is not part of CI. Exit code
0 if all holds, 1 if not.
"""

import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import checking
from checking import check, output_of

BASE = "localhost/debian:bookworm-slim"
NUM_RUNS = 40
# As Kubernetes does it: a root file system that cannot be written, and volumes in it.
ENTER = """set -e
mount --bind "$0" "$0"
mount -t proc proc "$0/proc"
mount --rbind /dev "$0/dev"
mount -t tmpfs tmpfs "$0/tmp"
[ "$1" = none ] || mount --bind "$1" "$0/$2"
mount -o remount,bind,ro "$0"
shift 2
root=$0
exec chroot --userspec="$1" "$root" sh -e -c "$2"
"""


class Builder:
    """buildah with all that it stores in one directory."""

    def __init__(self, directory):
        stores = ["--root", directory / "store", "--runroot", directory / "run"]
        self.command = ["buildah", *stores, "--storage-driver", "overlay"]

    def run(self, *arguments):
        return output_of(*self.command, *arguments).strip()

    def make_base(self, tarball):
        container = self.run("from", "scratch")
        self.run("add", container, tarball, "/")
        self.run("commit", "--rm", container, BASE)

    def build(self, image, *options):
        file = checking.SOURCE / "deploy/container/Containerfile"
        self.run(
            *("build", "--pull-never", "--build-arg", f"BASE={BASE}", "--file", file),
            *("--tag", f"localhost/{image}", *options, checking.SOURCE),
        )
        text = self.run("inspect", "--type", "image", f"localhost/{image}")
        return json.loads(text)["OCIv1"]["config"]

    def mounted(self, image):
        container = self.run("from", "--pull-never", f"localhost/{image}")
        return Path(self.run("mount", container))


def in_image(root, user, lines, volume="none", place="none"):
    command = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER]
    return subprocess.Popen(
        [*command, root, volume, place, user, lines], stdout=subprocess.PIPE, text=True
    )


def run_campaign(builder, user, directory):
    """The digest of a campaign of a coordinator in one image and a worker in the other."""
    campaigns = directory / "campaigns"
    campaigns.mkdir()
    os.chown(campaigns, *map(int, user.split(":")))
    coordinator = in_image(
        builder.mounted("proofmass"),
        user,
        f"""cd /campaigns
! touch /usr/written 2> /dev/null
proofmass init paper.toml
sed -E '{checking.shortening(NUM_RUNS)}' paper.toml > short.toml
proofmass-coordinator --directory /campaigns --bind ipc:///campaigns/workers \
  --exit-when-done short.toml 2> coordinator.log
proofmass report hardy2013.db""",
        campaigns,
        "campaigns",
    )
    root = builder.mounted("proofmass-worker")
    (root / "campaigns").mkdir()
    check(not (root / "usr/bin/proofmass").exists(), "the worker's image has more than the worker")
    worker = in_image(
        root, user, "proofmass-worker --connect ipc:///campaigns/workers", campaigns, "campaigns"
    )
    report = coordinator.communicate()[0]
    check(worker.wait() == 0, f"exit code of the worker = {worker.returncode} (must be 0)")
    check(coordinator.returncode == 0, f"exit code = {coordinator.returncode} (must be 0)")
    return checking.digest_of(report)


def check_definition(tarball, packages, directory):
    """What Apptainer would do with the definition, but for Apptainer."""
    text = (checking.SOURCE / "deploy/container/proofmass.def").read_text()
    sections = dict(re.findall(r"(?ms)^%(\w+)\n(.*?)(?=^%|\Z)", text))
    root = directory / "definition"
    root.mkdir()
    subprocess.run(["tar", "--extract", "--file", tarball, "--directory", root], check=True)
    shutil.copytree(packages, root / "packages")
    shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
    output_of("chroot", root, "sh", "-e", "-c", sections["post"])
    print("proofmass.def:", output_of("chroot", root, "sh", "-e", "-c", sections["test"]))


def main():
    parser = checking.parser_of(__doc__, "build")
    parser.add_argument("--compile", action="store_true", help="build all stages")
    arguments = parser.parse_args()
    build = arguments.build.resolve()
    os.environ["BUILDAH_ISOLATION"] = "chroot"
    with tempfile.TemporaryDirectory() as name, checking.failure_told():
        directory = Path(name)
        packages = directory / "context/packages"
        packages.mkdir(parents=True)
        script = checking.SOURCE / "deploy/debian-packages.sh"
        output_of(script, "--build", build, "--output", packages)
        tarball = directory / "base.tar"
        output_of("mmdebstrap", "--quiet", "--variant=minbase", "bookworm", tarball)

        builder = Builder(directory)
        try:
            builder.make_base(tarball)
            context = ["--build-context", f"packages={packages.parent}"]
            options = [] if arguments.compile else context
            worker = builder.build("proofmass-worker", "--target", "worker", *options)
            coordinator = builder.build("proofmass", *options)
            print(builder.run("images"))
            users = {worker["User"], coordinator["User"]}
            check(users == {"65532:65532"}, f"users = {users} (must be 65532:65532)")
            check(coordinator["StopSignal"] == "SIGHUP", "the coordinator's image lacks its signal")
            digest = run_campaign(builder, worker["User"], directory)
        finally:
            builder.run("umount", "--all")
            builder.run("rm", "--all")
        expected = checking.reference(build / "bin", directory, NUM_RUNS)
        check(digest == expected, f"digest = {digest} (must be {expected})")
        print(f"digest = {digest}")
        check_definition(tarball, packages, directory)


if __name__ == "__main__":
    main()
