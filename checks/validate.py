"""Are exported files valid?

    python checks/validate.py room.glb room.usda ...

GLB: Khronos' glTF-Validator (npm package gltf-validator, found by node from the current folder). USD: all validators of usd-core.
Errors and warnings count, hints and infos do not. Needs usd-core and node (checks/README.md).
"""

import json
import subprocess
import sys

from pxr import Usd, UsdValidation

NODE = """
const validator = require(require.resolve('gltf-validator', { paths: [process.cwd()] }));
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[1]));
validator.validateBytes(bytes).then(report => console.log(JSON.stringify(report.issues.messages)));
"""


def main():
    faults = 0
    for file in sys.argv[1:]:
        found = glb(file) if file.endswith(".glb") else usd(file)
        print(f"{file}: {len(found)} errors and warnings")
        for message in found:
            print(f"    {message}")
        faults += len(found)
    sys.exit(1 if faults else 0)


def glb(file):
    run = subprocess.run(["node", "-e", NODE, file], check=True, capture_output=True, text=True)
    # Severity 0 is an error, 1 a warning.
    return [f"{m['code']} {m['pointer']}: {m['message']}" for m in json.loads(run.stdout) if m["severity"] <= 1]


def usd(file):
    stage = Usd.Stage.Open(file)
    found = []
    for variant in stage.GetPrimAtPath("/Scene").GetVariantSet("lighting").GetVariantNames():
        stage.GetPrimAtPath("/Scene").GetVariantSet("lighting").SetVariantSelection(variant)
        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        errors = UsdValidation.ValidationContext(validators).Validate(stage)
        found += [f"{variant}: {error.GetName()}: {error.GetMessage()}" for error in errors]
    return found


if __name__ == "__main__":
    main()
