#!/usr/bin/env python3
"""Validates scenes against the JSON Schema that bondline prints, as an editor would.

    check_schema.py BONDLINE SCENE...

A scene is right if the schema accepts it; beside each scene, a copy with a misspelt key must be refused. One line per
scene; the last line counts. The exit status is 1 if a scene fails or if none was given.
"""

import json
import subprocess
import sys
import tomllib

import jsonschema


def main(bondline, names):
    schema = json.loads(subprocess.run([bondline, "schema"], check=True, capture_output=True).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    passed = failed = 0
    for name in names:
        with open(name, "rb") as file:
            scene = tomllib.load(file)
        wrong = [f"{'.'.join(map(str, e.absolute_path))}: {e.message[:200]}" for e in validator.iter_errors(scene)]
        for method in ("splice", "local", "partial-stress"):
            wrong += [e.message[:200] for e in validator.iter_errors({**scene, "coupling": method})]
        if validator.is_valid({**scene, "coupling": "spliced"}):
            wrong.append("the schema accepts a misspelt method")
        if validator.is_valid({**scene, "materiels": {}}):
            wrong.append("the schema accepts a misspelt key")
        print(f"{'FAILED' if wrong else 'passed'}  {name}" + "".join(f"\n        {w}" for w in wrong))
        failed += bool(wrong)
        passed += not wrong
    print(f"{passed} passed, {failed} failed")
    return 0 if failed == 0 and passed > 0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]) if len(sys.argv) > 2 else 1)
