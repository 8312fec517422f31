"""Units of work on a dask cluster of two processes, one of which is killed."""

import json
import os
import signal
import time
from pathlib import Path

import pytest

from freqid.core.errors import DataError, UsageError
from freqid.simulate import runner
from freqid.simulate.cluster import cluster

pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("default")  # dask's own, of sockets it closes late


def square(path, number, folder=""):
    if number < 0:
        raise DataError(f"number is {number}", remedy="give a positive one")
    if number == 3 and folder and not (Path(folder) / "died").exists():
        (Path(folder) / "died").write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    if folder:
        time.sleep(0.02)
    path.write_text(json.dumps({"square": number**2, "by": os.getpid()}))


@pytest.fixture(scope="module")
def two_workers():
    with cluster(workers=2) as client:
        yield client


def test_a_cluster_gives_what_one_process_gives_though_a_worker_is_killed(two_workers, tmp_path):
    inputs = [{"number": n} for n in range(24)]
    before = set(two_workers.scheduler_info(n_workers=-1)["workers"])
    paths = runner.run_units(
        square, inputs, tmp_path / "many", beside={"folder": str(tmp_path)}, client=two_workers
    )
    alone = runner.run_units(square, inputs, tmp_path / "one")
    assert [p.name for p in paths] == [p.name for p in alone]
    found, expected = ([json.loads(p.read_text()) for p in of] for of in (paths, alone))
    assert [one["square"] for one in found] == [one["square"] for one in expected]
    assert int((tmp_path / "died").read_text()) not in {one["by"] for one in found}
    assert set(two_workers.scheduler_info(n_workers=-1)["workers"]) != before  # one was lost indeed
    assert os.getpid() not in {one["by"] for one in found}
    assert not [p for p in (tmp_path / "many").iterdir() if p.suffix == ".part"]


def test_a_unit_that_fails_on_a_cluster_is_named_and_the_others_are_kept(two_workers, tmp_path):
    with pytest.raises(DataError, match=r"1 of 3 units failed, first \{\"number\": -1\}: number is -1"):
        runner.run_units(square, [{"number": n} for n in (1, -1, 2)], tmp_path, client=two_workers)
    assert len([p for p in tmp_path.iterdir() if p.name != "units.json"]) == 2


def test_what_is_asked_of_a_cluster_is_checked():
    with pytest.raises(UsageError, match="--scheduler names a cluster that runs"), cluster("tcp://a:1", 2):
        pass
    with cluster() as none:
        assert none is None
    with (
        pytest.raises(DataError, match="no scheduler answers at carrier-pigeon://roof"),
        cluster("carrier-pigeon://roof"),
    ):
        pass
