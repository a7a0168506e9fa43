"""The widget `Splats`."""

import asyncio
import time
from pathlib import Path
from typing import Any

import anywidget
import traitlets

from .messages import Arrays, apply, message

_STATIC = Path(__file__).parent / "static"
#: Files whose splats are in other files, which a page cannot find beside them.
_OF_PARTS = {".json", ".gltf", ".lcc", ".lcc2", ".onnx"}


class Splats(anywidget.AnyWidget):
    """Shows 3D Gaussian splats: a file, arrays, or a scene while it trains.

    ```python
    Splats("garden.spz")
    widget = Splats(means, quats, scales, opacities, sh)
    widget.update(means, quats, scales, opacities, sh)
    ```

    Arrays have the shapes and the meaning of `gsplat.rasterization`: see `update`. The element is in the package, so
    that nothing is downloaded.
    """

    _esm = _STATIC / "widget.js"

    #: Address of a scene that the browser loads. None with a local file, and with arrays.
    src = traitlets.Unicode(None, allow_none=True).tag(sync=True)
    #: Position of the camera, such as `30deg 75deg 2m`. Changes when a user moves it.
    camera_orbit = traitlets.Unicode("auto").tag(sync=True)
    #: Point that the camera looks at, such as `0m 1m 0m`. Changes when a user moves the camera.
    camera_target = traitlets.Unicode("auto").tag(sync=True)
    #: Vertical field of view, such as `45deg`. Changes when a user zooms at the closest distance.
    field_of_view = traitlets.Unicode("auto").tag(sync=True)
    #: The last point that a user has clicked, or None: `position` [3] in viewer space, `uncertainty` in world units,
    #: `distance` from the camera, and `splat`, the index of the splat.
    pick = traitlets.Any(None, read_only=True).tag(sync=True)
    #: Positions [3] in viewer space that are marked.
    markers = traitlets.List(traitlets.List(traitlets.Float(), minlen=3, maxlen=3)).tag(sync=True)
    #: Other attributes of the element, by their names in HTML, such as `{"up": "z"}`.
    attributes = traitlets.Dict().tag(sync=True)
    #: Height of the widget in CSS.
    height = traitlets.Unicode("480px").tag(sync=True)
    #: `empty`, `loading`, `ready` or `failed`.
    state = traitlets.Unicode("empty").tag(sync=True)
    #: Message of the last error; empty if there is none.
    error = traitlets.Unicode("").tag(sync=True)
    #: Number of the last update that the page has shown; 0 before the first.
    shown = traitlets.Int(0).tag(sync=True)

    #: Maximum number of scenes in a second that are sent while the page has not answered, as in a cell that trains.
    max_rate = 10.0

    def __init__(
        self,
        source: str | Path | Arrays = None,
        quats: Arrays = None,
        scales: Arrays = None,
        opacities: Arrays = None,
        sh: Arrays = None,
        *,
        raw: bool = False,
        filter: str = "classic",
        **options: Any,
    ) -> None:
        """Creates a widget.

        Args:
            source: Path or address of a scene file; or the centers of arrays: see `update`.
            quats: Rotations, [N, 4].
            scales: Standard deviations, [N, 3].
            opacities: Opacities, [N].
            sh: Spherical harmonics [N, K, 3], or colors [N, 3].
            raw: Whether scales are logarithms and opacities logits.
            filter: Screen-space filter of the training: `classic`, `antialiased` or `mip`.
            options: Traits such as `height`, and attributes of the element, such as `up="z"` or `auto_rotate=True`.

        Raises:
            FileNotFoundError: If there is no such file.
            ValueError: For a file whose splats are in other files, and for arrays whose shapes do not match.
        """
        traits = {name: options.pop(name) for name in list(options) if self.has_trait(name)}
        written = {name.replace("_", "-"): _attribute(value) for name, value in options.items()}
        super().__init__(**{"attributes": written, **traits})
        self._file: tuple[str, bytes] | None = None
        self._newest: bytearray | None = None
        self._step = 0
        self._sent = 0
        self._sent_at = 0.0
        self._filter = filter
        self._raw = raw
        self._later: asyncio.TimerHandle | None = None
        self.on_msg(self._receive)
        if isinstance(source, (str, Path)):
            self._open(str(source))
        elif source is not None:
            self.update(source, quats, scales, opacities, sh)

    def update(
        self,
        means: Arrays = None,
        quats: Arrays = None,
        scales: Arrays = None,
        opacities: Arrays = None,
        sh: Arrays = None,
        *,
        first: int | None = None,
    ) -> int:
        """Shows other splats, and returns the number of the update, which `shown` reaches when the page shows it.

        Call it as often as you like: an update that a newer one has replaced before it could be sent is skipped. A
        range is always sent.

        Args:
            means: Centers in world units, [N, 3].
            quats: Quaternions (w, x, y, z) of any length above 0, [N, 4].
            scales: Standard deviations in world units, [N, 3]; with `raw`, their natural logarithms.
            opacities: Opacities 0..1, [N]; with `raw`, their logits.
            sh: Spherical harmonics, [N, K, 3] with K = 1, 4, 9 or 16; or colors 0..1, [N, 3].
            first: Index of the first splat of a range, whose arrays may be some of those of the scene.

        Raises:
            ValueError: For missing arrays, for shapes that do not match, and for a range outside of the scene.
        """
        is_colors = sh is not None and len(getattr(sh, "shape", ())) == 2
        arrays = {"positions": means, "scales": scales, "rotations": quats, "opacities": opacities}
        arrays["colors" if is_colors else "sh"] = sh
        data = message(arrays, step=self._step + 1, first=first, raw=self._raw, filter=self._filter)
        if first is not None:
            if self._newest is None:
                raise ValueError("first: expected a scene of arrays before a range, found none")
            self._flush()
            apply(self._newest, data)
            self._step += 1
            self._send_update(data)
            return self._step
        self._step += 1
        self._file, self._newest = None, bytearray(data)
        self._flush_in_time()
        return self._step

    def _open(self, source: str) -> None:
        if source.startswith(("http://", "https://", "data:", "blob:")):
            self.src = source
            return
        path = Path(source)
        if path.suffix.lower() in _OF_PARTS:
            raise ValueError(
                f"{source}: expected one file with the whole scene (.ply, .spz, .sog, .splat, .ksplat, .glb, .usdz), "
                f"found {path.suffix}, which names other files. Serve the folder, and pass its address."
            )
        self._file = (path.name, path.read_bytes())

    def _flush_in_time(self) -> None:
        """Sends the newest scene now if the page waits for one or the last is old enough, and otherwise later."""
        wait = self._sent_at + 1 / self.max_rate - time.monotonic()
        if self._sent <= self.shown or wait <= 0:
            self._flush()
        elif self._later is None:
            try:
                # Runs after the cell: then the last update of a loop is sent, too.
                self._later = asyncio.get_running_loop().call_later(wait, self._flush)
            except RuntimeError:
                self._flush()

    def _flush(self) -> None:
        if self._later:
            self._later.cancel()
        self._later = None
        if self._newest is not None and self._step > self._sent:
            self._send_update(self._newest)

    def _send_update(self, data: bytes | bytearray) -> None:
        self._sent, self._sent_at = self._step, time.monotonic()
        self.send({"type": "update"}, [bytes(data)])

    def _receive(self, _: object, content: dict[str, Any], __: object) -> None:
        """Answers a page, which asks for the code of the element once, and for the scene for each view."""
        kind = content.get("type")
        if kind == "element":
            self.send({"type": "element"}, [(_STATIC / "element.js").read_bytes()])
        elif kind == "scene" and self._file:
            self.send({"type": "file", "name": self._file[0]}, [self._file[1]])
        elif kind == "scene" and self._newest is not None:
            self._send_update(self._newest)
        elif kind == "shown":
            self.shown = max(self.shown, int(content["step"]))
            self._flush_in_time()


def _attribute(value: object) -> str | None:
    """Returns the text of an attribute of HTML; None for one that is absent."""
    if isinstance(value, bool):
        return "" if value else None
    return None if value is None else str(value)
