"""video_cost.py TOOL: what a frame of an H.264 video (1280x720, crf 23) costs beside a clean one, in CPU time of one run.

Renders an instrument in motion, has ffmpeg compress it, and prints two factors of the tracked clean frame: tracking the
video's frame, and decoding it. Needs ffmpeg and PYTHONPATH=build/python.
"""

import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

import lapservo

FRAMES, SOURCE = 60, pathlib.Path(__file__).resolve().parents[1]


def milliseconds(call):
    begin = time.process_time()
    result = call()
    return 1e3 * (time.process_time() - begin), result


def costs(source, rig):
    """Medians of reading a frame and of tracking it."""
    tracker, frames, read, tracked = lapservo.Tracker(rig), iter(source), [], []
    while True:
        cost, frame = milliseconds(lambda: next(frames, None))
        if frame is None:
            return np.median(read[10:]), np.median(tracked[10:])
        read.append(cost)
        cost, seen = milliseconds(lambda: tracker.track(frame))
        if not seen[0].ok:
            sys.exit(f"frame {frame.index} is {seen[0].status.value}")
        tracked.append(cost)


with tempfile.TemporaryDirectory() as folder:
    rig_file, frames, video = SOURCE / "configs" / "paper.yaml", pathlib.Path(folder, "frames"), pathlib.Path(folder, "a.mp4")
    subprocess.run([sys.argv[1], "render", "--rig", rig_file, "--count", str(FRAMES), "--moving", "--out", frames], check=True,
                   capture_output=True)
    subprocess.run(["ffmpeg", "-v", "error", "-framerate", "30", "-i", frames / "%04d.png", "-c:v", "libx264", "-crf", "23",
                    "-pix_fmt", "yuv420p", video], check=True)
    rig = lapservo.Rig.load(rig_file)
    _, clean = costs(lapservo.open_frames(frames), rig)
    decoded, compressed = costs(lapservo.open_frames(video), rig)
print(f"{compressed / clean:.0f} {decoded / clean:.0f}")
print(f"clean {clean:.2f} ms; of the video: tracked {compressed:.2f} ms, decoded {decoded:.2f} ms", file=sys.stderr)
