"""Messages byte by byte, and what the widget sends when, without a page."""

import asyncio
import struct
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from gaussian_notebook import Splats, message

Floats = npt.NDArray[np.float64]


def scene(count: int, coefficients: int = 4) -> dict[str, Floats]:
    random = np.random.default_rng(count)
    shapes = {"means": 3, "quats": 4, "scales": 3}
    arrays = {name: random.normal(size=(count, width)) for name, width in shapes.items()}
    return {**arrays, "opacities": random.normal(size=count), "sh": random.normal(size=(count, coefficients, 3))}


class Recorded(Splats):
    """Keeps what it sends."""

    sent: list[tuple[dict[str, Any], list[bytes]]]

    def send(self, content: dict[str, Any], buffers: list[bytes]) -> None:
        self.__dict__.setdefault("sent", []).append((content, buffers))


def steps(widget: Recorded) -> list[int]:
    return [
        struct.unpack_from("<I", buffers[0], 8)[0] for content, buffers in widget.sent if content["type"] == "update"
    ]


def test_a_message_has_a_header_and_the_arrays_in_order() -> None:
    arrays = scene(3)
    data = message(
        {"sh": arrays["sh"], "positions": arrays["means"], "scales": arrays["scales"], "rotations": arrays["quats"],
         "opacities": arrays["opacities"][:, None]},
        step=7, raw=True, filter="mip",
    )  # fmt: skip
    assert struct.unpack_from("<4s4B4I3d", data) == (b"GSUP", 1, 2 | 8, 0b11111, 1, 7, 0, 3, 0, 0.0, 0.0, 0.0)
    expected = [arrays[name].ravel() for name in ("means", "scales", "quats", "opacities", "sh")]
    np.testing.assert_array_equal(np.frombuffer(data, "<f4", offset=48), np.concatenate(expected).astype("<f4"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"means": np.zeros((4, 2))}, r"positions: expected the shape \(4, 3\), found \(4, 2\)"),
        ({"quats": np.zeros((5, 4))}, "rotations"),
        ({"opacities": None}, "opacities: expected an array"),
        ({"sh": np.zeros((4, 5, 3))}, "sh: expected 1, 4, 9 or 16 coefficients"),
        ({"sh": None}, "sh: expected either sh or colors"),
    ],
)
def test_arrays_that_do_not_match_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Splats(*{**scene(4), **change}.values())


def test_updates_wait_for_the_page_and_the_newest_wins() -> None:
    asyncio.run(updates_of_a_kernel())


async def updates_of_a_kernel() -> None:
    widget = Recorded(*scene(4).values())
    assert steps(widget) == [1]
    for _ in range(5):
        widget.update(*scene(4).values())
    assert steps(widget) == [1], "the page has not answered"
    widget._receive(None, {"type": "shown", "step": 1}, [])
    assert steps(widget) == [1, 6]
    assert widget.shown == 1
    widget._receive(None, {"type": "scene"}, [])
    assert steps(widget) == [1, 6, 6], "another view gets the newest scene"
    assert widget.update(opacities=np.zeros(2), first=1) == 7
    assert steps(widget)[-1] == 7, "ranges are always sent"
    widget._receive(None, {"type": "scene"}, [])
    opacities = np.frombuffer(widget.sent[-1][1][0], "<f4", offset=48 + 4 * 4 * (3 + 3 + 4))[:4]
    assert steps(widget)[-1] == 7
    np.testing.assert_array_equal(opacities == 0, [False, True, True, False])
    with pytest.raises(ValueError, match="a range within 4 splats, found 3 to 5"):
        widget.update(opacities=np.zeros(2), first=3)
    widget.update(*scene(4).values())
    await asyncio.sleep(2 / widget.max_rate)
    assert steps(widget)[-1] == 8, "after a cell, without an answer of the page"


def test_a_cell_that_trains_sends_at_most_max_rate() -> None:
    widget = Recorded(*scene(4).values())
    widget.max_rate = 1e6
    for _ in range(3):
        widget._sent_at = 0
        widget.update(*scene(4).values())
    assert steps(widget) == [1, 2, 3, 4]


def test_files_are_sent_to_views_that_ask(tmp_path: Any) -> None:
    (tmp_path / "a.spz").write_bytes(b"spz")
    widget = Recorded(str(tmp_path / "a.spz"), up="z", auto_rotate=True, height="200px")
    widget._receive(None, {"type": "scene"}, [])
    assert widget.sent == [({"type": "file", "name": "a.spz"}, [b"spz"])]
    assert (widget.attributes, widget.height) == ({"up": "z", "auto-rotate": ""}, "200px")
    assert Splats("https://example.com/a.spz").src == "https://example.com/a.spz"
    with pytest.raises(ValueError, match="which names other files"):
        Splats(str(tmp_path / "lod-meta.json"))
    with pytest.raises(FileNotFoundError):
        Splats(str(tmp_path / "none.ply"))
