"""Writes ferrobench/api.py from what a daemon says of itself.

    ferrobench call rpc.discover > openrpc.json
    python3 generate.py openrpc.json                 # writes ferrobench/api.py
    python3 generate.py openrpc.json --check         # exit code 1 where it is out of date

The file holds a class for each error, a typed dictionary for each kind of result, and a method for each method of the
daemon. Nothing in it is written by hand, and a test compares it with the daemon that was built.
"""
import argparse
import json
import keyword
import pathlib
import sys
import textwrap

HERE = pathlib.Path(__file__).parent
WIDTH = 116  # of the lines written
PLAIN = {"string": "str", "number": "float", "integer": "int", "boolean": "bool", "null": "None"}

HEAD = '''"""The methods, results and errors of a ferrobench daemon. Made by generate.py from its rpc.discover; not to be edited.

None leaves a parameter to the daemon's default. Numbers are in SI units unless the name says otherwise.
"""
# ruff: noqa
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypedDict

from ._errors import Error
'''


def camel(text):
    return "".join(part[:1].upper() + part[1:] for part in text.replace(".", "_").replace("-", "_").split("_"))


def python_name(name):
    return name + "_" if keyword.iskeyword(name) else name


class Types:
    """Typed dictionaries, one for each different schema of an object, named after where it is met first."""

    def __init__(self):
        self.names, self.bodies = {}, {}

    def add(self, name, schema):
        key = json.dumps({k: v for k, v in schema.items() if k not in ("description", "type")}, sort_keys=True)
        if key not in self.names:
            while name in self.bodies:
                name += "_"
            self.names[key] = name
            self.bodies[name] = None  # its place in the file, above those that it holds
            self.bodies[name] = self.body(name, schema)
        return self.names[key]

    def body(self, name, schema):
        members = {key: self.annotation(member, name + camel(key)) for key, member in schema["properties"].items()}
        if all(key.isidentifier() and not keyword.iskeyword(key) for key in members):
            lines = [f"class {name}(TypedDict, total=False):"]
            for key, kind in members.items():
                lines.append(f"    {key}: {kind}{comment(schema['properties'][key])}")
            return "\n".join(lines)
        inside = [f'"{key}": "{kind}"' for key, kind in members.items()]
        return "\n".join(fold(f'{name} = TypedDict("{name}", {{', inside, "}, total=False)", 4))

    def annotation(self, schema, name, given=False):
        """The type of a value; `given`: of one that the caller gives."""
        if not isinstance(schema, dict):
            return "Any"
        if "enum" in schema:
            return "Literal[" + ", ".join(json.dumps(item) for item in schema["enum"]) + "]"
        kinds = schema.get("type", [])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        if not kinds or len(kinds) > 4:
            return "Any"
        out = []
        for kind in sorted(kinds, key=lambda k: k == "null"):
            if kind in PLAIN:
                out.append(PLAIN[kind])
            elif kind == "array":
                out.append(("Sequence" if given else "list") +
                           f"[{self.annotation(schema.get('items', True), name.removesuffix('s'), given)}]")
            elif schema.get("properties") and not given:
                out.append(self.add(name, schema))
            else:
                each = self.annotation(schema.get("additionalProperties", True), name.removesuffix("s"), given)
                out.append(("Mapping" if given else "dict") + f"[str, {each}]")
        return " | ".join(out)


def comment(schema):
    """What is known of a member beside its type."""
    if not isinstance(schema, dict):
        return ""
    text = schema.get("description", "")
    if unit := schema.get("x-unit"):
        text = f"[{unit}] {text}".strip()
    return f"  # {text}" if text else ""


def fold(begin, items, end, indent):
    """begin + items + end, broken between items only."""
    lines = [begin]
    for i, item in enumerate(items):
        item += end if i + 1 == len(items) else ", "
        if len(lines[-1]) + len(item.rstrip()) > WIDTH:
            lines.append(" " * indent)
        lines[-1] += item
    return [line.rstrip() for line in lines] if items else [begin + end]


def wrapped(text, indent):
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_long_words=False,
                         break_on_hyphens=False)


def error_class(name):
    """not_found: NotFound; io_error: IoError."""
    return camel(name)


def method_text(method, verb, types, returns):
    params = sorted(method["params"], key=lambda p: not p["required"])
    head = ["self"]
    if any(not p["required"] for p in params) and not any(p["required"] for p in params):
        head.append("*")
    star = "*" in head
    docs = []
    for p in params:
        kind = types.annotation(p["schema"], camel(method["name"]), given=True)
        if p["required"]:
            head.append(f"{python_name(p['name'])}: {kind}")
        else:
            if not star:
                head.append("*")
                star = True
            absent = "" if kind.endswith("None") or kind == "Any" else " | None"
            head.append(f"{python_name(p['name'])}: {kind}{absent} = None")
        schema = p["schema"]
        told = p["description"]
        if unit := schema.get("x-unit"):
            told += f" [{unit}]"
        low, high = schema.get("minimum", schema.get("exclusiveMinimum")), schema.get("maximum")
        if low is not None:
            told += f"; {'above' if 'exclusiveMinimum' in schema else 'at least'} {low:g}"
        if high is not None:
            told += f"; at most {high:g}"
        if schema.get("default") not in (None, ""):
            told += f"; default {schema['default']}"
        docs += [f"        {python_name(p['name'])}"] + wrapped(told, " " * 12)
    lines = fold(f"    def {python_name(verb)}(", head, f") -> {returns}:", 12)
    lines += wrapped('"""' + method["summary"], " " * 8)
    if docs:
        lines += ["", "        Parameters", "        ----------", *docs]
    lines += ["", "        Raises", "        ------",
              *wrapped(", ".join(error_class(e["$ref"].split("/")[-1]) for e in method["errors"]), " " * 8), '        """']
    given = [f'"{p["name"]}": {python_name(p["name"])}' for p in params]
    lines += fold(f'        return self._call("{method["name"]}", {{', given, "})", 12)
    return "\n".join(lines)


def prefer(method):
    """The method that gives its name to a result that several have in common."""
    verb = method["name"].split(".")[-1]
    order = ["status", "get", "info", "list", verb]
    return (order.index(verb), len(method["name"]), method["name"])


def write(document):
    types, areas = Types(), {}
    methods = sorted(document["methods"], key=lambda m: m["name"])
    tops = [m for m in methods if m["result"]["schema"].get("properties") and m["result"]["schema"].get("type") == "object"]
    for method in sorted(tops, key=prefer):
        types.add(camel(method["name"].removesuffix(".get")), method["result"]["schema"])
    for topic in document["x-notifications"]:
        types.add(camel(topic["name"]) + "Message", topic["params"])
    for method in methods:
        area, _, verb = method["name"].rpartition(".")
        returns = types.annotation(method["result"]["schema"], camel(method["name"]))
        areas.setdefault(area, []).append(method_text(method, verb, types, returns))
    errors = [f'"{error_class(name)}"' for name in sorted(document["components"]["errors"])]
    out = [HEAD + "\n# What `from api import *` brings: the errors.\n" + "\n".join(fold("__all__ = [", errors, "]", 4)) + "\n"]
    for name, error in sorted(document["components"]["errors"].items()):
        text = error["message"]
        out.append(f'\nclass {error_class(name)}(Error):\n    """{text[0].upper() + text[1:]}."""\n'
                   f'    name, code = "{name}", {error["code"]}\n')
    pairs = [f'"{name}": {error_class(name)}' for name in sorted(document["components"]["errors"])]
    out.append("\n" + "\n".join(fold("ERRORS: dict[str, type[Error]] = {", pairs, "}", 4)) + "\n")
    viewing = [f'"{m["name"]}"' for m in methods if m["x-role"] == "view"]
    out.append("# Methods that change nothing of the bench.\n" + "\n".join(fold("VIEWING = frozenset([", viewing, "])", 4)) + "\n")
    topics = "".join(f'    "{t["name"]}": {json.dumps(t["summary"])},\n' for t in document["x-notifications"])
    out.append(f"# What a connection can subscribe to.\nTOPICS = {{\n{topics}}}\n")
    out += [f"\n{body}\n" for body in types.bodies.values()]
    out.append('\nclass Area:\n    """The methods that share a first word."""\n\n'
               "    def __init__(self, call: Callable[[str, Mapping[str, Any]], Any]):\n        self._call = call\n")
    for area, texts in areas.items():
        if area:
            out.append(f'\nclass {camel(area)}Area(Area):\n    """{area}.*"""\n\n' + "\n\n".join(texts) + "\n")
    inits = "".join(f"        self.{area} = {camel(area)}Area(call)\n" for area in areas if area)
    out.append('\nclass Methods(Area):\n    """Every method of the daemon, by area and verb: methods.run.start(...)."""\n\n'
               "    def __init__(self, call: Callable[[str, Mapping[str, Any]], Any]):\n        super().__init__(call)\n"
               + inits + "\n" + "\n\n".join(areas[""]) + "\n")
    return "\n".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("document", help="what rpc.discover returns, as JSON; - for standard input")
    parser.add_argument("--check", action="store_true", help="compare and write nothing")
    asked = parser.parse_args()
    text = write(json.loads(sys.stdin.read() if asked.document == "-" else pathlib.Path(asked.document).read_text()))
    target = HERE / "ferrobench" / "api.py"
    if not asked.check:
        target.write_text(text)
    elif not target.exists() or target.read_text() != text:
        sys.exit("ferrobench/api.py is not what the daemon says of itself: "
                 "ferrobench call rpc.discover | python3 server/python/generate.py -")


main()
