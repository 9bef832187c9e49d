#!/usr/bin/env python3
"""Runs the containers of deploy/kubernetes as processes and checks what must fit together.

There is no Kubernetes here. Each container's command runs in a network of its own, as the user of
its pod and without rights, with directories in place of its volumes. Secrets are made as Kubernetes
makes them: owned by root, readable by the pod's group, each file a link. In turn:

- every pod is restricted: user, read-only root, no capabilities, limits;
- services, policies and containers name the same ports;
- the init containers make the keys, coordinator and worker do a campaign with the digest of
  `proofmass run`;
- the coordinator is replaced as by Kubernetes, with the signal of its image, and the worker goes on;
- the worker ends on SIGTERM, within the time that its pod has.

With --schema, npm's `kubernetes-models` and `typescript` check all types and fields; this needs npm
and its registry. Without it, needs root and PyYAML. Exit code 0 if all holds, 1 if not; 77 if it
cannot run, but 1 if the environment has CI.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import yaml
except ImportError:  # Debian's package is for Debian's Python.
    if sys.executable == "/usr/bin/python3":
        raise
    os.execv("/usr/bin/python3", ["/usr/bin/python3", *sys.argv])

import checking
from checking import check, wait_until

MANIFESTS = checking.SOURCE / "deploy/kubernetes"
USER = 65532
NUM_RUNS = 400
SECRETS = {
    "proofmass-coordinator-keys": ("coordinator.key", "authorized_workers", "authorized_clients"),
    "proofmass-worker-keys": ("worker.key", "coordinator.pub"),
}


class StrictLoader(yaml.SafeLoader):
    """Refuses a key that is there twice."""

    def construct_mapping(self, node, deep=False):
        keys = [key.value for key, _ in node.value]
        check(len(keys) == len(set(keys)), f"{node.start_mark}: keys = {keys} (one is there twice)")
        return super().construct_mapping(node, deep)


def manifests():
    """(kind, name) -> manifest, of the files that the kustomization names."""
    kustomization = yaml.load((MANIFESTS / "kustomization.yaml").read_text(), StrictLoader)
    files = {path.name for path in MANIFESTS.glob("*.yaml")} - {"kustomization.yaml"}
    check(set(kustomization["resources"]) == files, f"resources (must be {sorted(files)})")
    every = {}
    for file in files:
        for manifest in yaml.load_all((MANIFESTS / file).read_text(), StrictLoader):
            every[manifest["kind"], manifest["metadata"]["name"]] = manifest
    return every


def pod_of(every, kind, name):
    return every[kind, name]["spec"]["template"]["spec"]


def check_pod(name, pod):
    context = pod["securityContext"]
    check(context["runAsNonRoot"] and context["runAsUser"] == USER, f"{name}: runs as another user")
    check(context["seccompProfile"] == {"type": "RuntimeDefault"}, f"{name}: has no seccomp profile")
    check(pod["automountServiceAccountToken"] is False, f"{name}: has a token of the cluster")
    for container in pod["initContainers"] + pod["containers"]:
        what = f"{name}, {container['name']}"
        own = container["securityContext"]
        check(own["readOnlyRootFilesystem"] is True, f"{what}: its root can be written")
        check(own["allowPrivilegeEscalation"] is False, f"{what}: may gain rights")
        check(own["capabilities"] == {"drop": ["ALL"]}, f"{what}: has capabilities")
        check("memory" in container["resources"]["limits"], f"{what}: has no limit of memory")
        check("lifecycle" not in container, f"{what}: does not get its signal at once")
    for volume in pod["volumes"]:
        if "secret" in volume:
            check(volume["secret"]["secretName"] in SECRETS, f"{name}: unknown secret {volume}")


def option_of(container, name):
    values = [arg.partition("=")[2] for arg in container["args"] if arg.startswith(f"--{name}=")]
    check(len(values) == 1, f"--{name} = {values} (must be there once)")
    return values[0]


def check_ports(every):
    container = pod_of(every, "StatefulSet", "proofmass-coordinator")["containers"][0]
    ports = {port["name"]: port["containerPort"] for port in container["ports"]}
    for option, port in (("bind", "workers"), ("bind-clients", "clients")):
        bound = option_of(container, option)
        is_port = bound == f"tcp://*:{ports[port]}"
        check(is_port, f"--{option} = {bound} (must be port {ports[port]})")
    for name, port in (("proofmass-coordinator", "workers"), ("proofmass-clients", "clients")):
        served = every["Service", name]["spec"]["ports"]
        expected = [{"name": port, "port": ports[port], "targetPort": port}]
        check(served == expected, f"{name}: ports = {served} (must be {expected})")
    worker = pod_of(every, "Deployment", "proofmass-worker")["containers"][0]
    address = f"tcp://proofmass-coordinator:{ports['workers']}"
    connect = option_of(worker, "connect")
    check(connect == address, f"--connect = {connect} (must be {address})")
    egress = every["NetworkPolicy", "proofmass-worker"]["spec"]["egress"]
    check({"protocol": "TCP", "port": ports["workers"]} in egress[0]["ports"], f"{egress}")


def check_selectors(every):
    for (kind, name), manifest in every.items():
        spec = manifest.get("spec", {})
        if kind in ("Deployment", "StatefulSet"):
            labels = spec["template"]["metadata"]["labels"]
            check(spec["selector"]["matchLabels"] == labels, f"{kind} {name}: selects other pods")


class Cluster:
    """Processes in a network of their own, in which proofmass-coordinator is this machine."""

    def __init__(self, programs, directory):
        self.directory = directory
        self.programs = programs
        directory.chmod(0o711)
        hosts = directory / "hosts"
        hosts.write_text("127.0.0.1 localhost proofmass-coordinator\n")
        inside = "ip link set lo up && mount --bind \"$0\" /etc/hosts && echo && exec sleep infinity"
        self.holder = subprocess.Popen(
            ["unshare", "--net", "--mount", "sh", "-c", inside, hosts],
            stdout=subprocess.PIPE,
            text=True,
        )
        if self.holder.stdout.readline() != "\n":
            checking.skip("a network namespace cannot be made")

    def start(self, command, environment=(), **more):
        enter = ["nsenter", "--target", str(self.holder.pid), "--net", "--mount"]
        path = f"PATH={self.programs}:/usr/bin:/bin"
        return subprocess.Popen(
            [*enter, "env", "--ignore-environment", path, *environment, *command],
            text=True,
            **more,
        )

    def run(self, *command, environment=()):
        process = self.start(
            command, environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        output = process.communicate()[0]
        check(process.returncode == 0, f"{command} gives {process.returncode}\n{output}")
        return output

    def make_secret(self, pod, keys):
        """As a volume of Kubernetes."""
        (secret,) = (volume["secret"] for volume in pod["volumes"] if "secret" in volume)
        place = Path(tempfile.mkdtemp(dir=self.directory))
        place.chmod(0o755)
        (place / "..data").mkdir()
        for name in SECRETS[secret["secretName"]]:
            file = place / "..data" / name
            shutil.copy(keys / name, file)
            file.chmod(secret["defaultMode"])
            os.chown(file, 0, pod["securityContext"]["fsGroup"])
            (place / name).symlink_to(f"..data/{name}")
        return place

    def make_volumes(self, pod, keys):
        """Where each path of a container is here."""
        places = {"/secret": self.make_secret(pod, keys)}
        for path in ("/keys", "/campaigns"):
            places[path] = Path(tempfile.mkdtemp(dir=self.directory))
            os.chown(places[path], USER, USER)
        return places

    def start_container(self, pod, container, places, environment=(), log=None):
        command = container["command"] + container.get("args", [])
        for path, place in places.items():
            command = [re.sub(rf"(?<![\w/]){path}\b", str(place), word) for word in command]
        group = str(pod["securityContext"]["runAsGroup"])
        as_user = ["setpriv", "--reuid", str(pod["securityContext"]["runAsUser"]), "--regid", group]
        as_user += ["--clear-groups", "--inh-caps=-all", "--bounding-set=-all", "--no-new-privs"]
        return self.start([*as_user, *command], environment, stderr=log)

    def stop(self):
        self.holder.kill()
        self.holder.wait()


def run_pods(cluster, every, directory):
    """The campaign by the pods, and by `proofmass run`."""
    keys = directory / "keys"
    cluster.run("proofmass", "keygen", keys)
    coordinator_pod = pod_of(every, "StatefulSet", "proofmass-coordinator")
    worker_pod = pod_of(every, "Deployment", "proofmass-worker")
    places = {}
    for name, pod in (("coordinator", coordinator_pod), ("worker", worker_pod)):
        places[name] = cluster.make_volumes(pod, keys)
        init = cluster.start_container(pod, pod["initContainers"][0], places[name])
        check(init.wait() == 0, f"the keys of the {name} cannot be made")

    logs = {name: directory / f"{name}.log" for name in places}
    environment = ["PROOFMASS_THREADS=2", "PROOFMASS_NAME=proofmass-worker-abc"]

    def start(name, pod, *environment):
        with open(logs[name], "a", encoding="utf-8") as log:
            return cluster.start_container(
                pod, pod["containers"][0], places[name], environment, log
            )

    def wait_for(name, event, count=1):
        wait_until(f"{event} of {name}", lambda: logs[name].read_text().count(f'"{event}"') >= count)

    processes = []
    try:
        processes.append(start("coordinator", coordinator_pod))
        wait_for("coordinator", "coordinator_started")
        worker = start("worker", worker_pod, *environment)
        processes.append(worker)
        wait_for("worker", "registered")
        client = [f"PROOFMASS_KEYS={keys}", "PROOFMASS_CLIENT_CONNECT=tcp://localhost:5556"]
        checking.write_short_campaign(cluster.programs, directory, NUM_RUNS)
        cluster.run("proofmass", "submit", directory / "short.toml", environment=client)
        stop_coordinator(processes[0])
        processes[0] = start("coordinator", coordinator_pod)
        cluster.run("timeout", "60", "proofmass", "watch", "hardy2013", environment=client)
        wait_for("worker", "registered", 2)
        worker.terminate()
        grace = worker_pod["terminationGracePeriodSeconds"]
        check(worker.wait(grace) == 0, f"exit code of the worker = {worker.returncode} (must be 0)")
        stop_coordinator(processes[0])
    finally:
        for process in processes:
            process.kill()
            process.wait()
    run = ["proofmass", "run", directory / "short.toml", "--db", directory / "run.db", "--quiet"]
    cluster.run(*run)
    databases = [places["coordinator"]["/campaigns"] / "hardy2013.db", directory / "run.db"]
    reports = [cluster.run("proofmass", "report", database) for database in databases]
    return [checking.digest_of(text) for text in reports]


def stop_coordinator(process):
    """With the signal of its image."""
    text = (checking.SOURCE / "deploy/container/Containerfile").read_text()
    process.send_signal(signal.Signals[re.search(r"^STOPSIGNAL (\w+)$", text, re.MULTILINE)[1]])
    code = process.wait(60)
    check(code == 0, f"exit code of the coordinator = {code} (must be 0)")


def check_times(every):
    pod = pod_of(every, "Deployment", "proofmass-worker")
    drain_time = int(option_of(pod["containers"][0], "drain-time").removesuffix("s"))
    grace = pod["terminationGracePeriodSeconds"]
    # After --drain-time a worker waits 5 s for its threads.
    check(grace >= drain_time + 10, f"terminationGracePeriodSeconds = {grace} (too short)")


def check_schema():
    script = Path(__file__).with_name("kubernetes_schema.mjs")
    with tempfile.TemporaryDirectory() as directory:
        shutil.copy(script, directory)
        install = ["npm", "install", "--no-audit", "--no-fund", "--silent"]
        modules = ["kubernetes-models@4.5.1", "yaml@2", "typescript@5"]
        subprocess.run([*install, *modules], cwd=directory, check=True)
        files = sorted(set(MANIFESTS.glob("*.yaml")) - {MANIFESTS / "kustomization.yaml"})
        checked = subprocess.run(["node", script.name, *files], cwd=directory, check=False)
        check(checked.returncode == 0, "the manifests do not follow the schema")


def main():
    parser = checking.parser_of(__doc__)
    parser.add_argument("--schema", action="store_true", help="check types and fields, too")
    arguments = parser.parse_args()
    if os.geteuid() != 0:
        checking.skip("needs root")
    with tempfile.TemporaryDirectory() as name, checking.failure_told(lambda: Path(name).glob("*.log")):
        every = manifests()
        check_pod("coordinator", pod_of(every, "StatefulSet", "proofmass-coordinator"))
        check_pod("worker", pod_of(every, "Deployment", "proofmass-worker"))
        check_ports(every)
        check_selectors(every)
        check_times(every)
        if arguments.schema:
            check_schema()
        cluster = Cluster(arguments.programs.resolve(), Path(name))
        try:
            digests = run_pods(cluster, every, Path(name))
        finally:
            cluster.stop()
        check(digests[0] == digests[1], f"digests = {digests} (must be equal)")
        print(f"{len(every)} manifests, digest = {digests[0]}")


if __name__ == "__main__":
    main()
