import os
import pathlib
import re
import subprocess
import sys

from conftest import SOURCE

EXAMPLES = SOURCE / "examples" / "python"
RIG = SOURCE / "configs" / "paper.yaml"


def run(name, *arguments):
    return subprocess.run([sys.executable, EXAMPLES / name, *arguments], check=True, capture_output=True, text=True).stdout


def test_examples_run(tmp_path):
    frames = tmp_path / "frames"
    subprocess.run([os.environ["LAPSERVO_TOOL"], "render", "--rig", RIG, "--count", "12", "--moving", "--out", frames],
                   check=True, capture_output=True)
    assert run("track_video.py", frames, RIG).count(" mm, ") == 12
    run("plot_q.py", frames, RIG, tmp_path / "q.png")
    assert (tmp_path / "q.png").read_bytes().startswith(b"\x89PNG")
    assert "RCM at" in run("rcm_image.py", frames, RIG)
    assert "mrad" in run("marker_5mm.py", tmp_path / "sheet.pdf")
    assert (tmp_path / "sheet.pdf").is_file()
    assert "largest errors" in run("own_robot.py", RIG)


def test_each_example_runs_here():
    here = pathlib.Path(__file__).read_text()
    assert all(f'"{path.name}"' in here for path in EXAMPLES.glob("*.py"))


def test_what_the_page_shows_runs(monkeypatch):
    monkeypatch.chdir(SOURCE)
    blocks = re.findall(r"```python\n(.*?)```", (SOURCE / "docs" / "python.md").read_text(), re.DOTALL)
    assert blocks
    for block in blocks:
        exec(block, {})
