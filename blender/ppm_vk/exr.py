"""Reads the EXR files that the program writes (scan lines, 32-bit floats or half floats, one part), and writes such files. Blender
itself does so only by images of the file that is being rendered, whose data-blocks must stay as they are."""

import struct
import zlib
from dataclasses import dataclass

import numpy as np

_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
# Compression: the number of lines of a block.
_LINES = {0: 1, 2: 1, 3: 16}


@dataclass
class Picture:
    """Channels by name, each an array of lines from the top; and the place in the whole picture of the upper left pixel."""

    channels: dict
    width: int
    height: int
    left: int
    top: int


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def _header(data):
    attributes = {}
    at = 8
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channel_list(value):
    channels = []
    at = 0
    while value[at]:
        name, at = _text(value, at)
        (kind,) = struct.unpack_from("<i", value, at)
        channels.append((name, _TYPES[kind]))
        at += 16
    return channels


def _inflate(block, size):
    """ZIP of OpenEXR: differences of bytes, and bytes of even and odd places apart."""
    # Blocks that don't become smaller are stored as they are.
    if len(block) == size:
        return block
    bytes_ = np.frombuffer(zlib.decompress(block), np.uint8)
    steps = bytes_.astype(np.int64)
    steps[1:] -= 128
    bytes_ = np.cumsum(steps).astype(np.uint8)
    joined = np.empty_like(bytes_)
    half = (len(bytes_) + 1) // 2
    joined[0::2] = bytes_[:half]
    joined[1::2] = bytes_[half:]
    return joined.tobytes()


def read(path):
    with open(path, "rb") as file:
        data = file.read()
    magic, version = struct.unpack_from("<II", data)
    if magic != 20000630 or version & ~0x4FF:
        raise ValueError(f"{path} is not an EXR file of one part with scan lines")
    attributes, at = _header(data)
    compression = attributes["compression"][0]
    if compression not in _LINES:
        raise ValueError(f"{path} has compression {compression}, which the add-on does not read")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    layout = _channel_list(attributes["channels"])
    planes = {name: np.empty((height, width), np.float32) for name, _ in layout}
    line_size = width * sum(kind.itemsize for _, kind in layout)
    lines = _LINES[compression]
    blocks = (height + lines - 1) // lines
    for offset in struct.unpack_from(f"<{blocks}Q", data, at):
        y, size = struct.unpack_from("<ii", data, offset)
        count = min(lines, bottom + 1 - y)
        block = data[offset + 8 : offset + 8 + size]
        if compression:
            block = _inflate(block, count * line_size)
        begin = 0
        for line in range(y - top, y - top + count):
            for name, kind in layout:
                planes[name][line] = np.frombuffer(block, kind, width, begin)
                begin += width * kind.itemsize
    return Picture(planes, width, height, left, top)


def write(path, pixels):
    """Writes lines from the top of RGB, 32-bit floats, without compression."""
    height, width, _ = pixels.shape
    planes = np.ascontiguousarray(pixels[..., ::-1].transpose(0, 2, 1), "<f4")  # B, G, R of each line
    channel = struct.pack("<iB3xii", 2, 0, 1, 1)
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = (
        ("channels", "chlist", b"".join(name + b"\0" + channel for name in (b"B", b"G", b"R")) + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    )
    header = struct.pack("<II", 20000630, 2)
    for name, kind, value in attributes:
        header += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    size = planes[0].nbytes
    first = len(header) + 8 * height
    with open(path, "wb") as file:
        file.write(header)
        file.write(struct.pack(f"<{height}Q", *(first + y * (8 + size) for y in range(height))))
        for y, line in enumerate(planes):
            file.write(struct.pack("<ii", y, size) + line.tobytes())
