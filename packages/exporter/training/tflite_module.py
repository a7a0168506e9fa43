"""A network of TensorFlow Lite as a PyTorch module, planes first; weights of 16 bits become float32. Needs the package
tflite.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import tflite
import torch
from torch import Tensor
from torch.nn import functional

_TYPES = {0: np.float32, 1: np.float16, 2: np.int32}


class TfliteModule(torch.nn.Module):
    """The first graph of a file: convolutions, pooling, rectifiers, sums, reshapes and joins."""

    def __init__(self, content: bytes):
        """`content`: the bytes of a .tflite file. Raises NotImplementedError for an operator of another kind."""
        super().__init__()
        self.model = tflite.Model.GetRootAsModel(content, 0)
        graph = self.model.Subgraphs(0)
        self.sizes: dict[int, tuple[int, ...]] = {}
        self.stored: dict[int, np.ndarray] = {}
        for index in range(graph.TensorsLength()):
            tensor = graph.Tensors(index)
            self.sizes[index] = tuple(int(size) for size in tensor.ShapeAsNumpy()) if tensor.ShapeLength() else ()
            data = self.model.Buffers(tensor.Buffer())
            if data.DataLength():
                numbers = np.frombuffer(data.DataAsNumpy().tobytes(), _TYPES[tensor.Type()])
                self.stored[index] = numbers.reshape(self.sizes[index])
        self.inputs = [graph.Inputs(i) for i in range(graph.InputsLength())]
        self.outputs = [graph.Outputs(i) for i in range(graph.OutputsLength())]
        self.steps = [step for i in range(graph.OperatorsLength()) for step in self._step(graph.Operators(i), i)]

    def _step(self, operator: Any, index: int) -> list[tuple[str, list[int], int, dict[str, Any]]]:
        """Name, inputs, output and options of an operator; none for constants."""
        name = tflite.opcode2name(self.model.OperatorCodes(operator.OpcodeIndex()).BuiltinCode())
        inputs = [int(i) for i in operator.InputsAsNumpy()]
        (output,) = (int(i) for i in operator.OutputsAsNumpy())
        if name == "DEQUANTIZE":
            self.stored[output] = self.stored[inputs[0]].astype(np.float32)
            return []
        given = {
            "CONV_2D": tflite.Conv2DOptions,
            "DEPTHWISE_CONV_2D": tflite.DepthwiseConv2DOptions,
            "MAX_POOL_2D": tflite.Pool2DOptions,
            "ADD": tflite.AddOptions,
            "CONCATENATION": tflite.ConcatenationOptions,
        }.get(name)
        if given is None and name not in ("PRELU", "PAD", "RESHAPE", "RELU"):
            raise NotImplementedError(name)
        options = given() if given else None
        if options is not None:
            options.Init(operator.BuiltinOptions().Bytes, operator.BuiltinOptions().Pos)
        said: dict[str, Any] = {}
        if name in ("CONV_2D", "DEPTHWISE_CONV_2D"):
            order = (0, 3, 1, 2) if name == "CONV_2D" else (3, 0, 1, 2)
            said["weight"] = self._keep(f"weight_{index}", self.stored[inputs[1]].transpose(order))
            said["bias"] = self._keep(f"bias_{index}", self.stored[inputs[2]])
        if name in ("CONV_2D", "DEPTHWISE_CONV_2D", "MAX_POOL_2D"):
            said |= {"stride": options.StrideH(), "is_same": options.Padding() == 0}
        if name == "MAX_POOL_2D":
            said["kernel"] = options.FilterHeight()
        if name in ("CONV_2D", "DEPTHWISE_CONV_2D", "ADD"):
            said["is_rectified"] = options.FusedActivationFunction() == 1
        if name == "PRELU":
            said["slope"] = self._keep(f"slope_{index}", self.stored[inputs[1]].reshape(-1))
        if name == "PAD":
            said["sides"] = self.stored[inputs[1]].tolist()
        if name == "RESHAPE":
            said["size"] = self.sizes[output]
        if name == "CONCATENATION":
            said["axis"] = options.Axis()
        return [(name, inputs, output, said)]

    def _keep(self, name: str, numbers: np.ndarray) -> str:
        self.register_buffer(name, torch.tensor(np.array(numbers)))
        return name

    def forward(self, image: Tensor) -> list[Tensor]:
        """Images (1,C,H,W); outputs in the order of the file."""
        values = {self.inputs[0]: image}
        for name, inputs, output, said in self.steps:
            values[output] = self._run(name, [values[i] for i in inputs if i in values], said)
        return [values[i] for i in self.outputs]

    def _run(self, name: str, given: list[Tensor], said: dict[str, Any]) -> Tensor:
        x = given[0]
        if name in ("CONV_2D", "DEPTHWISE_CONV_2D"):
            weight, bias = getattr(self, said["weight"]), getattr(self, said["bias"])
            x = _padded(x, weight.shape[-1], said["stride"]) if said["is_same"] else x
            groups = 1 if name == "CONV_2D" else x.shape[1]
            x = functional.conv2d(x, weight, bias, stride=said["stride"], groups=groups)
        elif name == "PRELU":
            x = functional.prelu(x, getattr(self, said["slope"]))
        elif name == "MAX_POOL_2D":
            x = _padded(x, said["kernel"], said["stride"], -1e9) if said["is_same"] else x
            x = functional.max_pool2d(x, said["kernel"], said["stride"])
        elif name == "PAD":
            _, (top, bottom), (left, right), (before, after) = said["sides"]
            x = functional.pad(x, (left, right, top, bottom, before, after))
        elif name == "ADD":
            x = x + given[1]
        elif name == "RESHAPE":
            # The file has channels last.
            x = (x.permute(0, 2, 3, 1) if x.dim() == 4 else x).reshape(said["size"])
        elif name == "CONCATENATION":
            x = torch.cat(given, said["axis"])
        return functional.relu(x) if name == "RELU" or said.get("is_rectified") else x


def _padded(x: Tensor, kernel: int, stride: int, value: float = 0.0) -> Tensor:
    """Padding "same" of TensorFlow, the larger half behind."""
    high, wide = (max((-(-size // stride) - 1) * stride + kernel - size, 0) for size in x.shape[-2:])
    sides = (wide // 2, wide - wide // 2, high // 2, high - high // 2)
    return functional.pad(x, sides, value=value) if high or wide else x
