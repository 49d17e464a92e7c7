"""JUnit XML against `junit-10.xsd`, the schema of Jenkins' xUnit plugin (MIT licence, see its head).

The file is the one in the source distribution of pytest 9.2.0. Its rules are read from it. Of XML Schema,
what it uses for the elements of a report is known: attributes, patterns, children in any order, mixed text.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

XS = "{http://www.w3.org/2001/XMLSchema}"
SCHEMA = ET.parse(Path(__file__).with_name("junit-10.xsd")).getroot()
PATTERNS = {
    kind.attrib["name"]: kind.find(f".//{XS}pattern").attrib["value"]
    for kind in SCHEMA.findall(f"{XS}simpleType")
}


def violations(element: ET.Element) -> list[str]:
    """What the schema does not allow in this element and those within; an empty list where it is valid."""
    kind = SCHEMA.find(f"{XS}element[@name='{element.tag}']/{XS}complexType")
    if kind is None:
        return [f"<{element.tag}> is no element with attributes"]
    known = {each.attrib["name"]: each for each in kind.findall(f"{XS}attribute")}
    children = {each.attrib["ref"] for each in kind.iter(f"{XS}element")}
    required = {name for name, each in known.items() if each.get("use") == "required"}
    found = [
        f"<{element.tag}> lacks {name}"
        for name in sorted(required - set(element.attrib))
    ]
    found += [
        f"<{element.tag}> has {name}"
        for name in sorted(set(element.attrib) - set(known))
    ]
    for name, value in element.items():
        pattern = PATTERNS.get(known[name].attrib["type"]) if name in known else None
        if pattern and not re.fullmatch(pattern, value):
            found.append(f"{name}={value!r} is not {pattern}")
    text = "".join([element.text or "", *(child.tail or "" for child in element)])
    if text.strip() and kind.get("mixed") != "true":
        found.append(f"<{element.tag}> has the text {text.strip()!r}")
    for child in element:
        found += (
            violations(child)
            if child.tag in children
            else [f"<{element.tag}> has <{child.tag}>"]
        )
    return found
