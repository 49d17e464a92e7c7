"""Many days of tracks to one zone, on this machine, on machines with SSH, or on a cluster with SLURM.

    python many_days.py local 4 DAYS OUT                  # 4 processes on this machine
    python many_days.py ssh HOST1,HOST2,HOST2 DAYS OUT    # a process for each name: two on HOST2
    python many_days.py slurm 20 DAYS OUT                 # 20 jobs of one core each

DAYS is a folder of tracks. OUT gets the encounters of each day (OUT/days) and the zone (OUT/zone.json). Start the
program again to resume: finished days are kept. To compare the zone with people who ignore each other, run
`szlib fit OUT/days --tracks FILE --out OUT/zone.json` with the tracks of one day.

All machines have szlib with its extra `examples` at the same path, and share DAYS and OUT. SSH works without a
password; ~/.ssh/config is used. The queue and account of SLURM are read from ~/.config/dask/jobqueue.yaml.
"""

import sys
from pathlib import Path

from dask_jobqueue import SLURMCluster
from distributed import LocalCluster, SSHCluster

import szlib
from szlib.core.parallel import cluster

JOB = {"cores": 1, "memory": "4GB", "walltime": "04:00:00"}  # of SLURM
QUEUE = 24 * 3600.0  # longest wait for the first process [s]


def start_cluster(kind: str, size: str):
    """Start a Dask cluster whose processes compute one day at a time."""
    if kind == "local":
        return LocalCluster(n_workers=int(size), threads_per_worker=1)
    if kind == "ssh":
        hosts = size.split(",")  # the scheduler runs on the first
        return SSHCluster([hosts[0], *hosts], worker_options={"nthreads": 1})
    if kind == "slurm":
        return SLURMCluster(n_workers=int(size), **JOB)
    sys.exit(f"the first argument must be local, ssh or slurm; got {kind!r}")


def main(kind: str, size: str, days: str, out: str) -> None:
    """Extract the encounters of all `days` on the cluster, fit the zone, save it, and print its verdict."""
    Path(out).mkdir(parents=True, exist_ok=True)
    with start_cluster(kind, size) as machines, cluster(machines.scheduler_address, wait=QUEUE) as client:
        client.wait_for_workers(len(machines.worker_spec))  # joblib uses only those that are there now
        extraction = szlib.extract_days(days, out=Path(out) / "days")
    print(extraction)
    zone = szlib.SocialZone.fit(extraction.samples())
    zone.save(Path(out) / "zone.json")
    print(zone.verdict(1.1).sentence)


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) == 5 else sys.exit(__doc__)
