"""install.py BUILD: `pip install .` into a folder of its own, from what BUILD has built, and an image tracked by it."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

source, build = pathlib.Path(__file__).resolve().parents[2], pathlib.Path(sys.argv[1]).resolve()
with tempfile.TemporaryDirectory() as folder:
    copy, target = pathlib.Path(folder) / "source", pathlib.Path(folder) / "installed"
    copy.mkdir()  # setuptools writes beside its setup.py
    for name in ("CMakeLists.txt", "LICENSE", "README.md", "pyproject.toml", "setup.py"):
        shutil.copy(source / name, copy)
    shutil.copytree(source / "python" / "lapservo", copy / "python" / "lapservo")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"LAPSERVO_BUILD": str(build)}
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-build-isolation", "--no-deps", "--no-index",
                    "--disable-pip-version-check", "--target", target, copy], check=True, env=environment)
    frames = source / "acceptance" / "frames" / "png"
    printed = subprocess.run([sys.executable, source / "examples" / "python" / "track_video.py", frames, frames / "rig.yaml"],
                             check=True, env=environment | {"PYTHONPATH": str(target)}, cwd=folder, capture_output=True,
                             text=True).stdout
    if printed.count(" mm, ") < 3:
        sys.exit("the installed package does not track:\n" + printed)
    if not (target / "lapservo" / "__init__.pyi").is_file() or not (target / "lapservo" / "py.typed").is_file():
        sys.exit("the installed package has no types")
