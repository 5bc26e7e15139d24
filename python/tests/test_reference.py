"""The tables of docs/ name all statuses, hold reasons, rig keys, columns and topics of the code."""

import re

import pytest
from conftest import SOURCE


def read(path):
    return (SOURCE / path).read_text()


def section(page, title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", read(page), re.MULTILINE | re.DOTALL)[1]


def first_cells(table):
    """Words in backticks of the first cell of each row."""
    return {word for row in re.findall(r"^\| (`[^|]*)\|", table, re.MULTILINE) for word in re.findall(r"`([^`]+)`", row)}


def enumerators(header, name):
    body = re.search(rf"enum class {name} {{(.*?)}};", read(header), re.DOTALL)[1]
    return re.findall(r"^\s*(\w+)\s*,", re.sub(r"//.*", "", body), re.MULTILINE)


@pytest.mark.parametrize(("header", "name", "title"), [
    ("lapservo/vision/status.h", "Status", "Status of an observation"),
    ("lapservo/control/hold_reason.h", "HoldReason", "Hold reasons of the loop"),
    ("lapservo/robot/blocked.h", "Blocked", "Reasons of the supervisor"),
])
def test_every_reason_has_a_row(header, name, title):
    words = enumerators(header, name)
    assert len(words) > 8
    table = section("docs/statuses.md", title)
    assert set(words) <= first_cells(table)
    assert all(len(row.split("|")) == 6 for row in table.splitlines() if row.startswith("| `")), "meaning, cause, remedy"


def test_every_rig_key_has_a_row():
    calls = re.findall(r"expect_keys\(\w+, (\{.*?\})\);", read("lapservo/rig/rig.cpp"), re.DOTALL)
    keys = {key for call in calls for key in re.findall(r'"(\w+)"', call)}
    assert {"deinterlace", "image_delay_s", "light", "roi"} <= keys
    described = set(re.findall(r"`(\w+)`", read("docs/rig.md")))
    assert keys <= described, keys - described


def test_every_column_has_a_row():
    header = re.search(r"observation_csv_header =(.*?);", read("lapservo/io/tables/observation_csv.cpp"), re.DOTALL)[1]
    columns = "".join(re.findall(r'"(.*?)"', header)).split(",")
    assert len(columns) > 30
    rows = first_cells(read("docs/output.md"))
    assert set(columns) <= rows, set(columns) - rows


def test_every_topic_has_a_row():
    loop, arm = read("lapservo/loop_topics/loop_topics.cpp"), read("lapservo/crtk/crtk_robot.cpp")
    topics = set(re.findall(r'topic\(rig, "([^"]+)"\)', loop)) | set(re.findall(r'(?:hear\(|topic_of\(arm, )"(\w+)"', arm))
    assert {"observation", "measured_js", "operating_state", "servo_jp"} <= topics
    rows = first_cells(read("docs/messages.md"))
    assert all(any(row.endswith("/" + topic) for row in rows) for topic in topics), topics
