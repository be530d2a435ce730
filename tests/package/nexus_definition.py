"""nexus_definition.py NXDL RECORDINGS...: the definition names all that each recording holds, in its units, and nothing that it lacks."""
import sys
import xml.etree.ElementTree as tree

import h5py

space = "{http://definition.nexusformat.org/nxdl/3.1}"
# Whoever reads a file takes its units from there; ours are SI. NX_ANY: what NeXus has no name for (V/m, N/m, N).
units = {"NX_LENGTH": "m", "NX_AREA": "m^2", "NX_TIME": "s", "NX_CHARGE": "C", "NX_PRESSURE": "Pa", "NX_DIMENSIONLESS": "1"}
types = {"NX_FLOAT": "f", "NX_INT": "iu", "NX_CHAR": "SO", "NX_DATE_TIME": "SO"}
wrong = []


def required(node):
    return node.get("minOccurs") != "0" and node.get("optional") != "true"


def compare(node, there, place):
    named = {tag: {child.get("name"): child for child in node.findall(space + tag)}
             for tag in ("group", "field", "attribute")}
    for name in there.attrs:
        if name not in named["attribute"] and name not in ("NX_class", "units", "long_name"):
            wrong.append(f"{place}@{name} is not in the definition")
    for name, child in named["attribute"].items():
        if required(child) and name not in there.attrs:
            wrong.append(f"{place}@{name} is not in the recording")
    if not isinstance(there, h5py.Group):
        if there.dtype.kind not in types[node.get("type")]:
            wrong.append(f"{place} is not {node.get('type')}")
        unit, category = there.attrs.get("units"), node.get("units")
        if (unit is None) != (category is None) or (category not in (None, "NX_ANY") and unit != units[category]):
            wrong.append(f"{place} is in {unit}, which is not {category}")
        allowed = [item.get("value") for item in node.findall(f"{space}enumeration/{space}item")]
        if allowed and there.asstr()[()] not in allowed:
            wrong.append(f"{place} is none of {allowed}")
        dimensions = node.find(space + "dimensions")
        if there.ndim != (0 if dimensions is None else int(dimensions.get("rank"))):
            wrong.append(f"{place} has {there.ndim} dimensions")
        return
    any_name = {kind: next((c for c in children.values() if c.get("nameType") == "any"), None) for kind, children in named.items()}
    for name, below in there.items():
        kind = "group" if isinstance(below, h5py.Group) else "field"
        child = named[kind].get(name, any_name[kind])
        if child is None:
            wrong.append(f"{place}/{name} is not in the definition")
        elif kind == "group" and below.attrs["NX_class"] != child.get("type"):
            wrong.append(f"{place}/{name} is not {child.get('type')}")
        else:
            compare(child, below, f"{place}/{name}")
    for name, child in (named["group"] | named["field"]).items():
        if required(child) and name not in there:
            wrong.append(f"{place}/{name} is not in the recording")


definition = tree.parse(sys.argv[1]).getroot()
for recording in sys.argv[2:]:
    with h5py.File(recording) as file:
        assert definition.get("name") == file["entry/definition"].asstr()[()]
        compare(definition, file, "")
sys.exit("\n".join(wrong) or 0)
