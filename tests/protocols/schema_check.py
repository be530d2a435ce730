"""Checks cases against a JSON Schema: {"schema": ..., "cases": [{"name", "document", "valid"}]} in the file given.

"problems" of a case: as many errors as the schema has to find, where an error inside a rule counts as one."""
import json
import sys

try:
    from jsonschema import Draft202012Validator
except ImportError:
    sys.exit("python3-jsonschema is not installed")

with open(sys.argv[1], encoding="utf-8") as file:
    given = json.load(file)
Draft202012Validator.check_schema(given["schema"])
validator = Draft202012Validator(given["schema"])
wrong = 0
for case in given["cases"]:
    if validator.is_valid(case["document"]) != case["valid"]:
        wrong += 1
        print(f"{case['name']}: the schema says {not case['valid']}, validate() says {case['valid']}")
        print("  ", json.dumps(case["document"])[:300])
    errors = [error.message for error in validator.iter_errors(case["document"])]
    if len(errors) != case.get("problems", len(errors)):
        wrong += 1
        print(f"{case['name']}: {len(errors)} errors: {errors}")
sys.exit(1 if wrong else 0)
