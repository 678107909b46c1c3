"""Convert images as sensor_msgs encodes them to RGB of 8 or 16 bits."""

from __future__ import annotations

import re

import cv2
import numpy as np

from lmmap.recordings.bags import Unread
from lmmap.recordings.limits import check_image

COLOURS = {  # channels, and what makes them RGB
    "mono": (1, cv2.COLOR_GRAY2RGB), "rgb": (3, None), "bgr": (3, cv2.COLOR_BGR2RGB),
    "rgba": (4, cv2.COLOR_RGBA2RGB), "bgra": (4, cv2.COLOR_BGRA2RGB),
    "bayer_rggb": (1, cv2.COLOR_BayerRGGB2RGB), "bayer_bggr": (1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_grbg": (1, cv2.COLOR_BayerGRBG2RGB), "bayer_gbrg": (1, cv2.COLOR_BayerGBRG2RGB),
}  # fmt: skip
OPENCV = {"1": "mono", "3": "bgr", "4": "bgra"}  # by their channels, as 8UC3
YUV = {
    "yuv422": cv2.COLOR_YUV2RGB_UYVY, "uyvy": cv2.COLOR_YUV2RGB_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2RGB_YUY2, "yuyv": cv2.COLOR_YUV2RGB_YUY2,
}  # fmt: skip


def layout(encoding: str) -> tuple[int, int, int | None]:
    """Bits per value, number of channels, and OpenCV's code for the conversion to RGB; raises `Unread`."""
    if encoding in YUV:
        return 8, 2, YUV[encoding]
    if match := re.fullmatch(r"(8|16)UC([134])", encoding):
        return int(match[1]), *COLOURS[OPENCV[match[2]]]
    match = re.fullmatch(r"([a-z_]+?)(8|16)", encoding)
    if not match or match[1] not in COLOURS:
        raise Unread(f"images encoded as {encoding[:40]}")
    return int(match[2]), *COLOURS[match[1]]


def pixels(message) -> np.ndarray:
    """The image (H, W, 3) RGB of a sensor_msgs/Image, u8 or u16; ValueError if it is not one."""
    bits, channels, code = layout(message.encoding)
    check_image(message.width, message.height)
    rows = np.asarray(message.data).reshape(message.height, message.step)
    rows = np.ascontiguousarray(rows[:, : message.width * channels * bits // 8])
    if bits == 16:
        rows = rows.view(">u2" if message.is_bigendian else "<u2").astype(np.uint16)
    values = rows.reshape(message.height, message.width, channels)
    return values if code is None else cv2.cvtColor(values, code)
