"""content.py SHARE: the schemas are sound, have names of their own, and hold for what is shipped."""
import json
import pathlib
import sys

try:
    from jsonschema import Draft202012Validator
except ImportError:
    sys.exit("python3-jsonschema is not installed")

share = pathlib.Path(sys.argv[1])
schemas = {file.name.removesuffix(".schema.json"): json.loads(file.read_text())
           for file in (share / "schemas").iterdir()}
assert set(schemas) == {"protocol", "model", "device-virtual", "device-usb", "device-replay"}, set(schemas)
assert len({schema["$id"] for schema in schemas.values()}) == len(schemas)
for schema in schemas.values():
    Draft202012Validator.check_schema(schema)
for kind in "protocol", "model":
    validator = Draft202012Validator(schemas[kind])
    shipped = sorted((share / f"{kind}s").glob("*.json"))
    assert shipped
    for file in shipped:
        validator.validate(json.loads(file.read_text()))
    assert not validator.is_valid({"format": "something else"})
