#!/usr/bin/env python3
"""Fails unless the .msg files here have the type hashes (REP 2016, RIHS01) in type_hashes.txt: they hold a type's name,
its fields' names, types and order, and those of the types in it, but no constants, defaults and comments.
Usage: test_type_hashes.py FOLDER_OF_MSG HASHES"""
import hashlib
import json
import pathlib
import re
import sys

NESTED, BOUNDED_STRING, ARRAY, SEQUENCE = 1, 21, 48, 144
IDS = {"uint8": 3, "char": 3, "int32": 6, "uint32": 7, "float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17}


def field(line, package):
    """A field as a type description has it."""
    base, brackets, size, name = re.fullmatch(r"([^\[\s]+?)(\[(\d*)\])?\s+(\w+)", line).groups()
    bound = re.fullmatch(r"string<=(\d+)", base)
    kind = BOUNDED_STRING if bound else IDS.get(base, NESTED)
    nested = "" if kind != NESTED else (base if "/" in base else f"{package}/{base}").replace("/", "/msg/")
    return {"name": name, "type": {"type_id": kind + (0 if not brackets else ARRAY if size else SEQUENCE),
                                   "capacity": int(size or 0), "string_capacity": int(bound[1]) if bound else 0,
                                   "nested_type_name": nested}}


def description(folder, name):
    """The hash of a type pkg/msg/Name."""
    package = name.split("/")[0]
    lines = [line.split("#")[0].strip() for line in (folder / (name + ".msg")).read_text().splitlines()]
    return {"type_name": name, "fields": [field(line, package) for line in lines if line]}


def type_hash(folder, name):
    known = {name: description(folder, name)}
    while missing := {f["type"]["nested_type_name"] for d in known.values() for f in d["fields"]} - known.keys() - {""}:
        known.update({other: description(folder, other) for other in missing})
    own = known.pop(name)
    text = json.dumps({"type_description": own, "referenced_type_descriptions": [known[n] for n in sorted(known)]},
                      separators=(", ", ": "))
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()


def main():
    folder, hashes = map(pathlib.Path, sys.argv[1:])
    expected = [line.split() for line in hashes.read_text().splitlines() if line and not line.startswith("#")]
    wrong = [f"{name} has {type_hash(folder, name)}, expected {known}" for name, known in expected
             if type_hash(folder, name) != known]
    print("\n".join(wrong) or f"{len(expected)} types have their hashes")
    return bool(wrong or not expected)


if __name__ == "__main__":
    sys.exit(main())
