"""Untrusted files: a named error, and no more steps and bytes than a file weighs.

SECURITY.md: "Commands and the exporter read untrusted files, too".
"""

import io
import pickle
import resource
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gaussian_exporter.checkpoints.avatar_file import read_npz
from gaussian_exporter.checkpoints.body_model import read_body
from gaussian_exporter.checkpoints.cfg_args import read_cfg_args
from gaussian_exporter.checkpoints.networks import read_network
from gaussian_exporter.checkpoints.ply import read_ply
from gaussian_exporter.checkpoints.torch_file import read_tensors
from gaussian_exporter.errors import ExportError

MAX_BYTES = 200_000_000
# Read, because they take nothing once a number is no size and a call is no call.
HARMLESS = ("a memo of two billion", "a call of the system")
CASES = Path(__file__).resolve().parents[4] / "shared/cases/attack-4"


def zipped(**files: bytes) -> bytes:
    """An archive, deflated."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name.replace("__", "/"), data)
    return out.getvalue()


def torch(program: bytes, storage: bytes = b"\0\0\0\0") -> bytes:
    """A file of torch.save with this pickle, and one storage."""
    return zipped(a__data_pkl=program, a__data__0=storage).replace(b"data_pkl", b"data.pkl")


def tensor(size: str, stride: str) -> bytes:
    """Steps that push a tensor of the storage: arguments as Python's literals of tuples of int32."""

    def numbers(values: str) -> bytes:
        return b"(" + b"".join(b"J" + int(n).to_bytes(4, "little") for n in values.split()) + b"t"

    storage = b"(X\7\0\0\0storagectorch\nFloatStorage\nX\1\0\0\0" + b"0X\3\0\0\0cpuK\1tQ"
    return b"ctorch._utils\n_rebuild_tensor_v2\n(" + storage + b"K\0" + numbers(size) + numbers(stride) + b"\x89tR"


LIST = b"](" + b"K\0" * 50_000 + b"eq\1"  # a list of 50,000 numbers, kept as number 1
NPY = io.BytesIO()
np.lib.format.write_array_header_2_0(NPY, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)})

HOSTILE: dict[str, tuple[str, Callable[[], bytes]]] = {
    "repeated numbers": ("a.pt", lambda: torch(b"\x80\2" + tensor("50000 8000", "0 0") + b".")),
    "a tensor many times": ("a.pt", lambda: torch(b"\x80\2](" + 400 * tensor("1000 1000", "0 0") + b"e.")),
    "a memo of two billion": ("a.pt", lambda: torch(b"\x80\2Nr\xff\xff\xff\x7f.")),
    "endless steps": ("a.pt", lambda: torch(b"\x80\2" + b"N0" * 2_000_000 + b"N.")),
    "copies of a list": ("a.pt", lambda: torch(b"\x80\2" + LIST + b"0" + b"ctorch\nSize\nh\1\x85R0" * 5_000 + b"N.")),
    "a compressed storage": ("a.pt", lambda: torch(b"\x80\2" + tensor("1", "1") + b".", bytes(400_000_000))),
    "a compressed program": ("a.pt", lambda: torch(b"N" * 400_000_000)),
    "long bytes": ("a.pt", lambda: torch(b"\x80\5\x96" + (1 << 40).to_bytes(8, "little") + b".")),
    "a list in itself": ("a.pt", lambda: torch(b"\x80\2]q\1h\1a.")),
    "nested lists": ("a.pt", lambda: torch(b"\x80\2" + b"]" * 100_000 + b"a" * 99_999 + b".")),
    "lists of lists": (
        "a.pt",
        lambda: torch(b"\x80\2]q\1" + b"".join(b"](" + b"h\1" * 100 + b"eq\1" for _ in range(9)) + b"."),
    ),
    "a call of the system": (
        "a.pt",
        lambda: torch(b"cos\nsystem\n(X\1\0\0\0:tRcbuiltins\neval\n(X\1\0\0\0" + b"1tR\x86."),
    ),
    "classes": ("a.pt", lambda: torch(b"\x80\2" + b"".join(b"ca\n%d\n0" % k for k in range(100_000)) + b"N.")),
    "no archive": ("a.pt", lambda: pickle.dumps([1])),
    "zeros": ("a.npz", lambda: zipped(**{"a.npy": _npy(np.zeros(50_000_000))})),
    "a shape of a terabyte": ("a.npz", lambda: zipped(**{"a.npy": NPY.getvalue()})),
    "objects": ("a.npz", lambda: zipped(**{"a.npy": _npy(np.array([{}], object))})),
    "a nested text": ("cfg_args", lambda: b"Namespace(a=" + b"(" * 100_000),
    "a nested sign": ("cfg_args", lambda: b"Namespace(a=" + b"-" * 500_000 + b"1)"),
    "a long text": ("cfg_args", lambda: b"Namespace(" + b"a=1," * 1_000_000 + b")"),
    "nested JSON": ("config.json", lambda: b"[" * 500_000),
    "a number that is none": (
        "a.ply",
        lambda: b"ply\nformat ascii 1.0\nelement vertex x\nproperty float x\nend_header\n",
    ),
    "a name twice": (
        "a.ply",
        lambda: b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property float x\n" * 2 + b"end_header\n1 1\n",
    ),
    "endless vertices": (
        "a.ply",
        lambda: b"ply\nformat ascii 1.0\nelement vertex 9999999999\nproperty float x\nend_header\n1\n",
    ),
}


def _npy(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array(out, array)
    return out.getvalue()


def read(path: Path) -> object:
    """Reads a file as the command would, by its name."""
    if path.name == "config.json":
        return read_network(path.parent, "hostile", ())
    if path.name == "cfg_args":
        return read_cfg_args(path)
    if path.suffix == ".npz":
        return read_npz(path), read_body(path)
    return read_ply(path) if path.suffix == ".ply" else read_tensors(path)


def outcome(path: Path) -> str:
    """The end of reading a file in a process of its own: code, bytes by which its peak grew, seconds of CPU."""
    run = subprocess.run(
        [sys.executable, __file__, str(path)], capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_by_name_and_cost_what_they_weigh(name: str, tmp_path: Path) -> None:
    file, make = HOSTILE[name]
    path = tmp_path / file
    path.write_bytes(make())
    code, grown, cpu = outcome(path).split()
    print(f"{name}: {path.stat().st_size} bytes, {code}, {int(grown) / 1e6:.0f} MB, {cpu} s of CPU")
    assert code.startswith("checkpoint/") or name in HARMLESS, code
    assert int(grown) <= MAX_BYTES


@pytest.mark.parametrize("name", ["pt-stride-0.pt", "pt-cycle.pt"])
def test_the_cases_of_the_review(name: str) -> None:
    if not (CASES / name).exists():
        pytest.skip("the shared cases are not there")
    code, grown, _ = outcome(CASES / name).split()
    assert code == "checkpoint/unreadable"
    assert int(grown) <= MAX_BYTES


def test_what_networks_share_is_read_once(tmp_path: Path) -> None:
    path = tmp_path / "a.pt"
    numbers = np.arange(6, dtype=np.float32)
    path.write_bytes(
        torch(
            b"\x80\2}(X\1\0\0\0a" + tensor("2 3", "3 1") + b"X\1\0\0\0b" + tensor("3 2", "1 3") + b"u.",
            numbers.tobytes(),
        )
    )
    found = read_tensors(path)
    np.testing.assert_array_equal(found["a"], numbers.reshape(2, 3))
    np.testing.assert_array_equal(found["b"], numbers.reshape(2, 3).T)


def test_damaged_programs_end_in_named_errors(tmp_path: Path) -> None:
    program = b"\x80\2}(X\1\0\0\0a" + tensor("1 1", "1 1") + b"X\1\0\0\0bcb\nc\n)R}X\1\0\0\0d]sbu."
    random = np.random.default_rng(1)
    path = tmp_path / "a.pt"
    ended = {"read": 0, "refused": 0}
    for _ in range(2000):
        damaged = bytearray(program)
        for at in random.integers(2, len(program), random.integers(1, 4)):
            damaged[at] = random.integers(256) if random.random() < 0.5 else random.choice(list(program))
        path.write_bytes(torch(bytes(damaged)))
        try:
            read_tensors(path)
            ended["read"] += 1
        except ExportError:
            ended["refused"] += 1
    assert min(ended.values()) > 10, ended


def peak() -> int:
    """Largest memory of this process until now, in bytes. Linux knows that of the process without its parent."""
    status = Path("/proc/self/status")
    if status.exists():
        return 1024 * int(status.read_text().split("VmHWM:")[1].split()[0])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


if __name__ == "__main__":
    before, start = peak(), time.process_time()
    try:
        read(Path(sys.argv[1]))
        ended = "read"
    except ExportError as error:
        ended = error.code
        assert len(str(error)) < 2000
    print(ended, peak() - before, round(time.process_time() - start, 2))
