"""python_overhead.py: what a frame costs beyond C++: the call and its observations, the tracking left out.

A flawed frame is refused before it is looked at; all else happens as with any frame. Medians over blocks of calls.
PYTHONPATH=build/python bench/python_overhead.py
"""

import pathlib
import statistics
import tempfile
import time

import numpy as np

import lapservo

source = pathlib.Path(__file__).resolve().parents[1]
rig = lapservo.Rig.load(source / "configs" / "paper.yaml")
tracker = lapservo.Tracker(rig)
image = lapservo.Renderer(rig).render([0.05, 1.57, 0.064, 1.2])


def microseconds(call, calls=2000, blocks=9):
    times = []
    for _ in range(blocks):
        start = time.perf_counter()
        for _ in range(calls):
            call()
        times.append((time.perf_counter() - start) / calls * 1e6)
    return statistics.median(times)


def refused_frame():
    """An image with a palette, which is refused before it is decoded."""
    import struct
    import zlib

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    flat = np.zeros((720, 1280, 3), np.uint8)
    flat[:, 640:] = (10, 200, 90)
    rows = b"".join(b"\0" + row.tobytes() for row in flat)
    header = struct.pack(">IIBBBBB", 1280, 720, 8, 2, 0, 0, 0)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "few.png"
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
        return next(iter(lapservo.open_frames(path)))


frame = refused_frame()
assert frame.flaw is not None
refused = microseconds(lambda: tracker.track(frame))
tracked = microseconds(lambda: tracker.track(image), calls=100)
print(f"a frame's call and its observations: {refused:.1f} us; a tracked frame in all: {tracked:.0f} us")
