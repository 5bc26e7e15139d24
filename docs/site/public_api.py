"""The pages of the public headers: lapservo.h's comments are their titles, what Doxygen found in each header their entries."""

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


def sections(checkout):
    """Title, text and headers of each part of lapservo.h."""
    found = []
    for line in (checkout / "lapservo" / "lapservo.h").read_text().splitlines():
        if title := re.match(r"// (.*)", line):
            head, colon, _ = title[1].partition(":")
            found.append((head.rstrip("."), title[1] if colon else "", []))
        elif header := re.match(r'#include "(lapservo/.*)"', line):
            found[-1][2].append(header[1])
    return found


def write_pages(checkout, xml_folder, folder):
    """One page for each part of lapservo.h, cpp_FOLDER.md by its last header's; the names without endings."""
    files = [ElementTree.parse(path).getroot().find("compounddef") for path in sorted(pathlib.Path(xml_folder).glob("*_8h.xml"))]
    members = list(ElementTree.parse(pathlib.Path(xml_folder) / "namespacelapservo.xml").iter("memberdef"))
    names = []
    for title, text, headers in sections(checkout):
        entries = "".join(f"## {header}\n\n```{{eval-rst}}\n{entries_of(header, files, members)}```\n\n" for header in headers)
        names.append("cpp_" + headers[-1].split("/")[1])
        (folder / f"{names[-1]}.md").write_text(f"# {title}\n\n{text}\n\n{entries}")
    return names
