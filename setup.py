"""`pip install .`: CMake builds the extension, in build/pip or, to use what is built already, in LAPSERVO_BUILD."""

import os
import pathlib
import re
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = pathlib.Path(__file__).resolve().parent


class CMakeBuild(build_ext):
    def build_extension(self, ext):
        build = pathlib.Path(os.environ.get("LAPSERVO_BUILD", SOURCE / "build" / "pip"))
        if "LAPSERVO_BUILD" not in os.environ:
            subprocess.run(["cmake", "-S", SOURCE, "-B", build, "--preset", "package", f"-DPython_EXECUTABLE={sys.executable}"],
                           check=True)
            subprocess.run(["cmake", "--build", build, "--target", "lapservo_python_types"], check=True)
        built = list((build / "python" / "lapservo").glob("_lapservo.*.so"))
        if len(built) != 1:
            sys.exit(f"{build}: has no Python extension: install the packages of the groups tool and python "
                     "in cmake/debian-packages.txt")
        target = pathlib.Path(self.get_ext_fullpath(ext.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(built[0], target)
        shutil.copyfile(built[0].parent / "__init__.pyi", target.parent / "__init__.pyi")


version = re.search(r"VERSION (\d+\.\d+\.\d+)", (SOURCE / "CMakeLists.txt").read_text().split("project(", 1)[1])[1]
setup(version=version, ext_modules=[Extension("lapservo._lapservo", [])], cmdclass={"build_ext": CMakeBuild})
