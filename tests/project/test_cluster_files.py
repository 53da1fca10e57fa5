"""The files for clusters: jobs of SLURM as dask-jobqueue writes them, objects of Kubernetes, and their commands."""

import importlib.util
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from stabctl import cli

FOLDER = Path(__file__).parents[2] / "docs" / "examples" / "cluster"


def test_the_jobs_of_slurm_start_workers():
    pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed: pip install 'stabctl[test]'")
    spec = importlib.util.spec_from_file_location("slurm", FOLDER / "slurm.py")
    slurm = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(slurm)
    with slurm.cluster(host="127.0.0.1") as jobs:
        script = jobs.job_script()
    assert subprocess.run(["bash", "-n"], input=script, text=True).returncode == 0
    for line in ("#SBATCH --requeue", "#SBATCH --cpus-per-task=16", "#SBATCH -t 04:00:00", "export OMP_NUM_THREADS=1"):
        assert line in script.splitlines()
    command = script.splitlines()[-1]
    assert "distributed.cli.dask_worker tcp://127.0.0.1:" in command
    assert "--nthreads 1 " in command
    assert "--nworkers 16 " in command


def test_what_the_page_installs_is_what_the_script_imports():
    project = tomllib.loads((FOLDER.parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    names = {re.split(r"[<>=]", one)[0].replace("-", "_") for one in project["optional-dependencies"]["cluster"]}
    assert "dask_jobqueue" in names
    assert "from dask_jobqueue import" in (FOLDER / "slurm.py").read_text("utf-8")


def test_the_image_has_the_code_of_the_case_that_is_screened(objects):
    (case,) = (one["command"][2] for one in containers(objects) if one["command"][:2] == ["stabctl", "screen"])
    for path in (FOLDER / "kubernetes.yaml", FOLDER.parents[1] / "cluster.md"):
        assert re.findall(r"&& stabctl simulate (\w+)", path.read_text("utf-8")) == [case]


@pytest.mark.parametrize("page", ["cluster.md", "sweeps.md"])
def test_the_workers_of_the_pages_have_one_thread_each(page):
    """Dask replaces the threads asked for if it is to choose the number of processes."""
    worker = pytest.importorskip("distributed.cli.dask_worker").main
    lines = (FOLDER.parents[1] / page).read_text("utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith("dask worker "))
    given = worker.make_context("worker", line.partition("#")[0].split()[2:], resilient_parsing=True).params
    assert given["nthreads"] == 1
    assert int(given["n_workers"]) == -1  # one process per core; "auto" is no number


@pytest.fixture(scope="module")
def objects():
    yaml = pytest.importorskip("yaml", reason="comes with Dask: pip install 'stabctl[cluster]'")
    return list(yaml.safe_load_all((FOLDER / "kubernetes.yaml").read_text()))


def containers(objects):
    for one in objects:
        yield from one["spec"].get("template", {}).get("spec", {}).get("containers", [])


def test_the_objects_of_kubernetes_belong_together(objects):
    by_kind = {}
    for one in objects:
        by_kind.setdefault(one["kind"], []).append(one)
    (service,), (job,), (claim,) = (by_kind[kind] for kind in ("Service", "Job", "PersistentVolumeClaim"))
    for one in by_kind["Deployment"]:
        assert one["spec"]["selector"]["matchLabels"] == one["spec"]["template"]["metadata"]["labels"]
    labels = [one["spec"]["template"]["metadata"]["labels"] for one in by_kind["Deployment"]]
    assert service["spec"]["selector"] in labels
    pod = job["spec"]["template"]["spec"]
    (volume,), (mount,) = pod["volumes"], pod["containers"][0]["volumeMounts"]
    assert volume["name"] == mount["name"]
    assert volume["persistentVolumeClaim"]["claimName"] == claim["metadata"]["name"]
    address = f"tcp://{service['metadata']['name']}:{service['spec']['ports'][0]['port']}"
    assert sum(address in one["command"] for one in containers(objects)) == 2  # the workers and the screen


def test_the_commands_of_kubernetes_have_these_options(objects):
    scheduler = pytest.importorskip("distributed.cli.dask_scheduler").main
    worker = pytest.importorskip("distributed.cli.dask_worker").main
    screen = cli.app.get_command(None, "screen")
    known = {("dask", "scheduler"): scheduler, ("dask", "worker"): worker, ("stabctl", "screen"): screen}
    met = set()
    for one in containers(objects):
        program = tuple(one["command"][:2])
        options = {name for p in known[program].params for name in (*p.opts, *p.secondary_opts)}
        given = {word for word in one["command"] if word.startswith("--")}
        assert given <= options
        met.add(program)
    assert met == set(known)
