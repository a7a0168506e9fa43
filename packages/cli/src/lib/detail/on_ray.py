"""Builds the parts of a scene on the machines of a Ray cluster, and joins them.

    python on_ray.py --parts 64 -- gaussian-splat detail city.json --out /shared/city --memory 2GB

All machines must see the files of the scene and the folder of --out under the same paths. Ray starts the parts, and
starts a part again if its worker or its process is lost. RAY_ADDRESS names the cluster; --local N makes one here.
"""

import argparse
import os
import subprocess
import sys

import ray


class LostPartError(Exception):
    """The process of a part was ended by a signal, for example because of its memory."""


def run_part(command: list[str], part: str) -> str:
    """Runs one part, such as ``3/64``, and returns the last line that it printed.

    Raises:
        LostPartError: A signal ended the process. Ray runs the part again.
        RuntimeError: The command failed. Another try would fail, too.
    """
    ended = subprocess.run([*command, "--part", part], capture_output=True, text=True, check=False)
    if ended.returncode < 0:
        raise LostPartError(f"part {part}: ended by signal {-ended.returncode}")
    if ended.returncode > 0:
        raise RuntimeError(f"part {part}: {ended.stderr.strip() or ended.stdout.strip()}")
    return ended.stdout.strip().splitlines()[-1]


def main() -> int:
    """Runs the command line. Returns the exit status of ``--join``, or 1 if a part failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", type=int, required=True, help="number of parts, 1 or more")
    parser.add_argument("--retries", type=int, default=3, help="how often a lost part is started again (3)")
    parser.add_argument("--cpus", type=float, default=1, help="CPU cores that Ray reserves for a part (1)")
    parser.add_argument("--local", type=int, metavar="CPUS", help="a cluster of this machine alone, with this number of CPU cores")
    parser.add_argument("command", nargs="+", help="gaussian-splat detail with its options, after --")
    options = parser.parse_args()
    ray.init(num_cpus=options.local, log_to_driver=False, include_dashboard=False)
    part = ray.remote(run_part).options(
        num_cpus=options.cpus, max_retries=options.retries, retry_exceptions=[LostPartError]
    )
    waiting = [part.remote(options.command, f"{k + 1}/{options.parts}") for k in range(options.parts)]
    failed = False
    while waiting:
        done, waiting = ray.wait(waiting)
        try:
            print(ray.get(done[0]), flush=True)
        except (ray.exceptions.RayError, RuntimeError, LostPartError) as error:
            print(error, file=sys.stderr, flush=True)
            failed = True
    ray.shutdown()
    if failed:
        return 1
    return subprocess.run([*options.command, "--join"], check=False, env=os.environ).returncode


if __name__ == "__main__":
    sys.exit(main())
