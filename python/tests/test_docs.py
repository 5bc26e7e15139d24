"""Every block of commands and code in README.md, CONTRIBUTING.md and docs/ is run, in its page's order.

A page has a folder with the files that it presumes: the recordings of `lapservo sample`. Lists here and in doc_shell.py name the blocks that
are not run, or not to their end, with the reason. A block that is in no list and does not run fails. A page's "It prints" is compared.
"""

import re
import shutil
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from conftest import SOURCE
from doc_blocks import BLOCKS, PAGES
from doc_shell import BUILD, Shell
from recordings import TOOL

import lapservo

#: Pages that a test of their own runs from the first block to the last, and the languages that it knows.
ELSEWHERE = {"tutorial.md": ("debian/tests/pages", ["sh", "sh", "yaml", "sh", "sh", "sh", "sh", "sh", "sh"]),
             "quickstart.md": ("debian/tests/pages", ["text", "sh", "python", "cpp", "sh", "sh"])}

#: Blocks that are no code, by page and first line.
TEXT = {("README.md", "lapservo/core geometry marker kinematics rcm tool rig   values: no images, no control"): "the folders",
        ("README.md", "@software{lapservo,"): "BibTeX",
        ("calibration.md", "file,column,row,wrist_pitch,wrist_yaw"): "a table of touches, as calibrate_tip_test writes one",
        ("tip_goals.md", "--tip: can't be followed at 0.00 s: limits.upper rho_m 0.2: needs 0.22; the nearest that can be reached is ..."): "a message",
        ("quickstart.md", "./dev package"): "makes and installs the packages: `./dev package test` does"}

#: Lines that can't be run here, by how they begin.
NOT_RUN = {
    "git clone <": "fetches",
    "./dev ": "installs and builds; CI runs it",
    "pip install ": "builds; the test python.install does it with what is built",
    "cmake --": "builds",
    "build/modules/": "is built for the tests that it is",
    "ctest ": "runs the tests that this is one of",
    "rosbag record": "is ROS's own; swing.bag is what `lapservo record` wrote in the line before",
    "ssh ": "another computer",
    "lapservo calibrate tip --pivot ": "needs a recording of a tip in a dimple; calibrate_tip_test makes one",
    "lapservo calibrate tip --touch ": "needs images of touches",
    "docker ": "needs Docker's daemon",
    "cd ros2_ws && colcon ": "needs ROS 2; the test ros2.lapservo_msgs builds the package, ./dev colcon both",
    "ros2 launch ": "is ROS 2's; the test packaging.ros2 reads the files",
}

#: Files that pages show, by how their paths begin, and the test that runs them or reads them.
SHOWN = {"examples/cpp/": "cmake/test_install.cmake", "examples/own_robot/": "cmake/test_install.cmake",
         "examples/python/ros2_robot": "python/tests/test_ros2.py", "examples/python/plot_tip": "docs/tip_tutorial.md",
         "examples/python/": "python/tests/test_examples.py",
         "transports/ros2/msg/": "transports/ros2/CMakeLists.txt"}

#: A line that is a link to a file, which docs/site/conf.py replaces by the file.
SHOWN_FILE = re.compile(r"^\[.*\]\(\.\./((?:examples|transports)/.*\.[a-z]+)\)$", re.MULTILINE)

RUN = ("sh", "python", "cpp", "yaml")
WIRE = re.compile(r"ros[12]:|sim-robot")  # in real time


def reason_not_run(command):
    return next((why for begin, why in NOT_RUN.items() if command.startswith(begin)), None)


def run_lines(blocks):
    return [line for block in blocks if block.language == "sh" for line in block.commands() if not reason_not_run(line)]


def page_parameter(page):
    blocks = [block for block in BLOCKS if block.page == page and block.language in RUN]
    in_real_time = any(WIRE.search(line) for line in run_lines(blocks))
    return pytest.param(blocks, id=page.name, marks=[pytest.mark.wire] if in_real_time else [])


def test_every_block_says_what_it_is():
    for block in BLOCKS:
        if block.language == "text":
            assert (block.page.name, block.text.splitlines()[0]) in TEXT, block.where
        else:
            assert block.language in RUN, block.where


def test_what_pages_show_is_run_by_a_test():
    shown = [(page, path) for page in PAGES for path in SHOWN_FILE.findall(page.read_text())]
    assert len(shown) > 10
    for page, path in shown:
        test = next(test for begin, test in SHOWN.items() if path.startswith(begin))
        file = SOURCE / path
        name = file.parent.name if file.name == "CMakeLists.txt" else file.stem
        assert file.is_file() and re.search(rf"\b{name}\b", (SOURCE / test).read_text()), f"{page.name}: {test}"


def test_the_lists_name_what_there_is():
    lines = [line for block in BLOCKS if block.language == "sh" for line in block.commands()]
    for begin in NOT_RUN:
        assert any(line.startswith(begin) for line in lines), f"nothing begins with {begin!r} any more"
    for page, (test, languages) in ELSEWHERE.items():
        assert page.split(".")[0] in (SOURCE / test).read_text()
        assert [block.language for block in BLOCKS if block.page.name == page] == languages


def test_readmes_figures_of_rotation_are_the_demos(tmp_path):
    readme = (SOURCE / "README.md").read_text()
    said = subprocess.run([TOOL, "experiment", "rotation", "--out", tmp_path / "results"], check=True, capture_output=True,
                          text=True).stdout
    for row, line in (("the paper's method in lapservo", "its method here"), ("lapservo", "the default here")):
        measured = re.search(rf"standard deviation of all trials together\n(?:.*\n)*?\s+{line}\s+(.*)\n", said)[1]
        assert f"| {row}, **rendered frames** | {measured} |" in readme, said


def test_the_controllers_page_has_each_key():
    page = (SOURCE / "docs" / "controller.md").read_text()
    rig = lapservo.Rig.load(SOURCE / "configs" / "paper.yaml")
    written = lapservo.Controller(rig).to_yaml()
    keys = re.findall(r"^\| `(\w+)` \|", page.split("## Controller")[1], re.MULTILINE)
    assert sorted(keys) == sorted(re.findall(r"^(\w+):", written, re.MULTILINE))
    for key in re.findall(r"(\w+)(?=:)", written):
        assert f"`{key}`" in page
    defaults = lapservo.Controller(rig).to_yaml().split("limits:")[1]
    assert all(numbers in page for numbers in re.findall(r"\[.*?\]", defaults))


def furnish(folder, sample):
    for name in ("configs", "examples", "transports"):
        (folder / name).symlink_to(SOURCE / name)
    (folder / "build").symlink_to(BUILD)
    (folder / "arm.yaml").symlink_to(SOURCE / "configs" / "paper.yaml")
    for name in ("boards", "boards.mp4"):
        (folder / name).symlink_to(sample / "boards")
    for name in ("swing.mp4", "motion.mp4", "turn.mp4"):
        (folder / name).symlink_to(sample / "video.mp4")
    for name in ("joints.csv", "turn_joints.csv"):
        (folder / name).symlink_to(sample / "swing_joints.csv")
    (folder / "swing.bag").symlink_to("swing")
    for name in ("rig.yaml", "my_rig.yaml", "designed.yaml"):
        shutil.copy(sample / "truth.yaml", folder / name)


def run_cpp(block, folder):
    library = BUILD / "liblapservo.so"
    if not library.exists():
        pytest.fail(f"{library} is not built")
    (folder / "see.cpp").write_text(block.text)
    includes = ["-I", SOURCE, "-isystem", "/usr/include/eigen3", "-isystem", "/usr/include/opencv4"]
    subprocess.run(["g++", "-std=c++20", "-Wall", "-Werror", *includes, "see.cpp", "-o", "see", library,
                    f"-Wl,-rpath,{BUILD}", "-lopencv_core"], cwd=folder, check=True)
    example = SOURCE / "acceptance" / "frames" / "png"
    said = subprocess.run(["./see", example / "rig.yaml", example / "0000.png"], cwd=folder, check=True, capture_output=True,
                          text=True).stdout
    assert re.match(r"psi = -?[0-9.]+ rad, sigma = 0\.0[0-9]+ rad\n", said), said


def run_python(block, folder, environment):
    subprocess.run([sys.executable, "-c", block.text], cwd=folder, env=environment, check=True)


@pytest.mark.parametrize("blocks", [page_parameter(page) for page in PAGES if page.name not in ELSEWHERE])
def test_every_block_runs(blocks, request, tmp_path):
    if blocks:
        furnish(tmp_path, request.getfixturevalue("sample"))
    shell, said = Shell(tmp_path), ""
    for block in blocks:
        print(block.where, flush=True)
        if block.language == "yaml":
            assert lapservo.Rig.parse(block.text).instruments
        elif block.language == "cpp":
            run_cpp(block, tmp_path)
        elif block.language == "python":
            run_python(block, tmp_path, shell.environment)
        else:
            said += shell.run_all(run_lines([block]))
    for promised in re.findall(r"It prints `([^`]*)`", blocks[0].page.read_text() if blocks else ""):
        assert promised in said, said
    shutil.rmtree(tmp_path / "swing", ignore_errors=True)  # half a gigabyte of images


@pytest.fixture(scope="module")
def tutorial(tmp_path_factory):
    """The folder of the tutorial's end, what its commands printed, and a shell."""
    folder = tmp_path_factory.mktemp("tutorial")
    shell = Shell(folder)
    done = subprocess.run([SOURCE / "debian" / "tests" / "pages", SOURCE / "docs" / "tutorial.md"], text=True, capture_output=True,
                          env=shell.environment | {"AUTOPKGTEST_TMP": str(folder)})
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "tutorial" / "morning", done.stdout, shell


@pytest.mark.wire
def test_the_tutorials_rig_is_the_true_one(tutorial):
    folder, said, _ = tutorial
    found, true = (lapservo.Rig.load(folder / name) for name in ("rig.yaml", "truth.yaml"))
    assert found.camera.matrix[0, 0] == pytest.approx(true.camera.matrix[0, 0], abs=1)
    found, true = found.instruments[0], true.instruments[0]
    assert np.allclose(found.marker.hues_deg, true.marker.hues_deg, atol=4)
    assert np.allclose(found.marker.bands_upper_m, true.marker.bands_upper_m, atol=5e-5)
    assert np.linalg.norm((found.camera_from_rcm - true.camera_from_rcm)[:3, 3]) < 0.6e-3
    assert list(found.joints.sign) == list(true.joints.sign)
    assert found.image_delay_s == pytest.approx(true.image_delay_s, abs=5e-3)
    designed = re.search(r"^marker:\n((?:  .*\n)+)", said, re.MULTILINE)[1]
    first_rig = next(block.text for block in BLOCKS if block.page.name == "tutorial.md" and block.language == "yaml")
    assert textwrap.indent(designed, "    ") in first_rig
    assert "endoscope_moved" not in (folder / "run" / "log.csv").read_text()  # in its first loop


@pytest.mark.wire
def test_calibrate_all_goes_on_where_it_stopped(tutorial):
    folder, _, shell = tutorial
    whole = next(line for block in BLOCKS if block.page.name == "tutorial.md" for line in block.commands()
                 if line.startswith("lapservo calibrate all "))

    def run(arguments=""):
        done = subprocess.run(whole + arguments, shell=True, cwd=folder, env=shell.environment, text=True, capture_output=True)
        return done.returncode, done.stdout

    def done_before(said):
        return re.findall(r"^(\w+): done on 2", said, re.MULTILINE)

    rig = (folder / "rig.yaml").read_bytes()
    code, said = run()
    assert code == 0 and done_before(said) == ["camera", "colour", "marker", "registration", "check"], said
    assert (folder / "rig.yaml").read_bytes() == rig
    (folder / "swing_joints.csv").rename(folder / "elsewhere.csv")
    code, said = run(" --redo marker")
    record = (folder / "rig.calibration.yaml").read_text()
    assert code == 2 and "name: marker" in record and "name: registration" not in record, said
    (folder / "elsewhere.csv").rename(folder / "swing_joints.csv")
    code, said = run()
    assert code == 0 and done_before(said) == ["camera", "colour", "marker"] and "\ngood enough\n" in said, said
