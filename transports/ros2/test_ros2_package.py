#!/usr/bin/env python3
"""test_ros2_package.py TOOL SOURCE: package.xml has the tool's version, each launch file is Python of which the tool knows all options,
and, where ROS 2's launch is installed, a launch description."""
import ast
import importlib.util
import pathlib
import re
import subprocess
import sys
from xml.etree import ElementTree

try:
    import launch.actions
    has_launch = hasattr(launch.actions, "ExecuteProcess")
except ImportError:
    has_launch = False

tool, source = sys.argv[1], pathlib.Path(sys.argv[2])


def said(*arguments):
    return subprocess.run([tool, *arguments], capture_output=True, text=True, check=True).stdout


version = ElementTree.parse(source / "package.xml").findtext("version")
assert said("--version").split()[1] == version, f"package.xml has {version}"

files = sorted((source / "transports/ros2/launch").glob("*.launch.py"))
assert [file.name.split(".")[0] for file in files] == ["servo", "sim_robot", "track"]
for file in files:
    words = [node.value for node in ast.walk(ast.parse(file.read_text(), file.name))
             if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    command = file.name.split(".")[0].replace("_", "-")
    assert command in words, f"{file}: does not start lapservo {command}"
    known = set(re.findall(r"--[a-z][a-z-]*", said(command, "--help")))
    unknown = [word for word in words if re.fullmatch(r"--[a-z-]+", word) and word not in known]
    assert not unknown, f"{file}: lapservo {command} has no {unknown}"
    if has_launch:
        spec = importlib.util.spec_from_file_location(command, file)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.generate_launch_description().entities
