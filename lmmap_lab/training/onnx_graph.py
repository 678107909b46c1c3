"""A mask network in ONNX, from an image to its masks: `FilterNet` and what surrounds it, for other runtimes.

The graph is written node by node: torch's exporter fixes some sizes to those of the image that it saw, and
its successor needs two more packages.
"""

from __future__ import annotations

import numpy as np
from torch import nn

from lmmap.pipeline.network import CHANNELS, SATURATION, STRIDE_PX, FilterNet
from lmmap.types import InputError

OPSET, FORMAT = 17, 8  # versions of ONNX: runtimes of embedded computers lag behind
IMAGES = {
    "rgb": "float32 (N, 3, H, W) of any H and W: red, green and blue of each pixel in this order, 0 to 255",
    "event": "float32 (N, 1, H, W) of any H and W: number of events in each pixel, of both polarities",
}
MASK = "float32 (N, 1, H, W): probability that a pixel shows the {part}, 0 to 1"
PARTS = {"ring": "ring", "reflector": "markers"}
BOTH = "both"  # names the network that gives both masks
TWO_MASKS = (
    "float32 (N, 2, H, W): probability that a pixel shows the ring, and that it shows the markers, 0 to 1"
)


def onnx_package():
    """The package ``onnx``, which only who exports needs; `InputError` where it is absent."""
    try:
        import onnx
    except ImportError:
        raise InputError("export: no package onnx; pip install 'lmmap[export]'") from None
    return onnx


def filter_model(net: FilterNet, name: str, modality: str, facts: dict):
    """The ONNX model of a network, with the input ``image`` and the output ``mask``; N, H and W are free.

    Parameters
    ----------
    net
        Trained; its convolutions may have any width, and may be several in a row.
    name, modality
        Which of `FILTERS` it is, or `BOTH`, and of which camera.
    facts
        What the file is to say of itself, beside what input and output are.
    """
    onnx = onnx_package()
    graph = _Graph(onnx.helper.make_node)
    _add_filter(graph, net, modality)

    def values(end: str, channels: int, text: str):
        shape = ["N", channels, "H", "W"]
        return onnx.helper.make_tensor_value_info(end, onnx.TensorProto.FLOAT, shape, text)

    image, mask = IMAGES[modality], TWO_MASKS if name == BOTH else MASK.format(part=PARTS[name])
    ends = [values("image", CHANNELS[modality], image)], [values("mask", len(net.up[2].bias), mask)]
    constants = [onnx.numpy_helper.from_array(value, key) for key, value in graph.constants.items()]
    whole = onnx.helper.make_graph(graph.nodes, f"{name}-{modality}", *ends, constants)
    opset = [onnx.helper.make_opsetid("", OPSET)]
    model = onnx.helper.make_model(whole, opset_imports=opset, ir_version=FORMAT, producer_name="lmmap")
    onnx.helper.set_model_props(
        model, {key: str(f) for key, f in {"image": image, "mask": mask, **facts}.items()}
    )
    onnx.checker.check_model(model, full_check=True)
    return model


class _Graph:
    """Nodes and constants of a graph as it grows: a call adds a node, and returns the name of its output."""

    def __init__(self, make_node):
        self.nodes, self.constants, self._make_node = [], {}, make_node

    def __call__(self, kind: str, *inputs, output: str | None = None, **attributes) -> str:
        names = [value if isinstance(value, str) else self._constant(value) for value in inputs]
        output = output or f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(self._make_node(kind, names, [output], **attributes))
        return output

    def _constant(self, value) -> str:
        name = f"constant_{len(self.constants)}"
        kind = {int: np.int64, float: np.float32}[type(np.ravel(value)[0].item())]
        self.constants[name] = np.asarray(value, kind)
        return name

    def add_layer(self, x: str, module: nn.Module) -> str:
        """The output of a convolution, or of several in a row."""
        if isinstance(module, nn.Sequential):
            for part in module:
                x = self.add_layer(x, part)
            return x
        options = {"kernel_shape": module.kernel_size, "strides": module.stride, "pads": 2 * module.padding,
                   "group": module.groups}  # fmt: skip
        tensors = module.weight.detach().numpy(), module.bias.detach().numpy()
        if isinstance(module, nn.ConvTranspose2d):
            return self("ConvTranspose", x, *tensors, **options, output_padding=module.output_padding)
        return self("Conv", x, *tensors, **options)


def _add_filter(add: _Graph, net: FilterNet, modality: str) -> None:
    """`network.encode`, `FilterNet.forward` and the sigmoid; the last layer is the one that is trained."""
    if modality == "rgb":
        x = add("Sqrt", add("Div", "image", 255.0))
    else:
        x = add("Div", add("Min", "image", float(SATURATION)), float(SATURATION))
    size = add("Shape", x, start=2)
    strides = add("Div", add("Add", size, [STRIDE_PX - 1]), [STRIDE_PX])
    missing = add("Sub", add("Mul", strides, [STRIDE_PX]), size)
    x = add("Pad", x, add("Concat", [0] * 6, missing, axis=0), mode="edge")
    pooled = []
    for layer in net.down:
        x = add("MaxPool", add("Relu", add.add_layer(x, layer)), kernel_shape=[2, 2], strides=[2, 2])
        pooled.append(x)
    *inner, last = net.up
    for layer, skipped in zip(inner, pooled[-2::-1], strict=True):
        x = add("Concat", add("Relu", add.add_layer(x, layer)), skipped, axis=1)
    add("Sigmoid", add("Slice", add.add_layer(x, last), [0, 0], size, [2, 3]), output="mask")
