"""The page of the public headers: lapservo.h's comments are its sections, what Doxygen found in each header its entries."""

import pathlib
import re
import xml.etree.ElementTree as ElementTree

DIRECTIVES = {"enum": "doxygenenum", "typedef": "doxygentypedef", "variable": "doxygenvariable", "function": "doxygenfunction"}


def entry(directive, name, *options):
    return "\n   ".join([f".. {directive}:: {name}", *options]) + "\n"


def entries_of(header, xml, members):
    """Breathe's directives for a header. `members`: those of namespace lapservo, outside classes."""
    compound = next(c for c in xml if c.find("location").get("file") == header)
    entries = []
    for inner in compound.iter("innerclass"):
        if inner.text.count("::") == 1:  # others stand in the one that they are in
            kind = "doxygenclass" if inner.get("refid").startswith("class") else "doxygenstruct"
            entries.append(entry(kind, inner.text, ":members:", ":undoc-members:"))
    for member in members:
        if member.find("location").get("file") != header:
            continue
        name = "lapservo::" + member.findtext("name")
        if member.get("kind") == "function":
            parameters = ", ".join("".join(p.find("type").itertext()) for p in member.iter("param"))
            name += f"({parameters})"
        entries.append(entry(DIRECTIVES[member.get("kind")], name))
    return "\n".join(entries)


def page(checkout, xml_folder):
    """Markdown for what lapservo.h includes."""
    files = [ElementTree.parse(path).getroot().find("compounddef") for path in sorted(pathlib.Path(xml_folder).glob("*_8h.xml"))]
    namespace = ElementTree.parse(pathlib.Path(xml_folder) / "namespacelapservo.xml")
    members = list(namespace.iter("memberdef"))
    sections = []
    for line in (checkout / "lapservo" / "lapservo.h").read_text().splitlines():
        if title := re.match(r"// (.*)", line):
            head, colon, _ = title[1].partition(":")
            sections.append(f"## {head.rstrip('.')}\n\n{title[1] if colon else ''}\n")
        elif header := re.match(r'#include "(lapservo/.*)"', line):
            sections.append(f"### {header[1]}\n\n```{{eval-rst}}\n{entries_of(header[1], files, members)}```\n")
    return "\n".join(sections)
